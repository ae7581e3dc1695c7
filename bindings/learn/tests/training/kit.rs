//! Runs in a folder of their own, and how they are compared.

use smaclite_engine::{BattleSetup, Rules};
use smaclite_ipc::{ClientError, RuntimeDir};
use smaclite_learn::{
    Algorithm, Config, Enemies, EvaluatedEpisode, Evaluation, EvaluationEvent, EvaluationResult, Lanes,
    Record, Run, TrainError, evaluate, resolve_scenario,
};
use std::fs;
use std::path::PathBuf;

/// The copies in the folder of a run, by name, and the columns of its log that only self-play has.
pub type SelfPlayOutcome = (Vec<(String, Vec<u8>)>, Vec<Vec<String>>);

/// A folder for runs and the sockets of their pools.
pub struct Place {
    folder: tempfile::TempDir,
    pub runtime_dir: RuntimeDir,
}

impl Place {
    pub fn new() -> Place {
        let folder = tempfile::tempdir().unwrap();
        let runtime_dir = RuntimeDir::at(folder.path().join("pools")).unwrap();
        Place { folder, runtime_dir }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn lanes(&self, num_envs: usize, threads: usize) -> Lanes {
        self.lanes_with_history(num_envs, 0, threads)
    }

    pub fn lanes_with_history(&self, num_envs: usize, last_actions: usize, threads: usize) -> Lanes {
        self.lanes_of(&Config { num_envs, last_actions, ..Config::for_agents(3) }, threads)
    }

    /// The lanes of a run.
    pub fn lanes_of(&self, config: &Config, threads: usize) -> Lanes {
        let Config { num_envs, last_actions, enemies, .. } = config;
        Lanes::start(&enemies.setup(&scenario()), *num_envs, *last_actions, threads, &self.runtime_dir)
            .unwrap()
    }

    pub fn begin(&self, name: &str, config: &Config, threads: usize) -> Run {
        let lanes = self.lanes_of(config, threads);
        Run::begin(&self.path(name), config.clone(), &scenario(), lanes, threads).unwrap()
    }

    /// Begins and completes a run. Returns its last record.
    pub fn train(&self, name: &str, config: &Config, threads: usize) -> Record {
        complete(self.begin(name, config, threads))
    }

    pub fn evaluate(&self, name: &str, episodes: usize) -> (EvaluationResult, Vec<EvaluatedEpisode>) {
        let evaluation = evaluation(episodes);
        let mut counted = Vec::new();
        let mut count = |event: EvaluationEvent| match event {
            EvaluationEvent::Ended(episode) => counted.push(episode),
            EvaluationEvent::Step { .. } => {}
        };
        let result =
            evaluate(&self.path(name), evaluation, &self.runtime_dir, &mut || false, &mut count).unwrap();
        (result, counted)
    }

    /// The copies in the folder of a run, and the columns of its log that only self-play has.
    pub fn self_play(&self, name: &str) -> SelfPlayOutcome {
        let files = fs::read_dir(self.path(name).join("league")).unwrap().map(|entry| {
            let path = entry.unwrap().path();
            (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(path).unwrap())
        });
        let mut copies: Vec<_> = files.collect();
        copies.sort();
        let log = fs::read_to_string(self.path(name).join("log.csv")).unwrap();
        let columns = |line: &str| line.split(',').skip(22).map(str::to_owned).collect();
        (copies, log.lines().map(columns).collect())
    }

    /// The files of the evaluations, without the columns of time; empty if there are none.
    pub fn evaluations(&self, name: &str) -> Vec<(String, Vec<u8>)> {
        let folder = self.path(name);
        let Ok(rows) = fs::read_to_string(folder.join("evaluations.csv")) else { return Vec::new() };
        let until_seconds = |line: &str| line.split(',').take(9).collect::<Vec<_>>().join(",");
        let rows = rows.lines().map(until_seconds).collect::<Vec<_>>().join("\n").into_bytes();
        let mut files = vec![("evaluations.csv".to_owned(), rows)];
        for name in ["evaluation_episodes.csv", "best.safetensors"] {
            files.push((name.to_owned(), fs::read(folder.join(name)).unwrap()));
        }
        let mut weights: Vec<_> = fs::read_dir(folder.join("evaluations"))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(&path).unwrap()))
            .collect();
        weights.sort();
        files.extend(weights);
        let mut result: serde_json::Value =
            serde_json::from_slice(&fs::read(folder.join("final.json")).unwrap()).unwrap();
        (result["seconds"], result["cpu_seconds"]) = (0.into(), 0.into());
        files.push(("final.json".to_owned(), result.to_string().into_bytes()));
        files
    }

    /// The weights, and the columns of the log that do not depend on time.
    pub fn outcome(&self, name: &str) -> (Vec<u8>, Vec<String>) {
        let log = fs::read_to_string(self.path(name).join("log.csv")).unwrap();
        let until_seconds = |line: &str| line.split(',').take(17).collect::<Vec<_>>().join(",");
        let weights = fs::read(self.path(name).join("weights.safetensors")).unwrap();
        (weights, log.lines().map(until_seconds).collect())
    }
}

pub fn evaluation(episodes: usize) -> Evaluation {
    let (opponents, opponent_team, weights) = (None, None, None);
    Evaluation { episodes, seed: 5, weights, greedy: false, threads: 1, opponents, opponent_team, map: None }
}

pub fn scenario() -> BattleSetup {
    resolve_scenario("3m", Rules::default()).unwrap()
}

pub fn complete(mut run: Run) -> Record {
    let mut last = None;
    while let Some(record) = run.update(&mut || false).unwrap() {
        last = Some(record);
    }
    run.checkpoint().unwrap();
    last.expect("an update was made")
}

/// A run of six small updates.
pub fn small() -> Config {
    let hidden = vec![16, 16];
    Config {
        seed: 3,
        num_envs: 10,
        horizon: 16,
        steps: 930,
        hidden,
        last_actions: 0,
        ..Config::for_agents(3)
    }
}

/// The same, with evaluations at 0, 400, 800 and 930 steps.
pub fn evaluated() -> Config {
    Config { evaluate_every: Some(400), ..small() }
}

/// The number of threads changes no bit of a run, whatever its critic sees.
pub fn check_threads(config: &Config) {
    for algorithm in [Algorithm::Mappo, Algorithm::Ippo] {
        let (place, config) = (Place::new(), Config { algorithm, ..config.clone() });
        place.train("one", &config, 1);
        place.train("three", &config, 3);
        assert_eq!(place.outcome("one"), place.outcome("three"));
        assert_eq!(place.evaluate("one", 20), place.evaluate("three", 20));
        if config.enemies != Enemies::Scripts {
            assert_eq!(place.self_play("one"), place.self_play("three"));
        }
    }
}

/// Runs are interrupted near the first restart of the environments, which is after 32 updates, and elsewhere;
/// after an update that is in no checkpoint, and during one.
pub fn check_resumed(config: &Config, place: &Place) {
    place.train("whole", config, 1);
    for stop_at in [2, 31, 32, 33] {
        let name = format!("resumed-{stop_at}");
        let resume = || Run::resume(&place.path(&name), None, place.lanes_of(config, 1), 1).unwrap();
        let mut run = place.begin(&name, config, 1);
        for _ in 0..stop_at {
            run.update(&mut || false).unwrap();
        }
        run.checkpoint().unwrap();
        run.update(&mut || false).unwrap();
        drop(run);
        let (mut run, mut calls) = (resume(), 0);
        let interrupted = run.update(&mut || {
            calls += 1;
            calls > 5
        });
        assert!(matches!(interrupted, Err(TrainError::Client(ClientError::Interrupted))), "{interrupted:?}");
        run.checkpoint().unwrap();
        drop(run);
        complete(resume());
        assert_eq!(place.outcome(&name), place.outcome("whole"), "interrupted after {stop_at} updates");
        for (resumed, whole) in place.evaluations(&name).iter().zip(place.evaluations("whole")) {
            assert!(*resumed == whole, "{} and {} of {name}", resumed.0, whole.0);
        }
        assert_eq!(place.evaluations(&name).len(), place.evaluations("whole").len());
    }
}
