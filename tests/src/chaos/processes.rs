//! The processes of a chaos run: which there are, what is done to them, and whether they are silent for too
//! long.

use super::Summary;
use super::roles::PROGRESS;
use crate::process::{NEW_PROCESS_NAMESPACE, TIMEOUT, can_launch};
use crate::{Child, PoolPlan, TestDir};
use rand::RngExt;
use rand_pcg::Pcg64;
use rustix::process::Signal;
use std::fmt;
use std::time::{Duration, Instant};

/// A child that is started again whenever it was killed.
struct ClientProcess {
    /// One of [`roles`](super::roles).
    role: &'static str,
    plan: PoolPlan,
    child: Child,
    last_message: String,
    last_message_at: Instant,
    /// When a stopped process is to be continued.
    stopped_until: Option<Instant>,
    /// Whether it has made progress since this was last cleared.
    made_progress: bool,
}

/// The supervisor of a pool.
struct SupervisorProcess {
    plan: PoolPlan,
    child: Child,
    stopped_until: Option<Instant>,
}

pub(super) struct Processes<'a> {
    dir: &'a TestDir,
    /// Of pools `permanent` and `restarted`.
    supervisors: [SupervisorProcess; 2],
    clients: Vec<ClientProcess>,
    /// How many clients were started; the seed of the next one.
    started: u64,
    max_silence: Duration,
}

/// Index of the supervisor that is never killed.
const PERMANENT: usize = 0;
/// Index of the other one.
const RESTARTED: usize = 1;

/// How long all processes run undisturbed before a measurement, at least.
const RECOVERY: Duration = Duration::from_secs(1);

impl<'a> Processes<'a> {
    pub(super) fn start(
        dir: &'a TestDir,
        pools: [PoolPlan; 2],
        max_silence: Duration,
    ) -> Result<Self, String> {
        let supervisors = pools.map(|plan| SupervisorProcess {
            child: Child::supervisor(dir, &plan),
            plan,
            stopped_until: None,
        });
        let mut processes = Processes { dir, supervisors, clients: Vec::new(), started: 0, max_silence };
        for (index, third) in [(PERMANENT, "forking_learner"), (RESTARTED, "namespace_learner")] {
            let pool = processes.supervisors[index].plan.clone();
            let lane = |i: usize| PoolPlan { lanes: vec![pool.lanes[i].clone()], ..pool.clone() };
            for i in 0..2 {
                processes.add("learner", lane(i));
                processes.add("spectator", lane(i));
            }
            processes.add(third, lane(2));
            processes.add("invalid_sender", pool);
        }
        Ok(processes)
    }

    pub(super) fn permanent_supervisor(&self) -> u32 {
        self.supervisors[PERMANENT].child.pid()
    }

    fn add(&mut self, role: &'static str, plan: PoolPlan) {
        let client = self.start_client(role, plan);
        self.clients.push(client);
    }

    fn start_client(&mut self, role: &'static str, plan: PoolPlan) -> ClientProcess {
        self.started += 1;
        let json = serde_json::to_string(&plan).expect("plain data");
        let argument = format!("chaos {role} {} {json}", self.started);
        let launcher = match role {
            "namespace_learner" if can_launch(NEW_PROCESS_NAMESPACE) => NEW_PROCESS_NAMESPACE,
            _ => &[], // also where no process namespace is permitted
        };
        ClientProcess {
            role,
            plan,
            child: Child::launch(self.dir, launcher, &argument),
            last_message: String::new(),
            last_message_at: Instant::now(),
            stopped_until: None,
            made_progress: false,
        }
    }

    /// Does one random thing to one random process.
    pub(super) fn disturb(&mut self, rng: &mut Pcg64, summary: &mut Summary) -> Result<(), String> {
        match rng.random_range(0..20) {
            0 => self.kill_supervisor(rng, summary)?,
            1 if rng.random_ratio(1, 3) => self.end_supervisor(summary)?,
            1 | 2 => self.stop_supervisor(rng, summary),
            3..=6 => self.stop_client(rng, summary),
            _ => self.kill_client(rng, summary)?,
        }
        Ok(())
    }

    fn kill_client(&mut self, rng: &mut Pcg64, summary: &mut Summary) -> Result<(), String> {
        let index = rng.random_range(0..self.clients.len());
        self.read_messages(summary)?;
        self.clients[index].child.kill();
        let (role, plan) = (self.clients[index].role, self.clients[index].plan.clone());
        self.clients[index] = self.start_client(role, plan);
        summary.killed_clients += 1;
        Ok(())
    }

    fn stop_client(&mut self, rng: &mut Pcg64, summary: &mut Summary) {
        let index = rng.random_range(0..self.clients.len());
        let client = &mut self.clients[index];
        client.child.signal(Signal::STOP);
        client.stopped_until = Some(Instant::now() + Duration::from_millis(rng.random_range(0..400)));
        summary.stopped += 1;
    }

    fn stop_supervisor(&mut self, rng: &mut Pcg64, summary: &mut Summary) {
        let supervisor = &mut self.supervisors[rng.random_range(0..2)];
        supervisor.child.signal(Signal::STOP);
        supervisor.stopped_until = Some(Instant::now() + Duration::from_millis(rng.random_range(0..300)));
        summary.stopped += 1;
    }

    fn kill_supervisor(&mut self, rng: &mut Pcg64, summary: &mut Summary) -> Result<(), String> {
        self.supervisors[RESTARTED].child.kill();
        summary.killed_supervisors += 1;
        if rng.random_ratio(1, 2) {
            std::thread::sleep(Duration::from_millis(rng.random_range(0..200)));
        }
        self.restart_supervisor()
    }

    fn end_supervisor(&mut self, summary: &mut Summary) -> Result<(), String> {
        self.supervisors[RESTARTED].child.signal(Signal::CONT);
        let status = self.supervisors[RESTARTED].child.end();
        if status.is_none_or(|status| !status.success()) {
            return Err(format!("a supervisor did not end normally: {status:?}"));
        }
        summary.restarted_supervisors += 1;
        self.restart_supervisor()
    }

    fn restart_supervisor(&mut self) -> Result<(), String> {
        let supervisor = &mut self.supervisors[RESTARTED];
        supervisor.stopped_until = None;
        supervisor.child = Child::try_supervisor(self.dir, &supervisor.plan);
        let started = supervisor.child.answer(TIMEOUT);
        started.map(drop).map_err(|error| format!("restart under the same name: {error}"))
    }

    /// Reads what the clients sent, continues processes that were stopped for long enough, and fails if one
    /// is silent for too long.
    pub(super) fn read_messages(&mut self, summary: &mut Summary) -> Result<(), String> {
        let now = Instant::now();
        let is_over = |until: &mut Option<Instant>| until.take_if(|end| now >= *end).is_some();
        for supervisor in &mut self.supervisors {
            if is_over(&mut supervisor.stopped_until) {
                supervisor.child.signal(Signal::CONT);
            }
        }
        for client in &mut self.clients {
            if is_over(&mut client.stopped_until) {
                client.child.signal(Signal::CONT);
            }
            client.read_messages(now, self.max_silence, summary)?;
        }
        Ok(())
    }

    /// Continues all stopped processes and waits until every client has made progress.
    pub(super) fn recover(&mut self, summary: &mut Summary) -> Result<(), String> {
        let begin = Instant::now();
        for supervisor in &mut self.supervisors {
            supervisor.stopped_until = supervisor.stopped_until.and(Some(begin));
        }
        for client in &mut self.clients {
            client.stopped_until = client.stopped_until.and(Some(begin));
            client.made_progress = false;
        }
        loop {
            self.read_messages(summary)?;
            let idle = self.clients.iter().find(|client| !client.made_progress);
            match idle {
                None if begin.elapsed() > RECOVERY => return Ok(()),
                Some(idle) if begin.elapsed() > TIMEOUT => {
                    return Err(format!("{idle} makes no progress after the disturbances"));
                }
                _ => std::thread::sleep(Duration::from_millis(5)),
            }
        }
    }

    /// Ends all processes normally.
    pub(super) fn end(mut self) -> Result<(), String> {
        let clients = self.clients.iter_mut().map(|client| (client.role, &client.plan, &mut client.child));
        let supervisors = self.supervisors.iter_mut().map(|s| ("supervisor", &s.plan, &mut s.child));
        for (role, plan, child) in clients.chain(supervisors) {
            let status = child.end();
            if status.is_none_or(|status| !status.success()) {
                return Err(format!("the {role} of `{}` did not end normally: {status:?}", plan.name));
            }
        }
        Ok(())
    }
}

impl ClientProcess {
    fn read_messages(
        &mut self,
        now: Instant,
        max_silence: Duration,
        summary: &mut Summary,
    ) -> Result<(), String> {
        loop {
            match self.child.answer(Duration::ZERO) {
                Ok(message) => {
                    self.last_message_at = now;
                    count(&message, summary);
                    self.made_progress |= PROGRESS.iter().any(|word| message.starts_with(word));
                    self.last_message = message;
                }
                Err(error) if error.starts_with("no answer") => break,
                Err(error) => return Err(format!("{self}: {error}")),
            }
        }
        let silence = now - self.last_message_at;
        if silence > summary.longest_silence.0 {
            summary.longest_silence = (silence, self.to_string());
        }
        if silence > max_silence {
            return Err(format!("{self} hangs: silent for {silence:?}"));
        }
        Ok(())
    }
}

impl fmt::Display for ClientProcess {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the {} of `{}`, last message `{}`", self.role, self.plan.name, self.last_message)
    }
}

/// Adds a client's message to the summary.
fn count(message: &str, summary: &mut Summary) {
    let (word, number) = message.split_once(' ').unwrap_or((message, ""));
    let frames = number.parse::<u64>().unwrap_or(0);
    match word {
        "session" => summary.sessions += 1,
        "forked" => summary.forks += 1,
        "attempt" => summary.namespace_attempts += 1,
        "frames" => summary.frames += frames,
        "gone" => {
            summary.frames += frames;
            summary.pools_gone += 1;
        }
        _ => {}
    }
}
