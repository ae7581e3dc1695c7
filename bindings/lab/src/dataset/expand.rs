//! Playing the episodes of a dataset again, on several threads, into arrays.
//!
//! Threads take some episodes at a time. Each episode begins with its own seed, and every row has its place
//! in the arrays before anything is played, so the number of threads changes no bit.

use super::arrays::{ARRAYS, ArrayName, N_ARRAYS, PerRow, Rows, Values};
use super::chunk::{Chunk, Wanted};
use super::counter::Counter;
use super::folder::Files;
use super::{Dataset, DatasetError, End};
use smaclite_engine::{Battle, Faction, Scratch, Step};
use smaclite_learn::parallel;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use xxhash_rust::xxh3::{Xxh3, xxh3_128};

/// Episodes that a thread takes at a time: enough to write a file in large pieces, and few enough that all
/// threads end at about the same time.
const CHUNK: usize = 16;

/// Returns `true` to end the work.
type Interrupted<'a> = &'a mut dyn FnMut() -> bool;

/// Episodes for one thread, and what came of them.
struct Job<'a> {
    episodes: Range<usize>,
    /// Where the arrays are to be; `None` if the thread's own memory will do.
    rows: Option<Rows<'a>>,
    played: Result<Vec<Digests>, DatasetError>,
}

/// The hashes of the rows of one episode, by array.
type Digests = [u128; N_ARRAYS];

/// What a thread uses again for each of its jobs.
struct Workspace {
    battle: Battle,
    scratch: Scratch,
    values: [Values; N_ARRAYS],
}

impl Dataset {
    /// Plays all episodes again, and returns these arrays, in memory, each once and in the order of
    /// [`ARRAYS`].
    ///
    /// # Errors
    /// If this version plays an episode otherwise than it was recorded, or the card has other returns or
    /// pairs than these arrays; `Interrupted` if `interrupted` returned true.
    pub fn expand(
        &self,
        arrays: &[ArrayName],
        threads: usize,
        interrupted: Interrupted<'_>,
    ) -> Result<Vec<(ArrayName, Values)>, DatasetError> {
        let wanted = wanted(arrays);
        self.check_memory(wanted)?;
        let mut values = self.zeros(wanted, self.n_steps(), self.episodes.len());
        let rows = Rows::new(&mut values, &self.sizes());
        let counter = Counter::new(self, wanted);
        let hashes = self.play(wanted, Some(rows), threads, interrupted, |chunk| {
            counter.add(&chunk);
            Ok(())
        })?;
        self.verify(wanted, &hashes)?;
        self.check_counted(&counter.finish())?;
        let values = ArrayName::ALL.into_iter().zip(values);
        Ok(values.filter(|(array, _)| wanted[*array as usize]).collect())
    }

    /// As [`expand`](Self::expand) into a new folder: a file `NAME.npy` per array, which NumPy can map into
    /// memory, and the card as `card.json`. The folder is written whole or not at all.
    ///
    /// # Errors
    /// As [`expand`](Self::expand), and if the folder exists or cannot be written.
    pub fn expand_to(
        &self,
        folder: &Path,
        arrays: &[ArrayName],
        threads: usize,
        interrupted: Interrupted<'_>,
    ) -> Result<(), DatasetError> {
        let wanted = wanted(arrays);
        let files = Files::create(self, folder, wanted)?;
        let counter = Counter::new(self, wanted);
        let hashes = self.play(wanted, None, threads, interrupted, |chunk| {
            counter.add(&chunk);
            files.write(self, &chunk)
        })?;
        self.verify(wanted, &hashes)?;
        self.check_counted(&counter.finish())?;
        files.finish()
    }

    /// Plays all episodes into `rows`, or else into memory of the threads; `take` gets what was played. The
    /// result are the hashes of the arrays.
    pub(super) fn play(
        &self,
        wanted: Wanted,
        rows: Option<Rows<'_>>,
        threads: usize,
        interrupted: Interrupted<'_>,
        take: impl Fn(Chunk<'_>) -> Result<(), DatasetError> + Sync,
    ) -> Result<[u128; N_ARRAYS], DatasetError> {
        let mut jobs = self.jobs(rows);
        let workspace = || Workspace {
            battle: Battle::new(Arc::clone(&self.arena), 0),
            scratch: Scratch::new(),
            values: self.zeros([false; N_ARRAYS], 0, 0),
        };
        let mut workspaces: Vec<Workspace> = (0..threads.max(1)).map(|_| workspace()).collect();
        parallel::run(jobs.iter_mut(), &mut workspaces, interrupted, |job, workspace| {
            job.played = self.play_job(job, wanted, workspace, &take);
        })
        .map_err(|parallel::Interrupted| DatasetError::Interrupted)?;
        let mut hashers: [Xxh3; N_ARRAYS] = std::array::from_fn(|_| Xxh3::new());
        for job in jobs {
            for digests in job.played? {
                for (hasher, digest) in hashers.iter_mut().zip(digests) {
                    hasher.update(&digest.to_le_bytes());
                }
            }
        }
        Ok(hashers.map(|hasher| hasher.digest128()))
    }

    fn jobs<'a>(&self, mut rows: Option<Rows<'a>>) -> Vec<Job<'a>> {
        let firsts = (0..self.episodes.len()).step_by(CHUNK);
        let job = |first: usize| {
            let episodes = first..(first + CHUNK).min(self.episodes.len());
            let steps = self.steps_of_all(&episodes).len();
            let rows = rows.as_mut().map(|rows| rows.take(steps, episodes.len()));
            Job { episodes, rows, played: Ok(Vec::new()) }
        };
        firsts.map(job).collect()
    }

    /// The rows of the steps of consecutive episodes.
    pub(super) fn steps_of_all(&self, episodes: &Range<usize>) -> Range<usize> {
        self.starts[episodes.start]..self.starts[episodes.end]
    }

    fn play_job(
        &self,
        job: &mut Job<'_>,
        wanted: Wanted,
        workspace: &mut Workspace,
        take: &impl Fn(Chunk<'_>) -> Result<(), DatasetError>,
    ) -> Result<Vec<Digests>, DatasetError> {
        let Workspace { battle, scratch, values } = workspace;
        let episodes = job.episodes.clone();
        if let Some(mut rows) = job.rows.take() {
            return self.play_chunk(episodes, &mut rows, battle, scratch, take);
        }
        let (n_steps, sizes) = (self.steps_of_all(&episodes).len(), self.sizes());
        for (array, values) in ArrayName::ALL.into_iter().zip(values.iter_mut()) {
            values.resize(n_rows(array, wanted, n_steps, episodes.len()) * array.row_bytes(&sizes));
        }
        self.play_chunk(episodes, &mut Rows::new(values, &sizes), battle, scratch, take)
    }

    fn play_chunk(
        &self,
        episodes: Range<usize>,
        rows: &mut Rows<'_>,
        battle: &mut Battle,
        scratch: &mut Scratch,
        take: &impl Fn(Chunk<'_>) -> Result<(), DatasetError>,
    ) -> Result<Vec<Digests>, DatasetError> {
        let play = |episode| self.play_episode(episode, &episodes, rows, battle, scratch);
        let digests = episodes.clone().map(play).collect::<Result<_, _>>()?;
        take(Chunk { episodes, rows })?;
        Ok(digests)
    }

    /// Plays an episode into the rows of its chunk.
    fn play_episode(
        &self,
        index: usize,
        chunk: &Range<usize>,
        rows: &mut Rows<'_>,
        battle: &mut Battle,
        scratch: &mut Scratch,
    ) -> Result<Digests, DatasetError> {
        let steps = self.steps_of(index);
        let (first, row) = (self.starts[chunk.start], index - chunk.start);
        battle.reseed(self.episodes[index].seed);
        battle.forget_episodes(); // which one this thread played before must not matter
        battle.reset();
        let mut actions = vec![0; self.sizes().n_agents];
        for step in steps.clone() {
            observe(battle, NOW, step - first, rows, scratch);
            for (action, recorded) in actions.iter_mut().zip(self.actions_of(step)) {
                *action = i32::from(*recorded);
            }
            let outcome = battle.step(&actions, scratch).map_err(|error| DatasetError::IllegalAction {
                file: self.source.clone(),
                episode: index,
                step: step - steps.start,
                error,
                program: self.program.clone(),
            })?;
            write_step(&actions, &outcome, step - first, rows);
            self.compare(index, step - steps.start, &outcome)?;
        }
        observe(battle, FINAL, row, rows, scratch);
        if let Some(start) = rows.row::<i32>(ArrayName::EpisodeStart, row) {
            start[0] = steps.start as i32; // at most `MAX_STEPS`
        }
        let steps = steps.start - first..steps.end - first;
        Ok(ArrayName::ALL.map(|array| match array.spec().per {
            PerRow::Step => xxh3_128(rows.bytes(array, steps.clone())),
            PerRow::Episode => xxh3_128(rows.bytes(array, row..row + 1)),
        }))
    }

    /// An episode must end as it was recorded, and not before.
    fn compare(&self, episode: usize, step: usize, outcome: &Step) -> Result<(), DatasetError> {
        let recorded = self.episodes[episode];
        let is_last = step + 1 == recorded.length as usize;
        let expected = if is_last { recorded.end } else { End::default() };
        let played = End::of(outcome);
        if played == expected {
            return Ok(());
        }
        Err(DatasetError::Diverged {
            file: self.source.clone(),
            episode,
            step,
            recorded: format!("is {} after step {}", recorded.end.text(), recorded.length - 1),
            played: played.text(),
            program: self.program.clone(),
        })
    }

    fn verify(&self, wanted: Wanted, hashes: &[u128; N_ARRAYS]) -> Result<(), DatasetError> {
        for (i, spec) in ARRAYS.iter().enumerate() {
            if wanted[i] && hashes[i] != self.hashes[i] {
                let [recorded, played] = [self.hashes[i], hashes[i]].map(|hash| format!("{hash:032x}"));
                let (file, program) = (self.source.clone(), self.program.clone());
                return Err(DatasetError::OtherBits { file, array: spec.name, recorded, played, program });
            }
        }
        Ok(())
    }

    /// Whether the system grants the memory of the arrays: without it, the process would end.
    fn check_memory(&self, wanted: Wanted) -> Result<(), DatasetError> {
        let bytes_of = |array: ArrayName| {
            let n_rows = n_rows(array, wanted, self.n_steps(), self.episodes.len());
            n_rows.saturating_mul(array.row_bytes(&self.sizes()))
        };
        let bytes = ArrayName::ALL.into_iter().map(bytes_of).fold(0, usize::saturating_add);
        let granted = Vec::<u8>::new().try_reserve_exact(bytes);
        granted.map_err(|_| DatasetError::Memory { bytes })
    }

    fn zeros(&self, wanted: Wanted, steps: usize, episodes: usize) -> [Values; N_ARRAYS] {
        ArrayName::ALL.map(|array| {
            Values::zeros(n_rows(array, wanted, steps, episodes) * array.row_bytes(&self.sizes()))
        })
    }
}

fn wanted(arrays: &[ArrayName]) -> Wanted {
    ArrayName::ALL.map(|array| arrays.contains(&array))
}

fn n_rows(array: ArrayName, wanted: Wanted, steps: usize, episodes: usize) -> usize {
    if wanted[array as usize] { array.n_rows(steps, episodes) } else { 0 }
}

impl End {
    pub(super) fn of(step: &Step) -> End {
        let Step { terminated, truncated, battle_won, .. } = *step;
        End { terminated, truncated, battle_won }
    }

    fn text(self) -> &'static str {
        match self {
            End { battle_won: true, .. } => "won",
            End { terminated: true, .. } => "lost",
            End { truncated: true, .. } => "truncated",
            _ => "not over",
        }
    }
}

/// What an observation is written to.
const NOW: [ArrayName; 3] = [ArrayName::Obs, ArrayName::State, ArrayName::AvailActions];
const FINAL: [ArrayName; 3] = [ArrayName::FinalObs, ArrayName::FinalState, ArrayName::FinalAvailActions];

fn observe(battle: &Battle, arrays: [ArrayName; 3], row: usize, rows: &mut Rows<'_>, scratch: &mut Scratch) {
    let [obs, state, avail_actions] = arrays;
    if let Some(out) = rows.row(obs, row) {
        battle.write_obs(Faction::Ally, out, scratch);
    }
    if let Some(out) = rows.row(state, row) {
        battle.write_state(Faction::Ally, out);
    }
    if let Some(out) = rows.row(avail_actions, row) {
        battle.write_avail_actions(Faction::Ally, out);
    }
}

fn write_step(actions: &[i32], outcome: &Step, row: usize, rows: &mut Rows<'_>) {
    if let Some(out) = rows.row(ArrayName::Actions, row) {
        out.copy_from_slice(actions);
    }
    if let Some(out) = rows.row::<f32>(ArrayName::Reward, row) {
        out[0] = outcome.reward as f32; // as lanes do
    }
    let ends = [
        (ArrayName::Terminated, outcome.terminated),
        (ArrayName::Truncated, outcome.truncated),
        (ArrayName::BattleWon, outcome.battle_won),
    ];
    for (array, value) in ends {
        if let Some(out) = rows.row::<u8>(array, row) {
            out[0] = u8::from(value);
        }
    }
}
