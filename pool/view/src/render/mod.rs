//! Pictures of a battle: [`Renderer`] draws moments without a window or a graphics card.
//!
//! The layers from the floor up: terrain (drawn once), sight and ranges, places of death, the lines and areas
//! of attacks, units on the ground, hits and heals, flying units, ids. Equal moments give equal bytes.

mod bodies;
mod camera;
mod canvas;
mod effects;
mod font;
mod letters;
mod overlays;
mod shapes;
mod terrain;
mod theme;

use std::sync::Arc;

use glam::Vec2;
use smaclite_engine::agent_ranges;
use smaclite_scenarios::{Faction, Placement, Scenario};
use smaclite_units::{Plane, UnitType};
use tiny_skia::Pixmap;

pub use camera::View;
use camera::{Camera, Region};
pub(crate) use canvas::Canvas;
pub(crate) use font::{Font, Place};
pub use letters::type_letters;
use shapes::Shapes;
use theme::Palette;
pub use theme::Theme;

use crate::{Moment, Picture, SizeError};

/// How many of the last ticks [`Renderer::render_recent`] shows, at most; older moments add nothing.
pub const RECENT_TICKS: usize = 24;

/// The smallest radius of a body in pixels: smaller units are drawn larger than they are.
const MIN_RADIUS: f32 = 3.0;

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Width in pixels, from [`Picture::MIN_SIDE`] to [`Picture::MAX_SIDE`].
    pub width: u32,
    /// Height in pixels, in the same range.
    pub height: u32,
    /// The part of the map.
    pub view: View,
    /// Show how far each agent sees.
    pub show_sight: bool,
    /// Show the attack range of each unit.
    pub show_range: bool,
    /// Show the target of each unit.
    pub show_targets: bool,
    /// Show the number of each unit within its faction; for allies this is the number of the agent.
    pub show_ids: bool,
    /// Background and contrast.
    pub theme: Theme,
}

impl Default for Options {
    /// 512 x 512 pixels, dark, the part of the map that units can reach, and nothing optional.
    fn default() -> Options {
        Options {
            width: 512,
            height: 512,
            view: View::Battlefield,
            show_sight: false,
            show_range: false,
            show_targets: false,
            show_ids: false,
            theme: Theme::Dark,
        }
    }
}

/// Draws the battles of one scenario. It keeps no state between pictures.
///
/// ```
/// use std::sync::Arc;
/// use smaclite_engine::{Arena, Battle, ExecutionOrder, Rules, Scratch};
/// use smaclite_scenarios::Scenario;
/// use smaclite_view::{Observer, Options, Renderer};
///
/// let scenario = Scenario::standard("2s3z").unwrap();
/// let mut battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::Smaclite)), 1);
/// let renderer = Renderer::new(&scenario, Options::default())?;
/// let mut observer = Observer::new(&scenario, &battle);
///
/// let mut moments = vec![observer.moment().clone()];
/// let observe = |tick: smaclite_engine::Tick<'_>| moments.push(observer.observe(tick.units).clone());
/// battle.step_observed(&[4; 5], ExecutionOrder::Drawn, &mut Scratch::new(), observe).unwrap();
///
/// let picture = renderer.render_recent(&moments);
/// assert_eq!((picture.width(), picture.height(), picture.rgb().len()), (512, 512, 512 * 512 * 3));
/// # Ok::<(), smaclite_view::SizeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Renderer {
    options: Options,
    camera: Camera,
    palette: &'static Palette,
    shapes: Shapes,
    /// All types of the scenario, and the letter of each.
    types: Arc<[DrawnType]>,
    units: Arc<[Placement]>,
    /// By battle-wide id.
    looks: Vec<Look>,
    /// Battle-wide ids in the order in which units are drawn.
    order: Vec<usize>,
    /// How many of `order` are on the ground.
    n_on_ground: usize,
    terrain: Arc<Pixmap>,
}

/// A unit type, and what pictures show of it.
#[derive(Clone, Debug)]
struct DrawnType {
    unit_type: UnitType,
    letter: char,
    /// How far agents of the type see, in squares.
    sight: f64,
}

/// What never changes about a unit's look; lengths in pixels.
#[derive(Clone, Debug)]
struct Look {
    unit_type: usize,
    faction: Faction,
    plane: Plane,
    letter: char,
    id: String,
    radius: f32,
    /// The attack range from the unit's centre to the edge of a target.
    range: f32,
    /// How far an agent of the type sees.
    sight: f32,
    hp: f32,
    shield: f32,
    energy: f32,
    cooldown: f32,
}

impl Look {
    fn new(unit: &Placement, index: usize, drawn: &DrawnType, scale: f32) -> Look {
        let DrawnType { unit_type, letter, sight } = drawn;
        Look {
            unit_type: index,
            faction: unit.faction,
            plane: unit_type.plane,
            letter: *letter,
            sight: *sight as f32 * scale,
            id: unit.id_in_faction.to_string(),
            radius: (unit_type.radius() as f32 * scale).max(MIN_RADIUS),
            range: (unit_type.radius() + unit_type.attack_range) as f32 * scale,
            hp: unit_type.hp as f32,
            shield: unit_type.shield as f32,
            energy: unit_type.energy as f32,
            cooldown: unit_type.cooldown as f32,
        }
    }
}

impl Renderer {
    /// Prepares pictures of a scenario's battles.
    ///
    /// # Errors
    /// A width or height that is too small or too large.
    pub fn new(scenario: &Scenario, options: Options) -> Result<Renderer, SizeError> {
        let Options { width, height, .. } = options;
        SizeError::check(width, height)?;
        let camera =
            Camera::new(options.view.region(scenario), Region::map(&scenario.terrain), width, height);
        let palette = options.theme.palette();
        let terrain = terrain::draw(&scenario.terrain, &camera, palette, width, height).ok_or(SizeError {
            width,
            height,
            max_side: Picture::MAX_SIDE,
        })?;
        let types = scenario.unit_types.iter().zip(type_letters(&scenario.unit_types));
        let types = types.map(|(unit_type, letter)| {
            let [sight, _] = agent_ranges(scenario.smacv2.as_ref(), unit_type);
            DrawnType { unit_type: unit_type.clone(), letter, sight }
        });
        let renderer = Renderer {
            options,
            camera,
            palette,
            shapes: Shapes::new(),
            types: types.collect(),
            units: scenario.units.as_slice().into(),
            looks: Vec::new(),
            order: Vec::new(),
            n_on_ground: 0,
            terrain: Arc::new(terrain),
        };
        Ok(renderer.of_types(scenario.units.iter().map(|unit| unit.unit_type)))
    }

    /// The same for units of these types.
    fn of_types(&self, types: impl Iterator<Item = usize>) -> Renderer {
        let look = |(unit, unit_type): (&Placement, usize)| {
            Look::new(unit, unit_type, &self.types[unit_type], self.camera.scale)
        };
        let looks: Vec<Look> = self.units.iter().zip(types).map(look).collect();
        let mut order: Vec<usize> = (0..looks.len()).collect();
        // Small units above large ones of their plane, flying ones above all.
        let is_flying = |id: &usize| looks[*id].plane == Plane::Air;
        order.sort_by(|a, b| {
            let by_size = looks[*b].radius.total_cmp(&looks[*a].radius);
            is_flying(a).cmp(&is_flying(b)).then(by_size)
        });
        let n_on_ground = order.iter().filter(|id| !is_flying(id)).count();
        Renderer { looks, order, n_on_ground, ..self.clone() }
    }

    /// The options.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Draws a moment and the attacks of its tick.
    ///
    /// # Panics
    /// If the moment is of a scenario with other units.
    pub fn render(&self, moment: &Moment) -> Picture {
        self.render_recent(std::slice::from_ref(moment))
    }

    /// Draws the last of these moments. Attacks and deaths of those before it are fading; more than
    /// [`RECENT_TICKS`] before it make no difference. Without a moment the picture shows the map.
    pub fn render_recent(&self, moments: &[Moment]) -> Picture {
        let moments = &moments[moments.len().saturating_sub(RECENT_TICKS + 1)..];
        let mut canvas = Canvas::over(Pixmap::clone(&self.terrain));
        if let Some(now) = moments.last() {
            let types = || now.units.iter().map(|unit| unit.unit_type);
            if self.looks.iter().map(|look| look.unit_type).eq(types()) {
                self.draw(&mut canvas, now, moments);
            } else {
                self.of_types(types()).draw(&mut canvas, now, moments);
            }
        }
        Picture::from_pixels(canvas.into_pixels())
    }

    fn draw(&self, canvas: &mut Canvas, now: &Moment, moments: &[Moment]) {
        if self.options.show_sight {
            overlays::draw_sight(self, canvas, now);
        }
        if self.options.show_range {
            overlays::draw_range(self, canvas, now);
        }
        effects::draw_below(self, canvas, moments);
        if self.options.show_targets {
            overlays::draw_targets(self, canvas, now);
        }
        let (on_ground, flying) = self.order.split_at(self.n_on_ground);
        self.draw_bodies(canvas, now, on_ground);
        effects::draw_above(self, canvas, moments);
        self.draw_bodies(canvas, now, flying);
        if self.options.show_ids {
            overlays::draw_ids(self, canvas, now);
        }
    }

    fn draw_bodies(&self, canvas: &mut Canvas, moment: &Moment, ids: &[usize]) {
        for &id in ids {
            if let Some(unit) = moment.units.get(id).filter(|unit| unit.alive) {
                bodies::draw(self, canvas, &self.looks[id], unit);
            }
        }
    }

    /// The width in pixels of a line that is `squares` wide, within what looks well.
    fn stroke(&self, squares: f32) -> f32 {
        (squares * self.camera.scale).clamp(1.0, 6.0)
    }

    /// Where a point of the map, in squares, is in the picture: pixels from its upper left corner. It may be
    /// outside the picture.
    pub fn pixel_of(&self, square: Vec2) -> Vec2 {
        self.camera.pixel(square)
    }

    /// The point of the map, in squares, at a point of the picture: the inverse of
    /// [`pixel_of`](Self::pixel_of).
    pub fn square_at(&self, pixel: Vec2) -> Vec2 {
        self.camera.square(pixel)
    }

    /// The radius in pixels with which a unit is drawn; `None` if there is no such unit.
    pub fn radius_of(&self, id: usize) -> Option<f32> {
        self.looks.get(id).map(|look| look.radius)
    }
}
