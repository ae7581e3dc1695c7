//! `smaclite-pool record`: battles of a scripted policy, or of a running pool, as a replay file.

use super::process::{Interrupted, interruption};
use super::snapshot::SavedBattle;
use super::{CommandResult, completions, replay, runtime_dir};
use crate::check::warn_of;
use crate::files::check_file_of;
use crate::number::{count, seed};
use crate::opponent::scripts;
use crate::usage::file_ending_in;
use clap::Args;
use smaclite_engine::policy::{Scripted, UnknownPolicy};
use smaclite_engine::{BattleSetup, Generator, Opponent, Opponents, Rules, Sides, Snapshot};
use smaclite_ipc::{ClientError, ControlSocketError, WaitOptions};
use smaclite_learn::resolve_scenario;
use smaclite_pool::MAX_ENVS;
use smaclite_recorder::PoolRecorder;
use smaclite_view::{Recorder, Replay, SUFFIX};
use std::error::Error;
use std::path::PathBuf;
use std::time::{Duration, Instant};

#[derive(Args)]
#[command(after_help = "\
Examples:
  smaclite-pool record 2s3z --policy focus_fire --out 2s3z.smreplay
  smaclite-pool record 2s3z --from crisis.snapshot --policy kite --out crisis.smreplay
  smaclite-pool record --pool train --env 0 --env 1 --episodes 10 --out train.smreplay

`smaclite-pool replay 2s3z.smreplay --to 2s3z.html` makes a page of a replay.")]
pub(super) struct Record {
    /// A standard scenario or a scenario file; without an episode limit, its episodes end after 1000 steps
    #[arg(required_unless_present_any = ["pool", "from"], add = completions::scenario())]
    scenario: Option<String>,
    /// Begin every episode in the state of this snapshot, which tells the rules and, if it is a standard one,
    /// the scenario. Later episodes and --seed draw other execution orders than the snapshot's
    #[arg(long, value_name = "FILE.snapshot", conflicts_with_all = ["pool", "rules"])]
    from: Option<PathBuf>,
    /// Record this running pool, instead of battles of a scripted policy, until the episodes are complete or
    /// Ctrl-C; its learner does not notice
    #[arg(long, value_name = "NAME", conflicts_with_all = ["scenario", "policy", "seed", "rules"],
        add = completions::pool())]
    pool: Option<String>,
    /// Lane of the pool [default: its only lane]
    #[arg(long, requires = "pool", conflicts_with_all = ["scenario", "from"], value_name = "NAME")]
    lane: Option<String>,
    /// An environment of the lane, several times for several [default: 0]
    #[arg(long, requires = "pool", conflicts_with_all = ["scenario", "from"], value_name = "ID",
        value_parser = count(0..=MAX_ENVS - 1))]
    env: Vec<usize>,
    /// The policy of the agents: random, nearest, focus_fire, kite, hold, line, flank, escort or spread
    #[arg(long, default_value = "nearest", value_name = "NAME", value_parser = policy_name)]
    policy: String,
    /// Who plays the enemies: attack_move, attack_nearest or a scripted policy; or several with weights, such
    /// as attack_move=0.5,focus_fire=0.5, of which each episode draws one [default: the scenario's own]
    #[arg(long, conflicts_with = "pool", value_name = "NAME|WEIGHTS", value_parser = scripts)]
    opponent: Option<Opponents>,
    /// Number of complete episodes, 1 to 10000
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = count(1..=10_000))]
    episodes: usize,
    /// Seed of the battle and of the policy `random` [default: 0]
    #[arg(long, value_parser = seed())]
    seed: Option<u64>,
    /// Rules of the battles: smaclite (as the published environment plays), paper (as its paper describes) or
    /// starcraft (nearer to the real battles)
    #[arg(long, default_value = "smaclite")]
    rules: Rules,
    /// The replay file, NAME.smreplay; a file of that name is replaced
    #[arg(long, value_name = "FILE", value_parser = file_ending_in(SUFFIX))]
    out: PathBuf,
}

/// How often a running pool is read.
const READ_INTERVAL: Duration = Duration::from_millis(50);

/// How long a pool is waited for after a signal.
const LAST_READ: Duration = Duration::from_millis(500);

/// Why a recording is not complete, if it is not.
type WhyEarly = Option<Box<dyn Error>>;

impl Record {
    pub(super) fn run(self) -> CommandResult {
        check_file_of("--out", &self.out)?;
        let (recorded, why_early) = match &self.pool {
            Some(pool) => self.follow(pool)?,
            None => (self.play()?, None),
        };
        replay::print_recorded(&recorded, &self.out)?;
        why_early.map_or(Ok(()), Err)
    }

    /// Plays and writes the episodes of a scripted policy.
    fn play(&self) -> Result<Replay, Box<dyn Error>> {
        let (setup, mut start) = self.start()?;
        warn_of(&setup);
        let seed = self.seed.unwrap_or(0);
        let mut recorder = Recorder::new(setup, seed)?;
        let mut policy = Scripted::from_name(&self.policy, seed)?;
        let mut actions = vec![0; recorder.scenario().n_agents()];
        for episode in 0..self.episodes {
            if let Some(snapshot) = &start {
                recorder.begin_at(snapshot)?;
            } else if episode > 0 {
                recorder.reset();
            }
            while !recorder.battle().is_over() {
                policy.act(recorder.battle(), &mut actions);
                recorder.step(&actions)?;
            }
            if let Some(snapshot) = &mut start {
                snapshot.generator = recorder.battle().generator().clone();
            }
        }
        let recorded = recorder.finish();
        recorded.write(&self.out)?;
        Ok(recorded)
    }

    /// What is played, and the state in which episodes begin, if that is not the one after a reset.
    fn start(&self) -> Result<(BattleSetup, Option<Snapshot>), Box<dyn Error>> {
        let scenario = self.scenario.as_deref();
        let Some(from) = &self.from else {
            let setup = resolve_scenario(scenario.unwrap_or_default(), self.rules)?;
            let opponents = self.opponent.clone().unwrap_or_else(|| setup.opponents.clone());
            return Ok((BattleSetup { opponents, ..setup }, None));
        };
        let saved = self.with_opponent(SavedBattle::read(from, scenario)?)?;
        let SavedBattle { setup, arena, mut snapshot, .. } = saved;
        if snapshot.is_over(&arena) {
            return Err(format!("`{}`: the battle is over; nothing can be recorded", from.display()).into());
        }
        if let Some(seed) = self.seed {
            snapshot.generator = Generator::new(seed);
        }
        Ok((setup, Some(snapshot)))
    }

    /// Who plays the enemies from the snapshot on: who is named, or who did; but a learner cannot go on
    /// here, so that the scenario's own opponent takes its place.
    fn with_opponent(&self, saved: SavedBattle) -> Result<SavedBattle, Box<dyn Error>> {
        let own = || Opponents::of(&saved.setup.files, Sides::Allies);
        let opponents = match &self.opponent {
            Some(named) => named.clone(),
            None if saved.snapshot.opponent == Opponent::Learner => own(),
            None => return Ok(saved),
        };
        match opponents.weights() {
            [(opponent, _)] => Ok(saved.against(*opponent)?),
            _ => Err("--opponent must be one opponent beside --from, not several".into()),
        }
    }

    /// Follows environments of a running pool, and writes what they did also if the pool ends, or a signal
    /// ends the recording.
    fn follow(&self, pool: &str) -> Result<(Replay, WhyEarly), Box<dyn Error>> {
        let interrupted = interruption()?;
        let env_ids = if self.env.is_empty() { &[0][..] } else { &self.env };
        let mut is_interrupted = || interrupted();
        let wait = WaitOptions::interrupted_by(&mut is_interrupted);
        let lane = self.lane.as_deref();
        let mut recorder = PoolRecorder::connect(&runtime_dir()?, pool, lane, env_ids, self.episodes, wait)?;
        let is_complete = |recorder: &PoolRecorder| recorder.n_complete() >= self.episodes as u64;
        let mut why_early: WhyEarly = None;
        while !is_complete(&recorder) && why_early.is_none() {
            std::thread::sleep(READ_INTERVAL);
            match recorder.read(WaitOptions::interrupted_by(&mut is_interrupted)) {
                Ok(()) | Err(ClientError::Control(ControlSocketError::Interrupted { .. })) => {}
                Err(error) => why_early = Some(error.into()),
            }
            if interrupted() {
                // What the pool still has; one that does not answer is not waited for.
                let end = Instant::now() + LAST_READ;
                let _ = recorder.read(WaitOptions::interrupted_by(&mut || Instant::now() > end));
                why_early.get_or_insert(Interrupted.into());
            }
        }
        if recorder.n_missing() > 0 {
            err!(
                "smaclite-pool: {} episodes were lost: they ended faster than they could be read",
                recorder.n_missing()
            );
        }
        let is_early = !is_complete(&recorder);
        let recorded = recorder.replay(is_early)?;
        if recorded.episodes().is_empty() {
            return Err("no episode began while the pool was recorded".into());
        }
        recorded.write(&self.out)?;
        Ok((recorded, why_early.filter(|_| is_early)))
    }
}

fn policy_name(name: &str) -> Result<String, UnknownPolicy> {
    Scripted::from_name(name, 0).map(|_| name.to_owned())
}
