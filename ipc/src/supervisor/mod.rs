//! Starting and stopping a supervisor. Everything is checked and set aside first; then services and threads
//! begin.

mod config;
mod control_thread;
mod error;

use config::PreparedLane;
pub use config::{LaneConfig, PreparedPool, SupervisorConfig};
pub use error::{LaneConfigError, StartError};

use crate::client::{Client, ConnectError};
use crate::connection_failures::Failures;
use crate::connections::LanePorts;
use crate::control::client::process_of;
use crate::control::protocol::LaneDescription;
use crate::control::served_lane::ServedLane;
use crate::control::server::ControlServer;
use crate::os::NameLock;
use crate::os::memory::reserve_segments;
use crate::process_owned::ProcessOwned;
use crate::refusals::Refusals;
use crate::runtime_dir::RuntimeDir;
use crate::services::{Ipc, LaneServices, WorkEvent, open_node};
use crate::transport::{FrameOutlet, Iceoryx, RequestInlet, WorkBell};
use crate::wait_options::WaitOptions;
use control_thread::ControlThread;
use error::at;
use iceoryx2::prelude::Node;
use smaclite_pool::{Pool, PoolHandle, PoolOptions, WaitStrategy};
use std::fmt;
use std::sync::Arc;
use std::time::Instant;

/// A running supervisor. Dropping it stops it and removes all its files in `/dev/shm` and the runtime folder.
pub struct Supervisor {
    /// Stops first; the name is given up last.
    _control: ProcessOwned<ControlThread>,
    pool: ProcessOwned<PoolHandle<Iceoryx>>,
    name: String,
    lanes: Vec<LaneDescription>,
    shared_memory: usize,
    threads: usize,
    runtime_dir: RuntimeDir,
    _name_lock: NameLock,
}

impl fmt::Debug for Supervisor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Supervisor").field("name", &self.name).finish_non_exhaustive()
    }
}

impl Supervisor {
    /// Starts a pool.
    ///
    /// # Errors
    /// Whatever [`SupervisorConfig::prepare`] and [`start_prepared`](Supervisor::start_prepared) report.
    pub fn start(config: SupervisorConfig) -> Result<Supervisor, StartError> {
        Supervisor::start_prepared(config.prepare()?, &mut || false)
    }

    /// Starts a prepared pool. While its memory is set aside, which takes a second for some gigabytes,
    /// `interrupted` is called every few milliseconds; `true` ends the start.
    ///
    /// # Errors
    /// If the name is in use, memory is short, or iceoryx2 or the operating system refuses something.
    pub fn start_prepared(
        prepared: PreparedPool,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Supervisor, StartError> {
        if interrupted() {
            return Err(StartError::Interrupted);
        }
        let PreparedPool { name, runtime_dir, options, instance, lanes, shared_memory } = prepared;
        let threads = options.threads;
        let _name_lock = take_name(&runtime_dir, &name)?;
        let ipc_node = open_node(&runtime_dir, &name)?;
        let descriptions: Vec<_> = lanes.iter().map(|lane| lane.description.clone()).collect();
        let served = lanes.iter().map(|lane| ServedLane::new(lane.description.clone(), lane.files.clone()));
        let served = served.collect();
        let started = start_pool(&ipc_node.node, &instance, lanes, options);
        let (pool, ports, services) = started.map_err(|error| match error {
            StartError::Ipc(error) => StartError::Ipc(error.at(&runtime_dir)),
            other => other,
        })?;
        if !reserve_segments::<StartError>("frames of all lanes", interrupted)? {
            return Err(StartError::Interrupted);
        }
        let handle = ProcessOwned::new(pool.handle());
        let server = ControlServer {
            pool,
            ports,
            lanes: served,
            name: name.clone(),
            threads,
            shared_memory,
            started: Instant::now(),
            _services: services,
            ipc_node,
        };
        let _control = ProcessOwned::new(ControlThread::start(server, &runtime_dir, &name)?);
        tracing::info!(pool = name, shared_memory, threads, "serving");
        let lanes = descriptions;
        Ok(Supervisor {
            _control,
            pool: handle,
            name,
            lanes,
            shared_memory,
            threads,
            runtime_dir,
            _name_lock,
        })
    }

    /// Attaches to a lane of this pool: to its only lane, if none is named. While such a learner waits for a
    /// batch, its thread steps environments.
    ///
    /// # Errors
    /// As [`Client::connect`].
    pub fn connect(&self, lane: Option<&str>, strategy: WaitStrategy) -> Result<Client, ConnectError> {
        let mut client =
            Client::connect(&self.runtime_dir, &self.name, lane, strategy, WaitOptions::no_wait())?;
        let index = self.lanes.iter().position(|lane| lane.lane == client.description().lane);
        // In a forked child the pool is that of another process.
        if let Some(index) = index.filter(|_| self.pool.check().is_ok()) {
            client.take_part(|session| self.pool.local_learner(index, session));
        }
        Ok(client)
    }

    /// The pool's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Descriptions of its lanes.
    pub fn lanes(&self) -> &[LaneDescription] {
        &self.lanes
    }

    /// Bytes of shared memory set aside for frames.
    pub fn shared_memory(&self) -> usize {
        self.shared_memory
    }

    /// Worker threads.
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// The folder of its socket and locks.
    pub fn runtime_dir(&self) -> &RuntimeDir {
        &self.runtime_dir
    }
}

/// Takes a pool's name, which only one pool has at a time.
fn take_name(runtime_dir: &RuntimeDir, name: &str) -> Result<NameLock, StartError> {
    let lock = NameLock::try_take(runtime_dir, name).map_err(at(runtime_dir, "opening the pool's lock"))?;
    lock.ok_or_else(|| StartError::NameTaken { pool: name.to_owned(), pid: process_of(runtime_dir, name) })
}

type Services = (WorkEvent, Vec<LaneServices>);

/// Creates the services of all lanes and starts the workers.
fn start_pool(
    node: &Node<Ipc>,
    instance: &str,
    lanes: Vec<PreparedLane>,
    options: PoolOptions,
) -> Result<(Pool<Iceoryx>, Vec<LanePorts>, Services), StartError> {
    let work = WorkEvent::create(node, instance, lanes.len())?;
    let bell = WorkBell { listener: work.listener()?, notifier: work.notifier()? };
    let (mut services, mut ports, mut parts) = (Vec::new(), Vec::new(), Vec::new());
    for PreparedLane { spec, description, .. } in lanes {
        let capacity = description.capacity;
        let layout = Arc::new(spec.layout());
        let lane = LaneServices::create(node, instance, &spec.name, capacity)?;
        let (failures, refusals) = (Failures::default(), Refusals::new(spec.settings.num_envs));
        let subscriber = Arc::new(lane.request_subscriber(&failures)?);
        let publisher = Arc::new(lane.frame_publisher(&layout, capacity, &failures)?);
        let notifier = Arc::new(lane.frame_notifier()?);
        ports.push(LanePorts {
            requests: Arc::clone(&subscriber),
            frames: Arc::clone(&publisher),
            notifier: Arc::clone(&notifier),
            failures,
            refusals: refusals.clone(),
        });
        let inlet = RequestInlet { subscriber, layout: Arc::clone(&layout) };
        parts.push((spec, inlet, FrameOutlet { publisher, notifier, layout, refusals, sequence: 0 }));
        services.push(lane);
    }
    let pool = Pool::start(parts, bell, options)?;
    Ok((pool, ports, (work, services)))
}
