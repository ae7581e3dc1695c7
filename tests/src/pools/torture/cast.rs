//! The processes of a torture run: who plays what, who is disturbed how, and who has been silent for too
//! long.

use super::Summary;
use crate::pools::dice::Dice;
use crate::pools::process::SOON;
use crate::pools::{Child, PoolPlan, Room};
use rustix::process::Signal;
use std::fmt;
use std::time::{Duration, Instant};

/// A process that is started again whenever it was killed.
struct Actor {
    role: &'static str,
    plan: PoolPlan,
    child: Child,
    /// When it last said something, or could not have, and what.
    heard: Instant,
    said: String,
    /// Until when it is stopped.
    stopped: Option<Instant>,
    /// Has it done what it is there for since it was last left in peace?
    went_on: bool,
}

/// A pool's supervisor.
struct ControlServer {
    plan: PoolPlan,
    child: Child,
    stopped: Option<Instant>,
}

pub(super) struct Cast<'a> {
    room: &'a Room,
    hosts: [ControlServer; 2],
    actors: Vec<Actor>,
    started: u64,
    /// Longer silence than this is a hang.
    hang: Duration,
}

/// How long everybody is left in peace at least.
const PEACE: Duration = Duration::from_secs(1);

/// The pool whose supervisor is never killed.
const STEADY: usize = 0;
const SHAKY: usize = 1;

impl<'a> Cast<'a> {
    pub(super) fn enter(room: &'a Room, pools: [PoolPlan; 2], hang: Duration) -> Result<Self, String> {
        let hosts =
            pools.map(|plan| ControlServer { child: Child::supervisor(room, &plan), plan, stopped: None });
        let mut cast = Cast { room, hosts, actors: Vec::new(), started: 0, hang };
        for host in [STEADY, SHAKY] {
            let last = cast.hosts[host].plan.lanes.len() - 1;
            for lane in 0..last {
                let mut plan = cast.hosts[host].plan.clone();
                plan.lanes = vec![plan.lanes[lane].clone()];
                cast.add("tortured learner", plan.clone());
                cast.add("tortured spectator", plan);
            }
            let plan = cast.hosts[host].plan.clone();
            cast.add("tortured liar", plan.clone());
            // The last lane is for what other processes do to it and to themselves.
            let lanes = vec![plan.lanes[last].clone()];
            let role = if host == STEADY { "tortured forker" } else { "tortured visitor" };
            cast.add(role, PoolPlan { lanes, ..plan });
        }
        Ok(cast)
    }

    pub(super) fn steady_supervisor(&self) -> u32 {
        self.hosts[STEADY].child.pid()
    }

    fn add(&mut self, role: &'static str, plan: PoolPlan) {
        let child = self.start(role, &plan);
        self.actors.push(Actor {
            role,
            plan,
            child,
            heard: Instant::now(),
            said: String::new(),
            stopped: None,
            went_on: false,
        });
    }

    fn start(&mut self, role: &str, plan: &PoolPlan) -> Child {
        self.started += 1;
        let plan = serde_json::to_string(plan).expect("plain data");
        let (kind, which) = role.split_once(' ').expect("two words");
        let start = if which == "visitor" { Child::start_in_namespace } else { Child::start };
        start(self.room, kind, &format!("{which} {} {plan}", self.started))
    }

    /// Does something to somebody.
    pub(super) fn disturb(&mut self, dice: &mut Dice, summary: &mut Summary) -> Result<(), String> {
        match dice.below(20) {
            0 => self.kill_supervisor(dice, summary)?,
            1 if dice.below(3) == 0 => self.terminate_supervisor(summary)?,
            1 | 2 => self.stop_supervisor(dice, summary),
            3..=6 => self.stop_actor(dice, summary),
            _ => self.kill_actor(dice, summary)?,
        }
        Ok(())
    }

    fn kill_actor(&mut self, dice: &mut Dice, summary: &mut Summary) -> Result<(), String> {
        let index = dice.below(self.actors.len() as u64) as usize;
        self.listen(summary)?;
        self.actors[index].child.kill();
        let (role, plan) = (self.actors[index].role, self.actors[index].plan.clone());
        let child = self.start(role, &plan);
        let (heard, said) = (Instant::now(), String::new());
        self.actors[index] = Actor { role, plan, child, heard, said, stopped: None, went_on: false };
        summary.killed.0 += 1;
        Ok(())
    }

    fn stop_actor(&mut self, dice: &mut Dice, summary: &mut Summary) {
        let index = dice.below(self.actors.len() as u64) as usize;
        let actor = &mut self.actors[index];
        actor.child.signal(Signal::STOP);
        actor.stopped = Some(Instant::now() + Duration::from_millis(dice.below(400)));
        summary.stopped += 1;
    }

    fn stop_supervisor(&mut self, dice: &mut Dice, summary: &mut Summary) {
        let host = dice.pick(&[STEADY, SHAKY]);
        self.hosts[*host].child.signal(Signal::STOP);
        self.hosts[*host].stopped = Some(Instant::now() + Duration::from_millis(dice.below(300)));
        summary.stopped += 1;
    }

    fn kill_supervisor(&mut self, dice: &mut Dice, summary: &mut Summary) -> Result<(), String> {
        self.hosts[SHAKY].child.kill();
        summary.killed.1 += 1;
        if dice.below(2) == 0 {
            std::thread::sleep(Duration::from_millis(dice.below(200)));
        }
        self.restart_supervisor()
    }

    fn terminate_supervisor(&mut self, summary: &mut Summary) -> Result<(), String> {
        self.hosts[SHAKY].child.signal(Signal::CONT);
        let status = self.hosts[SHAKY].child.end();
        if status.is_none_or(|status| !status.success()) {
            return Err(format!("a supervisor that was told to end: {status:?}"));
        }
        summary.terminated += 1;
        self.restart_supervisor()
    }

    fn restart_supervisor(&mut self) -> Result<(), String> {
        let host = &mut self.hosts[SHAKY];
        host.stopped = None;
        host.child = Child::supervisor_refused(self.room, &host.plan);
        host.child.answer(SOON).map_err(|error| format!("restart under the same name: {error}"))?;
        Ok(())
    }

    /// Hears everybody out, wakes who has been stopped for long enough, and notices who is silent.
    pub(super) fn listen(&mut self, summary: &mut Summary) -> Result<(), String> {
        let now = Instant::now();
        let over = |stopped: &mut Option<Instant>| stopped.take_if(|end| now >= *end).is_some();
        for host in &mut self.hosts {
            if over(&mut host.stopped) {
                host.child.signal(Signal::CONT);
            }
        }
        for actor in &mut self.actors {
            if over(&mut actor.stopped) {
                actor.child.signal(Signal::CONT);
            }
            actor.listen(now, self.hang, summary)?;
        }
        Ok(())
    }

    /// Wakes everybody and lets them go on for a while: the disturbed must recover, and then all are
    /// attached.
    pub(super) fn calm(&mut self, summary: &mut Summary) -> Result<(), String> {
        let begin = Instant::now();
        self.hosts.iter_mut().for_each(|host| host.stopped = host.stopped.and(Some(begin)));
        for actor in &mut self.actors {
            actor.stopped = actor.stopped.and(Some(begin));
            actor.went_on = false;
        }
        loop {
            self.listen(summary)?;
            let idle = self.actors.iter().find(|actor| !actor.went_on);
            match idle {
                None if begin.elapsed() > PEACE => return Ok(()),
                Some(idle) if begin.elapsed() > SOON => {
                    return Err(format!("{idle} does not go on after it was left in peace"));
                }
                _ => std::thread::sleep(Duration::from_millis(5)),
            }
        }
    }

    /// Ends everybody in peace.
    pub(super) fn leave(mut self) -> Result<(), String> {
        for actor in &mut self.actors {
            let status = actor.child.end();
            if status.is_none_or(|status| !status.success()) {
                return Err(format!("a {} that was told to leave: {status:?}", actor.role));
            }
        }
        for host in &mut self.hosts {
            let status = host.child.end();
            if status.is_none_or(|status| !status.success()) {
                return Err(format!("supervisor of `{}`: {status:?}", host.plan.name));
            }
        }
        Ok(())
    }
}

impl Actor {
    fn listen(&mut self, now: Instant, hang: Duration, summary: &mut Summary) -> Result<(), String> {
        loop {
            match self.child.answer(Duration::ZERO) {
                Ok(line) => {
                    self.heard = now;
                    note(&line, summary);
                    self.went_on |= ["frames ", "looked", "lied", "forked", "visited"]
                        .iter()
                        .any(|verb| line.starts_with(verb));
                    self.said = line;
                }
                Err(error) if error.starts_with("no answer") => break,
                Err(error) => return Err(format!("{self}: {error}")),
            }
        }
        let silence = now - self.heard;
        if silence > summary.longest_silence.0 {
            summary.longest_silence = (silence, self.to_string());
        }
        if silence > hang {
            return Err(format!("{self} hangs: silent for {silence:?}"));
        }
        Ok(())
    }
}

impl fmt::Display for Actor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of `{}`, last words `{}`", self.role, self.plan.name, self.said)
    }
}

/// Adds up what an actor said.
fn note(line: &str, summary: &mut Summary) {
    let (verb, number) = line.split_once(' ').unwrap_or((line, ""));
    let frames = number.parse::<u64>().unwrap_or(0);
    match verb {
        "session" => summary.sessions += 1,
        "forked" => summary.forks += 1,
        "visited" => summary.visits += 1,
        "frames" => summary.frames += frames,
        "died" => {
            summary.frames += frames;
            summary.told += 1;
        }
        _ => {}
    }
}
