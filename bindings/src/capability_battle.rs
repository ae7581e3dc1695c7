//! One battle in this process, for code that expects an environment of SMACv2: it looks as often as that code
//! asks, which the faults of the published code depend on. Learners use pools.

use crate::envs::render::{Pixels, pixels};
use crate::errors::{class, invalid_request};
use numpy::{PyArray1, PyArray2, PyArrayMethods, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use serde_json::value::RawValue;
use smaclite_engine::smacv2::{Frame, Interface, Perception};
use smaclite_engine::{Battle, BattleSetup, Faction, IllegalAction, Scratch};
use smaclite_scenarios::{Scenario, ScenarioFiles};
use smaclite_view::{Observer, Options, Renderer};
use std::sync::Arc;

/// One battle of a scenario with the options `smacv2`, in this process.
///
/// `scenario` is the contents of a scenario file, as a dict, or the name of a standard scenario, to whose key
/// `smacv2` these options are added. Shapes use A for `n_agents`, E for `n_enemies` and N for `n_actions`;
/// units are numbered agents first. Raises ScenarioError if the contents are invalid, and ValueError if they
/// have no key `smacv2`.
#[pyclass(module = "smaclite_pool._native", name = "CapabilityBattle")]
pub struct CapabilityBattle {
    scenario: Scenario,
    battle: Battle,
    scratch: Scratch,
    /// The present episode is the one that the battle was made with, and nobody has begun it.
    is_fresh: bool,
}

fn invalid(error: impl ToString) -> PyErr {
    class::ScenarioError::new_err(error.to_string())
}

/// Reward, whether the battle is over, and `info`.
type Stepped<'py> = (f64, bool, Bound<'py, PyDict>);

#[pymethods]
impl CapabilityBattle {
    #[new]
    #[pyo3(signature = (scenario, seed=0, smacv2=None))]
    fn new(
        scenario: &Bound<'_, PyAny>,
        seed: u64,
        smacv2: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<CapabilityBattle> {
        let json = |value: &Bound<'_, PyAny>| -> PyResult<String> {
            scenario.py().import("json")?.call_method1("dumps", (value,))?.extract()
        };
        let files = match scenario.cast::<PyString>() {
            Ok(name) => ScenarioFiles::resolve(&name.to_string()).map_err(invalid)?.1,
            Err(_) => {
                let (source, text) = ("scenario".to_owned(), json(scenario)?);
                ScenarioFiles { source, text, unit_files: Vec::new() }
            }
        };
        // What Python writes for NaN is no JSON.
        let read = |options: String| RawValue::from_string(options).map_err(invalid);
        let options = smacv2.map(json).transpose()?.map(read).transpose()?;
        let files = files.with_keys(options.map(|options| ("smacv2".to_owned(), options)));
        let (scenario, arena) = BattleSetup::new(files).arena().map_err(invalid)?;
        if arena.interface().is_none() {
            return Err(PyValueError::new_err("the scenario needs the key `smacv2`"));
        }
        let battle = Battle::new(Arc::new(arena), seed);
        Ok(CapabilityBattle { scenario, battle, scratch: Scratch::new(), is_fresh: true })
    }

    #[getter]
    fn n_agents(&self) -> usize {
        self.battle.arena().sizes().n_agents
    }

    #[getter]
    fn n_enemies(&self) -> usize {
        self.battle.arena().sizes().n_enemies
    }

    #[getter]
    fn n_actions(&self) -> usize {
        self.battle.arena().sizes().n_actions
    }

    #[getter]
    fn obs_size(&self) -> usize {
        self.battle.arena().sizes().obs_size
    }

    #[getter]
    fn state_size(&self) -> usize {
        self.battle.arena().sizes().state_size
    }

    #[getter]
    fn cap_size(&self) -> PyResult<usize> {
        Ok(self.perceived()?.0.cap_size())
    }

    #[getter]
    fn episode_limit(&self) -> Option<u32> {
        self.battle.arena().episode_limit()
    }

    /// The unit types of the scenario.
    #[getter]
    fn type_names(&self) -> Vec<&str> {
        self.scenario.unit_types.iter().map(|unit_type| &*unit_type.name).collect()
    }

    /// Whether the enemies have won.
    #[getter]
    fn is_lost(&self) -> bool {
        self.battle.is_won_by(Faction::Enemy)
    }

    /// Begins an episode, from a seed or where the random generator is, and lets the agents look once.
    #[pyo3(signature = (seed=None))]
    fn reset(&mut self, seed: Option<u64>) {
        if let Some(seed) = seed {
            self.battle = Battle::new(Arc::clone(self.battle.arena()), seed);
        } else if !self.is_fresh {
            self.battle.reset();
        }
        self.is_fresh = false;
    }

    /// Steps by one available action per agent, and lets the agents look once.
    ///
    /// Returns the reward, whether the battle is over, and `battle_won`, `dead_allies`, `dead_enemies`, and
    /// `episode_limit` (True) if the episode reached its limit while the battle is not over. Raises
    /// IllegalAction; then nothing was stepped.
    fn step<'py>(&mut self, py: Python<'py>, actions: Vec<i32>) -> PyResult<Stepped<'py>> {
        let step = self.battle.step(&actions, &mut self.scratch);
        let step = step.map_err(|why: IllegalAction| class::IllegalAction::new_err(why.to_string()))?;
        self.is_fresh = false;
        let info = PyDict::new(py);
        info.set_item("battle_won", step.battle_won)?;
        info.set_item("dead_allies", self.battle.dead_allies())?;
        info.set_item("dead_enemies", self.battle.dead_enemies())?;
        let is_at_limit = self.episode_limit().is_some_and(|limit| self.battle.episode_length() >= limit);
        if is_at_limit && self.perceived()?.0.is_undecided(self.perceived()?.1) {
            info.set_item("episode_limit", true)?;
        }
        Ok((step.reward, step.terminated, info))
    }

    /// Lets the agents look once more, which the published code does at each observation.
    fn perceive(&mut self) {
        self.battle.perceive_again();
    }

    /// float32 [A, obs_size]: what the agents saw when they looked last.
    fn obs<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let mut out = vec![0.0; self.n_agents() * self.obs_size()];
        self.battle.write_obs(Faction::Ally, &mut out, &mut self.scratch);
        out.to_pyarray(py).reshape([self.n_agents(), self.obs_size()])
    }

    /// float32 [state_size].
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        let mut out = vec![0.0; self.state_size()];
        self.battle.write_state(Faction::Ally, &mut out);
        out.to_pyarray(py)
    }

    /// uint8 [A, N]: 1 for an available action.
    fn avail<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u8>>> {
        let mut out = vec![0; self.n_agents() * self.n_actions()];
        self.battle.write_avail_actions(Faction::Ally, &mut out);
        out.to_pyarray(py).reshape([self.n_agents(), self.n_actions()])
    }

    /// float32 [A, cap_size]: attack probability and health level, where they are drawn, and the type.
    fn capabilities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let (interface, frame, perception) = self.perceived()?;
        let mut out = vec![0.0; self.n_agents() * interface.cap_size()];
        // Without capabilities and types there is nothing to write.
        if !out.is_empty() {
            interface.write_capabilities(frame, perception, &mut out);
        }
        out.to_pyarray(py).reshape([self.n_agents(), interface.cap_size()])
    }

    /// uint8 [A, A + E]: 1 for a unit in sight.
    fn visibility<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u8>>> {
        let (interface, frame, _) = self.perceived()?;
        let n_units = self.n_agents() + self.n_enemies();
        let mut out = vec![0; self.n_agents() * n_units];
        interface.write_visibility(frame, &mut out);
        out.to_pyarray(py).reshape([self.n_agents(), n_units])
    }

    /// The share of the episode limit that is over.
    fn time(&self) -> PyResult<f64> {
        let (interface, _, perception) = self.perceived()?;
        Ok(interface.time(perception))
    }

    /// The unscaled return that is scaled to `reward_scale_rate`.
    fn max_reward(&self) -> PyResult<f64> {
        Ok(self.perceived()?.2.max_reward)
    }

    /// By name, an array [A + E]: `type` (index into `type_names`), `x`, `y` (squares), `health`, `shield`,
    /// `health_max`, `shield_max`, `energy`, `cooldown` (seconds). The dead have no health.
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (_, frame, _) = self.perceived()?;
        let of_type = |unit_type: u32| &self.scenario.unit_types[unit_type as usize];
        let of_kind = |healers: bool| {
            let of_unit = frame.types.iter().zip(&frame.readiness);
            let value = |(unit_type, value): (&u32, &f64)| {
                if of_type(*unit_type).is_healer() == healers { *value } else { 0.0 }
            };
            of_unit.map(value).collect::<Vec<f64>>()
        };
        let maxima = |value: fn(&smaclite_units::UnitType) -> f64| {
            frame.types.iter().map(|unit_type| value(of_type(*unit_type))).collect::<Vec<f64>>()
        };
        let units = PyDict::new(py);
        units.set_item("type", frame.types.to_pyarray(py))?;
        units.set_item("x", frame.x.to_pyarray(py))?;
        units.set_item("y", frame.y.to_pyarray(py))?;
        units.set_item("health", frame.health.to_pyarray(py))?;
        units.set_item("shield", frame.shield.to_pyarray(py))?;
        units.set_item("health_max", maxima(|unit_type| unit_type.hp).to_pyarray(py))?;
        units.set_item("shield_max", maxima(|unit_type| unit_type.shield).to_pyarray(py))?;
        units.set_item("energy", of_kind(true).to_pyarray(py))?;
        units.set_item("cooldown", of_kind(false).to_pyarray(py))?;
        Ok(units)
    }

    /// uint8 [height, width, 3]: a picture from above, with north at the top. Raises InvalidRequest for a
    /// size that is not between 16 and 4096 pixels.
    fn picture<'py>(&self, py: Python<'py>, width: u32, height: u32) -> PyResult<Pixels<'py>> {
        let options = Options { width, height, ..Options::default() };
        let renderer = Renderer::new(&self.scenario, options).map_err(invalid_request)?;
        pixels(py, renderer.render(Observer::new(&self.scenario, &self.battle).moment()))
    }
}

impl CapabilityBattle {
    fn perceived(&self) -> PyResult<(&Interface, &Frame, &Perception)> {
        self.battle.perceived().ok_or_else(|| PyValueError::new_err("the scenario needs the key `smacv2`"))
    }
}
