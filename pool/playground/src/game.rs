//! What a battle is played with, and how it begins.

use crate::protocol::Source;
use crate::source::{SourceError, setup_of, source_of};
use serde_json::{Value, json};
use smaclite_engine::{
    Arena, BattleSetup, Opponent, Opponents, OpponentsError, Sides, SnapshotError, UnknownRules,
};
use smaclite_scenarios::{Placement, Problems, Scenario};
use smaclite_units::{Keyword, Plane};
use smaclite_view::{Recorder, Replay, ReplayError};
use std::sync::Arc;

/// Squares by which a unit steps aside whose place is taken.
const ASIDE: f64 = 1.0 / 16.0;

/// Why there is no battle.
#[derive(Debug, thiserror::Error)]
pub(crate) enum GameError {
    #[error(transparent)]
    Source(#[from] SourceError),
    #[error("the scenario is not valid: {0}")]
    Invalid(Problems),
    #[error(transparent)]
    Opponent(#[from] OpponentsError),
    #[error(transparent)]
    Rules(#[from] UnknownRules),
    #[error("seed must be a whole number from 0 to {max}, got `{0}`", max = u64::MAX)]
    Seed(String),
    #[error("episode must be below {n_episodes}, got {episode}")]
    Episode { episode: usize, n_episodes: usize },
    #[error(transparent)]
    Replay(#[from] ReplayError),
    #[error("unit must be below {n_units}, got {unit}")]
    Unit { unit: usize, n_units: usize },
    #[error("this scenario draws where units start, so they cannot be moved")]
    Drawn,
    #[error("a trained team cannot play the enemies of a scenario with the key `smacv2`; scripts can")]
    Smacv2,
    #[error("the state at the start of the episode is not one of its scenario: {0}")]
    Snapshot(#[from] SnapshotError),
}

/// What a battle is played with.
pub(crate) struct Game {
    pub setup: BattleSetup,
    /// The same before opponent and rules were chosen: what the source of another battle says.
    own: BattleSetup,
    pub scenario: Scenario,
    pub arena: Arc<Arena>,
    /// The seed of its generator.
    pub seed: u64,
}

impl Game {
    /// A battle of a scenario or of the opened replay, at its start. In that of a scenario a team may play
    /// the enemies.
    pub fn begin(
        source: &Source,
        replay: Option<&Replay>,
        team_plays_enemies: bool,
    ) -> Result<(Game, Recorder), GameError> {
        let (scenario, seed, opponent, rules) = match source {
            Source::Episode { episode } => return Game::of_episode(*episode, replay),
            Source::Scenario { scenario, seed, opponent, rules } => (scenario, seed, opponent, rules),
        };
        let own = setup_of(scenario)?;
        let rules = if rules.is_empty() { own.rules } else { rules.parse()? };
        let seed = seed.parse().map_err(|_| GameError::Seed(seed.clone()))?;
        let setup = BattleSetup { rules, ..own.clone() };
        if team_plays_enemies {
            if own.files.scenario().is_ok_and(|scenario| scenario.smacv2.is_some()) {
                return Err(GameError::Smacv2);
            }
            return Game::of_setup(setup.with_sides(Sides::Mirrored), own, seed);
        }
        let opponents = match &opponent[..] {
            "" => setup.opponents.clone(),
            name => Opponents::from(Opponent::from_name(name)?),
        };
        opponents.check(setup.sides)?;
        Game::of_setup(BattleSetup { opponents, ..setup }, own, seed)
    }

    fn of_episode(episode: usize, replay: Option<&Replay>) -> Result<(Game, Recorder), GameError> {
        let episodes = replay.map_or(&[][..], Replay::episodes);
        let n_episodes = episodes.len();
        let (Some(replay), Some(recorded)) = (replay, episodes.get(episode)) else {
            return Err(GameError::Episode { episode, n_episodes });
        };
        let (setup, seed) = (replay.setup().clone(), recorded.start.seed);
        let own = setup.clone().with_sides(Sides::default()); // another battle is one of the agents alone
        let (game, mut recorder) = Game::of_setup(setup, own, seed)?;
        match &recorded.snapshot {
            Some(snapshot) => recorder.begin_at(snapshot)?,
            None => recorder.begin(recorded.start, recorded.opponent),
        }
        Ok((game, recorder))
    }

    fn of_setup(setup: BattleSetup, own: BattleSetup, seed: u64) -> Result<(Game, Recorder), GameError> {
        let recorder = Recorder::new(setup.clone(), seed).map_err(|error| match error {
            ReplayError::Scenario(problems) => GameError::Invalid(problems),
            other => other.into(),
        })?;
        let (scenario, arena) = (recorder.scenario().clone(), recorder.battle().arena().clone());
        Ok((Game { setup, own, scenario, arena, seed }, recorder))
    }

    /// The scenario as a request has it.
    pub fn source(&self) -> String {
        source_of(&self.own, &self.scenario)
    }

    /// The same with other keys of the scenario file.
    fn with_keys<const N: usize>(&self, keys: [(&str, Value); N]) -> String {
        let files = self.own.files.with_keys(keys.map(|(key, value)| (key.to_owned(), value)));
        source_of(&BattleSetup { files, ..self.own.clone() }, &self.scenario)
    }

    /// The source of the scenario with a unit that starts elsewhere; whether it can start there, reading
    /// tells.
    pub fn with_moved_unit(&self, unit: usize, x: f64, y: f64) -> Result<String, GameError> {
        let Scenario { units, unit_types, generation, .. } = &self.scenario;
        if generation.is_some() {
            return Err(GameError::Drawn);
        }
        let n_units = units.len();
        if unit >= n_units {
            return Err(GameError::Unit { unit, n_units });
        }
        // A unit alone in its group starts at the place of the group under all rules. Under `starcraft` a
        // colossus and another unit can begin at one point, which a file cannot say: one of them steps aside.
        let mut taken = Vec::new();
        let mut start_of = |id: usize, plane: Plane| {
            let [mut x, y] = if id == unit { [x, y] } else { self.arena.start(id) };
            while taken.contains(&(plane, [x, y])) {
                x += ASIDE;
            }
            taken.push((plane, [x, y]));
            [x, y]
        };
        let group = |(id, placed): (usize, &Placement)| {
            let [x, y] = start_of(id, unit_types[placed.unit_type].plane);
            let name = unit_types[placed.unit_type].name.as_str();
            // A unit file is called as the scenario file calls it, which may be by a path.
            let file = self.own.files.unit_files.iter().find(|file| file.name == name);
            let name = file.and_then(|file| file.keys.first()).map_or(name, String::as_str);
            json!({"x": x, "y": y, "faction": placed.faction.name(), "units": {name: 1}})
        };
        let groups = units.iter().enumerate().map(group).collect();
        Ok(self.with_keys([("groups", groups)]))
    }

    /// The source of the scenario with the map of these rows, as files have them; reading tells what is
    /// wrong.
    pub fn with_terrain(&self, rows: &[String]) -> String {
        self.with_keys([("terrain", json!(rows))])
    }

    /// What is probably a mistake in a scenario that somebody has changed or written.
    pub fn warnings(&self) -> Vec<String> {
        self.setup.warnings().into_iter().map(|warning| warning.message).collect()
    }
}
