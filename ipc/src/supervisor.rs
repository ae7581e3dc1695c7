//! Starting and stopping a supervisor: everything is checked and set aside first, then threads and services
//! begin.

use crate::control::client::{of_process, process_of};
use crate::control::protocol::LaneDescription;
use crate::control::server::{ControlServer, ServedLane, serve};
use crate::memory::{PORTS, TooLittleMemory, check_room, reserve_segments};
use crate::runtime_dir::{PRIVATE, RuntimeDir, RuntimeDirError, check_name, is_file_at, lock_file};
use crate::services::{Capacity, Ipc, IpcError, LaneServices, WorkEvent, open_node};
use crate::transport::{FrameOutlet, Iceoryx, RequestInlet, WorkBell};
use iceoryx2::prelude::Node;
use rustix::fs::{FlockOperation, Mode, fchmod, flock};
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType, bind, listen, socket_with};
use smaclite_engine::{Arena, Battle, Rules, Sizes};
use smaclite_pool::environment::{Environment, MakeEnvironment};
use smaclite_pool::fields::FieldSet;
use smaclite_pool::{Autoreset, LaneSpec, Pool, PoolOptions, PoolStartError};
use smaclite_scenarios::Scenario;
use std::fs::File;
use std::net::Shutdown;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// The maximum number of environments of a lane: their ids are i32, and a frame must fit into memory.
pub const MAX_ENVS: usize = 1_000_000;

/// Connections to the control socket that may wait to be accepted, as the standard library has it.
const LISTEN_BACKLOG: i32 = 128;

/// What the environments of a lane are.
pub enum LaneEnvs {
    /// Battles of a scenario.
    Battle {
        /// The scenario.
        scenario: Box<Scenario>,
        /// The rules they are played by.
        rules: Rules,
        /// `Some` replaces the scenario's own limit; `Some(None)` is no limit.
        episode_limit: Option<Option<u32>>,
    },
    /// Any other environment, for tests and benches.
    Other {
        /// Shown as the scenario's name.
        name: String,
        /// Sizes of every environment.
        sizes: Sizes,
        /// Makes environment `i`.
        make: MakeEnvironment,
    },
}

/// One lane of a pool.
pub struct LaneConfig {
    /// The name learners attach by.
    pub name: String,
    /// What is played.
    pub game: LaneEnvs,
    /// Environments (N), at least 1.
    pub num_envs: usize,
    /// Environments in a frame (M), 1 to N; N for synchronous stepping.
    pub batch_size: usize,
    /// Environment `i` is seeded with `seed + i`.
    pub seed: u64,
    /// What happens at an episode's end.
    pub autoreset: Autoreset,
    /// The fields of a frame.
    pub fields: FieldSet,
    /// Frames a learner may hold at once, at least 2.
    pub max_held_batches: usize,
    /// Spectators at once.
    pub spectators: usize,
}

impl LaneConfig {
    /// A synchronous lane of a scenario with every other setting at its default.
    pub fn new(name: impl Into<String>, scenario: Scenario, num_envs: usize) -> LaneConfig {
        let game =
            LaneEnvs::Battle { scenario: Box::new(scenario), rules: Rules::default(), episode_limit: None };
        LaneConfig {
            name: name.into(),
            game,
            num_envs,
            batch_size: num_envs,
            seed: 0,
            autoreset: Autoreset::default(),
            fields: FieldSet::ALL,
            max_held_batches: 4,
            spectators: 1,
        }
    }

    fn check(&self) -> Result<(), StartError> {
        let bad = |what: String| Err(StartError::Lane { lane: self.name.clone(), what });
        check_name(&self.name).or_else(bad)?;
        if self.num_envs == 0 || self.num_envs > MAX_ENVS {
            return bad(format!(
                "the number of environments must be between 1 and {MAX_ENVS}, got {}",
                self.num_envs
            ));
        }
        if self.batch_size == 0 || self.batch_size > self.num_envs {
            return bad(format!(
                "the batch size must be between 1 and {} (the number of environments), got {}",
                self.num_envs, self.batch_size
            ));
        }
        if !(2..=1024).contains(&self.max_held_batches) {
            return bad(format!(
                "max_held_batches must be between 2 and 1024, got {}",
                self.max_held_batches
            ));
        }
        if self.spectators > 64 {
            return bad(format!("spectators must be between 0 and 64, got {}", self.spectators));
        }
        Ok(())
    }

    /// Splits the settings into what the pool builds and what learners are told.
    fn prepare(self, shared: &Shared<'_>) -> (LaneSpec, LaneDescription) {
        let capacity = Capacity::new(
            self.num_envs,
            self.batch_size,
            shared.threads,
            self.max_held_batches,
            self.spectators,
        );
        let (scenario, rules, episode_limit, sizes, make) = match self.game {
            LaneEnvs::Battle { scenario, rules, episode_limit } => {
                let mut arena = Arena::new(&scenario, rules);
                if let Some(limit) = episode_limit {
                    arena = arena.with_episode_limit(limit);
                }
                let (sizes, limit, seed) = (arena.sizes(), arena.episode_limit(), self.seed);
                let arena = Arc::new(arena);
                let make = move |i: usize| -> Box<dyn Environment> {
                    Box::new(Battle::new(Arc::clone(&arena), seed.wrapping_add(i as u64)))
                };
                (scenario.name.clone(), rules.to_string(), limit, sizes, Box::new(make) as MakeEnvironment)
            }
            LaneEnvs::Other { name, sizes, make } => (name, String::new(), None, sizes, make),
        };
        let spec = LaneSpec {
            name: self.name,
            sizes,
            num_envs: self.num_envs,
            batch_size: self.batch_size,
            seed: self.seed,
            autoreset: self.autoreset,
            fields: self.fields,
            make,
        };
        let layout = spec.layout();
        let description = LaneDescription {
            pool: shared.pool.to_owned(),
            pid: std::process::id(),
            instance: shared.instance.to_owned(),
            lane: spec.name.clone(),
            scenario,
            n_agents: sizes.n_agents,
            n_enemies: sizes.n_enemies,
            n_actions: sizes.n_actions,
            obs_size: sizes.obs_size,
            state_size: sizes.state_size,
            num_envs: spec.num_envs,
            batch_size: spec.batch_size,
            seed: spec.seed,
            autoreset: spec.autoreset,
            episode_limit,
            rules,
            fields: layout.fields().iter().map(|f| f.spec().name.to_owned()).collect(),
            layout_hash: layout.hash(),
            capacity,
            threads: shared.threads,
        };
        (spec, description)
    }
}

struct Shared<'a> {
    pool: &'a str,
    instance: &'a str,
    threads: usize,
}

/// A whole pool.
pub struct SupervisorConfig {
    /// The name learners connect by.
    pub name: String,
    /// Its lanes, with different names.
    pub lanes: Vec<LaneConfig>,
    /// Threads and waiting.
    pub options: PoolOptions,
    /// Where it lives.
    pub runtime_dir: RuntimeDir,
}

/// Why a supervisor did not start. Nothing of it is left.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum StartError {
    #[error("pool name: {0}")]
    Name(String),
    #[error("a pool named `{pool}` runs already{}; choose another name or stop it", of_process(*pid))]
    NameTaken { pool: String, pid: Option<u32> },
    #[error("a pool needs at least one lane")]
    NoLanes,
    #[error("lane `{lane}`: {what}")]
    Lane { lane: String, what: String },
    #[error(transparent)]
    RuntimeDir(#[from] RuntimeDirError),
    #[error(transparent)]
    Memory(#[from] TooLittleMemory),
    #[error(transparent)]
    Ipc(#[from] IpcError),
    #[error(transparent)]
    Pool(#[from] PoolStartError),
    #[error("the start was interrupted")]
    Interrupted,
    #[error("{doing}: {source}")]
    System { doing: String, source: std::io::Error },
}

/// A running supervisor. Dropping it stops it and takes everything of it out of `/dev/shm` and the root
/// folder.
pub struct Supervisor {
    name: String,
    lanes: Vec<LaneDescription>,
    shared_memory: usize,
    threads: usize,
    /// Shut down to stop the control thread.
    stop: UnixStream,
    control: Option<JoinHandle<()>>,
    runtime_dir: RuntimeDir,
    owner: u32,
    _name: NameLock,
}

/// A pool whose settings are checked and whose maps are computed, which may take a second. Nothing of it
/// exists yet.
pub struct PreparedPool {
    /// Without its lanes.
    config: SupervisorConfig,
    options: PoolOptions,
    instance: String,
    lanes: Vec<(LaneSpec, LaneDescription)>,
    shared_memory: usize,
}

impl SupervisorConfig {
    /// Does everything that needs no file, process or shared memory.
    pub fn prepare(mut self) -> Result<PreparedPool, StartError> {
        let config = &mut self;
        check_name(&config.name).map_err(StartError::Name)?;
        check_lanes(&config.lanes)?;
        let options = PoolOptions { threads: config.options.threads.max(1), ..config.options };
        let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos());
        let instance = format!("{}.{}.{since_epoch:x}", config.name, std::process::id());
        let shared = Shared { pool: &config.name, instance: &instance, threads: options.threads };
        let lanes = std::mem::take(&mut config.lanes);
        let lanes: Vec<_> = lanes.into_iter().map(|lane| lane.prepare(&shared)).collect();
        let needs = lanes.iter().map(|(spec, d)| d.capacity.frame_memory(&spec.layout()));
        let shared_memory = needs.sum();
        let guests = lanes.iter().map(|(spec, d)| {
            d.capacity.request_memory(&spec.layout(), d.num_envs) + (2 + d.capacity.spectators) * PORTS
        });
        check_room(
            shared_memory + guests.sum::<usize>(),
            "frames of all lanes and their learners' requests",
        )?;
        Ok(PreparedPool { options, instance, lanes, shared_memory, config: self })
    }
}

impl Supervisor {
    /// Starts a pool.
    pub fn start(config: SupervisorConfig) -> Result<Supervisor, StartError> {
        Supervisor::start_prepared(config.prepare()?, &mut || false)
    }

    /// Starts a prepared pool. While its memory is set aside, which takes a second for some gigabytes,
    /// `interrupted` is asked every few milliseconds; `true` ends the start.
    pub fn start_prepared(
        prepared: PreparedPool,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Supervisor, StartError> {
        if interrupted() {
            return Err(StartError::Interrupted);
        }
        let PreparedPool { config, options, instance, lanes, shared_memory } = prepared;
        let name_lock = NameLock::take(&config.runtime_dir, &config.name)?;
        let ipc_node = open_node(&config.runtime_dir, &config.name)?;
        let descriptions: Vec<_> = lanes.iter().map(|(_, description)| description.clone()).collect();
        let (pool, services) =
            start_pool(&ipc_node.node, &instance, lanes, options).map_err(|error| match error {
                StartError::Ipc(error) => StartError::Ipc(error.at(&config.runtime_dir)),
                other => other,
            })?;
        if !reserve_segments(&config.runtime_dir, "frames of all lanes", interrupted)? {
            return Err(StartError::Interrupted);
        }

        let (stop, stopped) = UnixStream::pair().map_err(system("making a socket pair"))?;
        let socket = config.runtime_dir.socket(&config.name);
        let _ = std::fs::remove_file(&socket); // of a dead pool: the lock is ours
        let listener = private_listener(&socket)
            .map_err(system(&format!("opening the control socket {}", socket.display())))?;
        let server = ControlServer {
            pool,
            lanes: descriptions.iter().cloned().map(ServedLane::new).collect(),
            name: config.name.clone(),
            threads: options.threads,
            shared_memory,
            started: Instant::now(),
            _services: services,
            ipc_node,
        };
        let control = std::thread::Builder::new().name("smaclite-control".to_owned());
        let control =
            control.spawn(move || serve(server, listener, stopped)).map_err(system("starting a thread"))?;
        tracing::info!(pool = config.name, shared_memory, threads = options.threads, "serving");
        Ok(Supervisor {
            name: config.name,
            lanes: descriptions,
            shared_memory,
            threads: options.threads,
            stop,
            control: Some(control),
            runtime_dir: config.runtime_dir,
            owner: std::process::id(),
            _name: name_lock,
        })
    }

    /// The pool's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What its lanes are.
    pub fn lanes(&self) -> &[LaneDescription] {
        &self.lanes
    }

    /// Bytes of shared memory set aside.
    pub fn shared_memory(&self) -> usize {
        self.shared_memory
    }

    /// Worker threads.
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// Where it lives.
    pub fn runtime_dir(&self) -> &RuntimeDir {
        &self.runtime_dir
    }
}

impl Drop for Supervisor {
    fn drop(&mut self) {
        if self.owner != std::process::id() {
            return; // a forked child has no threads to stop and must not remove its parent's files
        }
        // Closing it would not do: a forked child has a copy that keeps the socket open.
        let _ = self.stop.shutdown(Shutdown::Both);
        if let Some(control) = self.control.take() {
            let _ = control.join();
        }
    }
}

fn check_lanes(lanes: &[LaneConfig]) -> Result<(), StartError> {
    if lanes.is_empty() {
        return Err(StartError::NoLanes);
    }
    for (index, lane) in lanes.iter().enumerate() {
        lane.check()?;
        if lanes[..index].iter().any(|other| other.name == lane.name) {
            let what = "two lanes have this name; name one differently (NAME=SCENARIO:N)".to_owned();
            return Err(StartError::Lane { lane: lane.name.clone(), what });
        }
    }
    Ok(())
}

/// The right to a pool's name, for as long as this process lives. Takes the pool's files along when it goes.
pub(crate) struct NameLock {
    _file: File,
    files: [PathBuf; 2],
    owner: u32,
}

impl NameLock {
    fn take(runtime_dir: &RuntimeDir, name: &str) -> Result<NameLock, StartError> {
        let lock = NameLock::try_take(runtime_dir, name).map_err(system("opening the pool's lock"))?;
        lock.ok_or_else(|| StartError::NameTaken {
            pool: name.to_owned(),
            pid: process_of(runtime_dir, name),
        })
    }

    /// `None` if another process has it.
    pub(crate) fn try_take(runtime_dir: &RuntimeDir, name: &str) -> std::io::Result<Option<NameLock>> {
        let path = runtime_dir.lock(name);
        loop {
            let file = lock_file(&path)?;
            if flock(&file, FlockOperation::NonBlockingLockExclusive).is_err() {
                return Ok(None);
            }
            if is_file_at(&file, &path) {
                let files = [runtime_dir.socket(name), path];
                return Ok(Some(NameLock { _file: file, files, owner: std::process::id() }));
            }
        }
    }
}

impl Drop for NameLock {
    fn drop(&mut self) {
        if self.owner == std::process::id() {
            self.files.iter().for_each(|file| drop(std::fs::remove_file(file)));
        }
    }
}

/// Listens at a path that no other user can ever connect to: Linux gives a socket's file the mode that its
/// descriptor had before it was bound (`unix_bind_bsd` in net/unix/af_unix.c).
fn private_listener(path: &Path) -> std::io::Result<UnixListener> {
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    let socket = socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None)?;
    fchmod(&socket, Mode::from_raw_mode(PRIVATE))?;
    bind(&socket, &SocketAddrUnix::new(path)?)?;
    listen(&socket, LISTEN_BACKLOG)?;
    Ok(UnixListener::from(socket))
}

type Services = (WorkEvent, Vec<LaneServices>);

fn start_pool(
    node: &Node<Ipc>,
    instance: &str,
    lanes: Vec<(LaneSpec, LaneDescription)>,
    options: PoolOptions,
) -> Result<(Pool<Iceoryx>, Services), StartError> {
    let work = WorkEvent::create(node, instance, lanes.len())?;
    let bell = WorkBell { listener: work.listener()?, notifier: work.notifier()? };
    let mut services = Vec::new();
    let mut parts = Vec::new();
    for (spec, description) in lanes {
        let capacity = description.capacity;
        let layout = Arc::new(spec.layout());
        let lane = LaneServices::create(node, instance, &spec.name, capacity)?;
        let inlet = RequestInlet { subscriber: lane.request_subscriber()?, layout: Arc::clone(&layout) };
        let publisher = lane.frame_publisher(&layout, capacity)?;
        let outlet = FrameOutlet { publisher, notifier: lane.frame_notifier()?, layout, sequence: 0 };
        parts.push((spec, inlet, outlet));
        services.push(lane);
    }
    let pool = Pool::start(parts, bell, options)?;
    Ok((pool, (work, services)))
}

fn system(doing: &str) -> impl FnOnce(std::io::Error) -> StartError {
    let doing = doing.to_owned();
    move |source| StartError::System { doing, source }
}
