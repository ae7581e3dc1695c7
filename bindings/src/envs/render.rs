//! Pictures of battles for Python, drawn from the `state` field of batches.

use super::Envs;
use super::arg::ScenarioArg;
use crate::arrays::{self, Int32Array, require_envs};
use crate::batch::Batch;
use crate::convert::{self, IntArg, to_unsigned};
use crate::errors::invalid_request;
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyString;
use smaclite_engine::{FeatureBlock, state_features};
use smaclite_pool::fields::Field;
use smaclite_scenarios::Scenario;
use smaclite_view::{Cell, Moment, Options, Picture, Sheet, SizeError, Theme};

/// Pixels per side of the pictures in a sheet that `Envs.render` draws without a renderer.
const SHEET_CELL: u32 = 256;

pub(crate) type Pixels<'py> = Bound<'py, PyArray3<u8>>;

/// Draws the battles of one scenario from above, with north at the top. It needs no window and no graphics
/// card, and equal states give equal pictures.
///
///     renderer = smaclite_pool.Renderer("2s3z", width=512, height=512)
///     picture = renderer.render(batch.state[0])             # uint8 [512, 512, 3]
///     sheet = renderer.sheet(batch.state, batch.env_id)     # uint8, all environments with their numbers
///
/// A state contains neither targets nor attacks: units face their nearest living opponent. The dead are not
/// drawn.
///
/// Args:
///     scenario: name of a standard scenario, path of a scenario file, or `Envs`, whose scenario it draws.
///     width, height: size of a picture in pixels, each from 16 to 4096.
///     theme: "dark" or "light".
///     show_sight: show how far each agent sees.
///     show_range: show the attack range of each unit.
///     show_ids: show the number of each unit within its side.
///
/// Raises:
///     ScenarioError: the scenario is unknown, or its file or a unit file is invalid.
///     PoolDied: the pool that the environments attached to has ended.
///     InvalidRequest: the size or the theme is invalid, or states have no units (`obs_instead_of_state` of
///         `smacv2`).
///     TypeError: the width or height is not an integer.
#[pyclass(frozen, module = "smaclite_pool")]
pub struct Renderer {
    scenario: Scenario,
    renderer: smaclite_view::Renderer,
    state_size: usize,
}

impl Renderer {
    fn of(py: Python<'_>, scenario: Scenario, options: Options) -> PyResult<Renderer> {
        require_units_in_states("pictures show", &scenario)?;
        let state_size = state_size(&scenario);
        let renderer = py.detach(|| smaclite_view::Renderer::new(&scenario, options));
        Ok(Renderer { renderer: renderer.map_err(invalid_request)?, scenario, state_size })
    }

    fn picture(&self, state: &[f32]) -> Picture {
        self.renderer.render(&Moment::from_state(&self.scenario, state))
    }

    /// Draws one state.
    fn draw<'py>(&self, py: Python<'py>, state: &[f32]) -> PyResult<Pixels<'py>> {
        pixels(py, py.detach(|| self.picture(state)))
    }

    /// Draws states as a sheet, each with its caption or the number of its environment.
    fn draw_sheet<'py>(
        &self,
        py: Python<'py>,
        states: &[&[f32]],
        env_ids: &[i32],
        style: SheetStyle,
    ) -> PyResult<Pixels<'py>> {
        let sheet = Sheet { columns: style.columns, theme: self.renderer.options().theme };
        let captions = style.captions_for(env_ids)?;
        let Options { width, height, .. } = *self.renderer.options();
        sheet.size(env_ids.len(), width, height).map_err(|error| sheet_error(env_ids.len(), error))?;
        let sheet = py.detach(|| {
            let pictures: Vec<Picture> = states.iter().map(|state| self.picture(state)).collect();
            let cells = pictures.iter().zip(&captions);
            let cells: Vec<Cell<'_>> = cells.map(|(picture, caption)| Cell { picture, caption }).collect();
            sheet.compose(&cells)
        });
        pixels(py, sheet.map_err(|error| sheet_error(env_ids.len(), error))?)
    }
}

/// How a sheet is put together.
pub struct SheetStyle {
    /// As in [`Sheet`], where 0 means the default.
    columns: usize,
    captions: Option<Vec<String>>,
}

impl SheetStyle {
    pub fn new(columns: Option<IntArg>, captions: Option<&Bound<'_, PyAny>>) -> PyResult<SheetStyle> {
        let columns = match columns.map(|columns| to_unsigned("columns", columns)).transpose()? {
            Some(0) => return Err(invalid_request("columns must be at least 1, or None, got 0")),
            columns => columns.unwrap_or(0),
        };
        let list = |captions| convert::string_list("captions", r#"["first"]"#, captions);
        let captions = captions.map(list).transpose()?;
        Ok(SheetStyle { columns, captions })
    }

    /// One caption per picture.
    fn is_default(&self) -> bool {
        self.columns == 0 && self.captions.is_none()
    }

    fn captions_for(self, env_ids: &[i32]) -> PyResult<Vec<String>> {
        match self.captions {
            Some(captions) if captions.len() == env_ids.len() => Ok(captions),
            Some(captions) => {
                let (expected, got) = (env_ids.len(), captions.len());
                Err(invalid_request(format!(
                    "captions must have one string per picture, {expected}, got {got}"
                )))
            }
            None => Ok(env_ids.iter().map(i32::to_string).collect()),
        }
    }
}

#[pymethods]
impl Renderer {
    #[new]
    #[pyo3(signature = (scenario, width=IntArg::Small(512), height=IntArg::Small(512), *, theme="dark",
        show_sight=false, show_range=false, show_ids=false))]
    #[pyo3(text_signature = "(scenario, width=512, height=512, *, theme='dark', show_sight=False, \
        show_range=False, show_ids=False)")]
    #[allow(clippy::too_many_arguments)] // keyword arguments in Python
    fn new(
        py: Python<'_>,
        scenario: ScenarioArg<'_>,
        width: IntArg,
        height: IntArg,
        theme: &str,
        show_sight: bool,
        show_range: bool,
        show_ids: bool,
    ) -> PyResult<Renderer> {
        let (width, height) = (to_unsigned("width", width)?, to_unsigned("height", height)?);
        let theme = to_theme(theme)?;
        let options =
            Options { width, height, show_sight, show_range, show_ids, theme, ..Options::default() };
        let (rules, scenario) = (scenario.rules()?, scenario.resolve(py)?);
        Renderer::of(py, rules.figures(&scenario).into_owned(), options)
    }

    /// Draw one battle.
    ///
    /// Args:
    ///     state: float32 [state_size], a row of the `state` field of a batch.
    ///
    /// Returns:
    ///     uint8 [height, width, 3].
    ///
    /// Raises:
    ///     InvalidRequest: the state has another shape.
    ///     TypeError: the state is not an array of floats.
    fn render<'py>(&self, py: Python<'py>, state: &Bound<'py, PyAny>) -> PyResult<Pixels<'py>> {
        let state = arrays::float32_array("state", state, &[Some(self.state_size)])?;
        self.draw(py, &state.to_vec()?)
    }

    /// Draw many battles in one picture, row by row, each with its caption above it.
    ///
    /// Args:
    ///     states: float32 [M, state_size], the `state` field of a batch; at least one row.
    ///     env_id: integers [M], the numbers to show; None for 0 to M - 1.
    ///     columns: pictures per row; None for about as many as there are rows.
    ///     captions: M strings to show instead of numbers.
    ///
    /// Returns:
    ///     uint8 [sheet height, sheet width, 3].
    ///
    /// Raises:
    ///     InvalidRequest: an argument has another shape, there is no row, `columns` is not positive, or the
    ///         sheet would be wider or higher than 16384 pixels.
    ///     TypeError: the states are not floats, `env_id` or `columns` are not integers, or `captions` are
    ///         not strings.
    #[pyo3(signature = (states, env_id=None, columns=None, captions=None))]
    fn sheet<'py>(
        &self,
        py: Python<'py>,
        states: &Bound<'py, PyAny>,
        env_id: Option<&Bound<'py, PyAny>>,
        columns: Option<IntArg>,
        captions: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Pixels<'py>> {
        let style = SheetStyle::new(columns, captions)?;
        let states = arrays::float32_array("states", states, &[None, Some(self.state_size)])?;
        let count = states.len();
        if count == 0 {
            return Err(invalid_request("states must have at least one row, got none"));
        }
        let ids = env_id.map(|ids| arrays::int32_array("env_id", ids, &[None])).transpose()?;
        let ids = match ids {
            Some(ids) if ids.len() == count => ids.as_slice()?.to_vec(),
            Some(ids) => {
                let got = ids.len();
                return Err(invalid_request(format!(
                    "env_id must have one number per row of states, {count}, got {got}"
                )));
            }
            None => (0..).take(count).collect(),
        };
        let states = states.to_vec()?;
        let rows: Vec<&[f32]> = states.chunks_exact(self.state_size).collect();
        self.draw_sheet(py, &rows, &ids, style)
    }

    /// Size of the states that it draws.
    #[getter]
    fn state_size(&self) -> usize {
        self.state_size
    }

    fn __repr__(&self) -> String {
        let Options { width, height, .. } = self.renderer.options();
        format!("<smaclite_pool.Renderer of {}, {width} x {height} pixels>", self.scenario.name)
    }
}

/// The environments whose pictures `Envs.render` returns.
enum Selection<'py> {
    One(u32),
    Some(Int32Array<'py>),
    All,
}

impl<'py> Selection<'py> {
    fn new(env_id: Option<&Bound<'py, PyAny>>, num_envs: usize) -> PyResult<Selection<'py>> {
        let Some(arg) = env_id else { return Ok(Selection::All) };
        match arg.extract::<IntArg>()? {
            IntArg::Other(other) if arg.is_instance_of::<PyString>() || arg.try_iter().is_err() => {
                Err(other.error("env_id must be an integer, integers of shape (K,) or bool of shape (N,)"))
            }
            IntArg::Other(_) => {
                let ids = arrays::env_ids("env_id", arg, num_envs)?;
                require_envs(ids.as_slice()?)?;
                Ok(Selection::Some(ids))
            }
            one => Ok(Selection::One(to_unsigned("env_id", one)?)),
        }
    }
}

/// `Envs.render`: a picture of one environment of a batch, or a sheet of many.
pub fn render_batch<'py>(
    py: Python<'py>,
    envs: &Envs,
    batch: &Batch,
    env_id: Option<&Bound<'py, PyAny>>,
    renderer: Option<&Bound<'py, Renderer>>,
    style: SheetStyle,
) -> PyResult<Pixels<'py>> {
    let selection = Selection::new(env_id, envs.lane_description().settings.num_envs)?;
    let (states, in_batch) = (batch.floats(py, Field::State)?, batch.env_id(py)?);
    let own; // lives as long as `renderer`
    let renderer = match renderer {
        Some(renderer) => renderer.get(),
        None => {
            own = default_renderer(py, envs, !matches!(selection, Selection::One(_)))?;
            &own
        }
    };
    let (size, expected) = (batch.layout().sizes().state_size, renderer.state_size);
    if size != expected {
        let name = &renderer.scenario.name;
        return Err(invalid_request(format!(
            "states of the batch must have {expected} features, as in `{name}` of the renderer, got {size}"
        )));
    }
    let state_of = |env: i64| {
        let slot = slot_of(env, &in_batch, envs.lane_description().settings.num_envs)?;
        Ok::<_, PyErr>(&states[slot * size..(slot + 1) * size])
    };
    let ids = match &selection {
        Selection::One(_) if !style.is_default() => {
            return Err(invalid_request(
                "columns and captions are for sheets of several pictures; pass env_id as a list, or leave \
                 them out",
            ));
        }
        Selection::One(env) => return renderer.draw(py, state_of(i64::from(*env))?),
        Selection::Some(ids) => ids.as_slice()?,
        Selection::All => &in_batch,
    };
    let selected: Vec<&[f32]> = ids.iter().map(|env| state_of(i64::from(*env))).collect::<PyResult<_>>()?;
    renderer.draw_sheet(py, &selected, ids, style)
}

/// The slot of an environment in a batch.
fn slot_of(env: i64, in_batch: &[i32], num_envs: usize) -> PyResult<usize> {
    if usize::try_from(env).is_ok_and(|env| env < num_envs) {
        let slot = in_batch.iter().position(|other| i64::from(*other) == env);
        return slot.ok_or_else(|| {
            invalid_request(format!("environment {env} is not in this batch; its env_id says which ones are"))
        });
    }
    Err(invalid_request(format!("env_id must be between 0 and {}, got {env}", num_envs - 1)))
}

/// Refuses scenarios whose states are all observations, for what reads the units of states.
pub fn require_units_in_states(what: &str, scenario: &Scenario) -> PyResult<()> {
    match &scenario.smacv2 {
        Some(options) if options.obs_instead_of_state => Err(invalid_request(format!(
            "{what} the units of states, but `obs_instead_of_state` of `smacv2` is true"
        ))),
        _ => Ok(()),
    }
}

/// A renderer of a lane's scenario.
fn default_renderer(py: Python<'_>, envs: &Envs, is_sheet: bool) -> PyResult<Renderer> {
    let scenario = envs.rules()?.figures(&envs.scenario_of_lane(py)?).into_owned();
    let default = Options::default();
    let cell = Options { width: SHEET_CELL, height: SHEET_CELL, ..default };
    Renderer::of(py, scenario, if is_sheet { cell } else { default })
}

fn state_size(scenario: &Scenario) -> usize {
    state_features(scenario).last().map_or(0, FeatureBlock::end)
}

fn to_theme(name: &str) -> PyResult<Theme> {
    match name {
        "dark" => Ok(Theme::Dark),
        "light" => Ok(Theme::Light),
        _ => Err(invalid_request(format!("theme must be \"dark\" or \"light\", got `{name}`"))),
    }
}

fn sheet_error(count: usize, error: SizeError) -> PyErr {
    invalid_request(format!("a sheet of {count} pictures is too large: {error}; draw fewer or smaller ones"))
}

pub(crate) fn pixels(py: Python<'_>, picture: Picture) -> PyResult<Pixels<'_>> {
    let shape = [picture.height() as usize, picture.width() as usize, 3];
    PyArray1::from_vec(py, picture.into_rgb()).reshape(shape)
}
