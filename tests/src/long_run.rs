//! The long run: random battles in pools, each environment compared with the engine alone by a checksum of
//! what it showed. A comparison row by row, as that of a [`Learner`](crate::Learner), takes longer than the
//! battles; this one is for errors that are too rare for it.
//!
//! Rounds are played, as many at a time as there are cores. Each has a pool of its own, whose number of
//! environments, batch size, threads, autoreset mode and rules are drawn from the seed. Then the engine plays
//! the same environments, one after another, on one thread. Both choose actions from the masks that they see,
//! so the first wrong bit changes all that follows.
//!
//! Memory, descriptors, mappings and files of the process must not grow from the first pools to the last.

use crate::TestDir;
use crate::process::TIMEOUT;
use crate::resources::ResourceMonitor;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use smaclite_engine::{Arena, Battle, BattleSetup, Faction, Rules, Scratch, Sizes};
use smaclite_ipc::{Batch, LaneConfig, Order, Supervisor, SupervisorConfig, WaitOptions, WaitStrategy};
use smaclite_pool::fields::Field;
use smaclite_pool::{Autoreset, LaneSettings, PoolOptions};
use smaclite_scenarios::ScenarioFiles;
use std::fmt;
use std::sync::Arc;
use xxhash_rust::xxh3::xxh3_64_with_seed;

/// The most steps of a round, times the units of its scenario.
const UNIT_STEPS: u64 = 4_000_000;

/// What a long run played.
#[derive(Debug, Default)]
pub struct Summary {
    /// Steps that pool and engine showed alike.
    pub steps: u64,
    /// Pools that were started and ended.
    pub pools: u64,
    /// Resources of the process after its first pools and after the last.
    pub resources: String,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Summary { steps, pools, resources } = self;
        writeln!(f, "steps compared: {steps}, in {pools} pools; none was wrong")?;
        write!(f, "resources of the process: {resources}")
    }
}

/// Plays at least `steps` steps of these scenarios in turn, and reports each tenth.
///
/// # Errors
/// The first environment that showed anything else than the engine alone; an unknown scenario; files that are
/// left; and resources that grew, if the process is `alone`: those of other tests would count.
pub fn run(
    steps: u64,
    seed: u64,
    scenarios: &[String],
    alone: bool,
    mut report: impl FnMut(&Summary),
) -> Result<Summary, String> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let (dir, mut summary, mut tenths) = (TestDir::new(), Summary::default(), 0);
    let mut resources = ResourceMonitor::new(std::process::id());
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let per_round = steps.div_ceil(20); // so that many settings are drawn, also in a short run
    let mut names = scenarios.iter().cycle();
    while summary.steps < steps {
        let rounds: Result<Vec<Round>, String> =
            names.by_ref().take(cores).map(|scenario| Round::draw(scenario, per_round, &mut rng)).collect();
        let played: Result<Vec<u64>, String> = std::thread::scope(|scope| {
            let dir = &dir;
            let play = |round: Round| scope.spawn(move || play(&round, dir));
            let threads: Vec<_> = rounds?.into_iter().map(play).collect();
            threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
        });
        let played = played?;
        summary.pools += played.len() as u64;
        if summary.steps == 0 {
            resources.measure(&dir);
        }
        summary.steps += played.iter().sum::<u64>();
        if summary.steps * 10 >= steps * (tenths + 1) {
            tenths = summary.steps * 10 / steps;
            report(&summary);
        }
    }
    dir.assert_empty();
    resources.measure(&dir);
    summary.resources = if alone { resources.check()? } else { "not compared".to_owned() };
    Ok(summary)
}

/// One pool, and the battles that it plays.
struct Round {
    scenario: String,
    setup: BattleSetup,
    threads: usize,
    settings: LaneSettings,
    arena: Arc<Arena>,
    steps: u64,
}

impl Round {
    fn draw(scenario: &str, most: u64, rng: &mut Pcg64Mcg) -> Result<Round, String> {
        let rules = *Rules::ALL.choose(rng).expect("some rules");
        let num_envs = *[1, 5, 64].choose(rng).expect("some numbers");
        let settings = LaneSettings {
            batch_size: if rng.random() { num_envs } else { rng.random_range(1..=num_envs) },
            seed: rng.random(),
            autoreset: *[Autoreset::NextStep, Autoreset::SameStep].choose(rng).expect("some modes"),
            ..LaneSettings::new(num_envs)
        };
        let (_, files) = ScenarioFiles::resolve(scenario).map_err(|error| error.to_string())?;
        let setup = BattleSetup { rules, ..BattleSetup::new(files) };
        let (_, arena) = setup.arena().map_err(|error| error.to_string())?;
        let Sizes { n_agents, n_enemies, .. } = arena.sizes();
        let steps = most.min(UNIT_STEPS / (n_agents + n_enemies) as u64);
        let (scenario, arena) = (scenario.to_owned(), Arc::new(arena));
        Ok(Round { scenario, setup, threads: rng.random_range(1..=3), settings, arena, steps })
    }

    fn name(&self) -> String {
        let LaneSettings { num_envs, batch_size, autoreset, seed, .. } = self.settings;
        format!(
            "{}, rules {}, {} threads, {num_envs} environments, batches of {batch_size}, \
             autoreset {autoreset:?}, seed {seed}",
            self.scenario, self.setup.rules, self.threads
        )
    }

    /// What environment `env` must show in so many steps after its reset.
    fn alone(&self, env: usize, steps: u64) -> u64 {
        let sizes = self.arena.sizes();
        let (mut battle, mut scratch) = (Battle::new(Arc::clone(&self.arena), 0), Scratch::new());
        let mut obs = vec![0.0; sizes.n_agents * sizes.obs_size];
        let mut state = vec![0.0; sizes.state_size];
        let mut mask = vec![0; sizes.n_agents * sizes.n_actions];
        let mut player = Player::new(self.settings.seed, env, sizes);
        battle.reseed(self.settings.seed.wrapping_add(env as u64));
        battle.reset();
        let (mut reward, mut flags, mut is_over) = (0.0f32, [0, 0, 1], false);
        for step in 0..=steps {
            if step > 0 && is_over && self.settings.autoreset == Autoreset::NextStep {
                battle.reset();
                (reward, flags, is_over) = (0.0, [0, 0, 1], false);
            } else if step > 0 {
                let made = battle.step(&player.actions, &mut scratch).expect("available actions");
                (reward, flags) =
                    (made.reward as f32, [u8::from(made.terminated), u8::from(made.truncated), 0]);
                is_over = made.terminated || made.truncated;
                if is_over && self.settings.autoreset == Autoreset::SameStep {
                    battle.reset();
                }
            }
            battle.write_obs(Faction::Ally, &mut obs, &mut scratch);
            battle.write_state(Faction::Ally, &mut state);
            battle.write_avail_actions(Faction::Ally, &mut mask);
            player.see(&obs, &state, &mask, reward, flags);
        }
        player.checksum
    }
}

/// Plays a round in a pool and alone, and returns its number of steps.
fn play(round: &Round, dir: &TestDir) -> Result<u64, String> {
    let failed = |error: &dyn fmt::Display| format!("{}: {error}", round.name());
    let LaneSettings { num_envs, batch_size, seed, .. } = round.settings;
    let lane = LaneConfig {
        name: "lane".to_owned(),
        setup: round.setup.clone(),
        team: None,
        settings: round.settings,
        max_held_batches: 2,
        spectators: 0,
    };
    let config = SupervisorConfig {
        name: format!("{seed:016x}"),
        lanes: vec![lane],
        options: PoolOptions { threads: round.threads, wait: WaitStrategy::default() },
        runtime_dir: dir.runtime_dir().clone(),
    };
    let pool = Supervisor::start(config).map_err(|error| failed(&error))?;
    let mut client = pool.connect(None, WaitStrategy::default()).map_err(|error| failed(&error))?;
    let sizes = round.arena.sizes();
    let mut players: Vec<Player> = (0..num_envs).map(|env| Player::new(seed, env, sizes)).collect();
    let (mut rows, mut actions) = (0, Vec::new());
    client.send(Order::reset(None), None, WaitOptions::forever()).map_err(|error| failed(&error))?;
    // The first row of each environment is of its reset.
    while rows < round.steps + num_envs as u64 {
        let wait = WaitOptions { timeout: Some(TIMEOUT), interrupted: &mut || false };
        let batch = client.recv(wait).map_err(|error| failed(&error))?;
        actions.clear();
        for (slot, env) in batch.env_id().iter().enumerate() {
            let player = &mut players[*env as usize];
            player.see_slot(&batch, slot);
            actions.extend_from_slice(&player.actions);
        }
        rows += batch.env_id().len() as u64;
        let envs = (batch_size < num_envs).then(|| batch.env_id());
        client.send(Order::Step(&actions), envs, WaitOptions::forever()).map_err(|error| failed(&error))?;
    }
    for (env, player) in players.iter().enumerate().filter(|(_, player)| player.rows > 0) {
        if round.alone(env, player.rows - 1) != player.checksum {
            let what =
                format!("environment {env} showed something else in {} steps than alone", player.rows - 1);
            return Err(failed(&what));
        }
    }
    Ok(players.iter().map(|player| player.rows.saturating_sub(1)).sum())
}

/// Who chooses the actions of one environment, and remembers what it showed.
struct Player {
    checksum: u64,
    /// How often it saw the environment: after its reset, and after each step.
    rows: u64,
    /// The next joint action.
    actions: Vec<i32>,
    rng: Pcg64Mcg,
    sizes: Sizes,
}

impl Player {
    fn new(seed: u64, env: usize, sizes: Sizes) -> Player {
        let rng = Pcg64Mcg::seed_from_u64(seed ^ env as u64);
        Player { checksum: 0, rows: 0, actions: vec![0; sizes.n_agents], rng, sizes }
    }

    fn see_slot(&mut self, batch: &Batch, slot: usize) {
        let Sizes { n_agents, obs_size, state_size, n_actions, .. } = self.sizes;
        let floats = |field, len: usize| &batch.field(field).expect("a default field")[slot * len..][..len];
        let mask = batch.field(Field::AvailActions).expect("a default field");
        let flags = [batch.terminated(), batch.truncated(), batch.was_reset()].map(|flags| flags[slot]);
        self.see(
            floats(Field::Obs, n_agents * obs_size),
            floats(Field::State, state_size),
            &mask[slot * n_agents * n_actions..][..n_agents * n_actions],
            batch.reward()[slot],
            flags,
        );
    }

    /// Sees what a step or a reset showed, and chooses random available actions.
    fn see(&mut self, obs: &[f32], state: &[f32], mask: &[u8], reward: f32, flags: [u8; 3]) {
        self.rows += 1;
        let shown =
            [bytemuck::cast_slice(obs), bytemuck::cast_slice(state), mask, &reward.to_ne_bytes(), &flags];
        self.checksum = shown.into_iter().fold(self.checksum, |sum, bytes| xxh3_64_with_seed(bytes, sum));
        for (action, mask) in self.actions.iter_mut().zip(mask.chunks_exact(self.sizes.n_actions)) {
            let available = mask.iter().filter(|bit| **bit == 1).count();
            let chosen = self.rng.random_range(0..available);
            let mut actions = (0i32..).zip(mask).filter(|(_, bit)| **bit == 1);
            *action = actions.nth(chosen).expect("one of those that were counted").0;
        }
    }
}
