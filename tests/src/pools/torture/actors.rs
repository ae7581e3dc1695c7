//! What the processes of a torture run do while they live. They say a line when something happened, so that
//! silence is a hang, and an `error` when something is as it must not be.

use crate::pools::dice::Dice;
use crate::pools::fork::child_reads;
use crate::pools::player::{Player, Trouble};
use crate::pools::raw;
use crate::pools::role::answer;
use crate::pools::{LanePlan, PoolPlan};
use smaclite_ipc::wire::RequestHeader;
use smaclite_ipc::{Batch, ClientError, RuntimeDir, Spectator, status};
use smaclite_pool::transport::RequestKind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Set when the parent wants this process to leave.
static LEAVE: AtomicBool = AtomicBool::new(false);

/// How often a process says that it goes on.
const BEAT: Duration = Duration::from_millis(50);

/// Waits of an actor are longer than anything that is no hang.
const LONG: Duration = Duration::from_secs(60);

fn leaves() -> bool {
    LEAVE.load(Ordering::Relaxed)
}

/// Leaves when the parent closes the input.
fn listen() {
    std::thread::spawn(|| {
        for _line in std::io::stdin().lines() {}
        LEAVE.store(true, Ordering::Relaxed);
    });
}

fn say(line: impl std::fmt::Display) {
    answer::<_, String>(Ok(line));
}

fn complain(error: impl std::fmt::Display) -> i32 {
    answer::<&str, _>(Err(error));
    1
}

/// Splits `POOL SEED JSON`.
fn parse(argument: &str) -> (String, Dice, PoolPlan) {
    let mut parts = argument.splitn(2, ' ');
    let seed = parts.next().and_then(|seed| seed.parse().ok()).expect("a seed");
    let plan: PoolPlan = serde_json::from_str(parts.next().unwrap_or_default()).expect("a plan");
    (plan.name.clone(), Dice::new(seed), plan)
}

/// A learner of the plan's only lane: attaches again and again, plays, holds frames, compares.
pub fn learner(argument: &str) -> i32 {
    let (pool, mut dice, plan) = parse(argument);
    listen();
    let runtime_dir = match RuntimeDir::for_current_user() {
        Ok(runtime_dir) => runtime_dir,
        Err(error) => return complain(error),
    };
    while !leaves() {
        match Player::connect(&runtime_dir, &pool, &plan.lanes[0]) {
            Ok(player) => {
                say("session");
                if let Err(error) = session(player, &plan.lanes[0], &mut dice) {
                    return complain(error);
                }
            }
            // The lane is not free yet, or the pool is dead or dying: the parent knows whether it should not
            // be.
            Err(error) => {
                say(format!("waits: {error}"));
                std::thread::sleep(Duration::from_millis(10));
            }
        }
    }
    0
}

/// One session, to its end by the dice, by the pool's death, or because it is time to leave.
fn session(mut player: Player, plan: &LanePlan, dice: &mut Dice) -> Result<(), String> {
    let mut held: Vec<(Batch, Vec<u8>)> = Vec::new();
    let mut frames = 0u64;
    let mut beat = Instant::now();
    let ends_after = if dice.below(3) == 0 { dice.below(300) } else { u64::MAX };
    let mut must_reset = true;
    let mut steps = 0;
    while !leaves() && steps < ends_after {
        steps += 1;
        let played = match must_reset {
            true => player.reset(Some(dice.below(1000)), LONG).map(|()| None),
            false => player.step(LONG).map(Some),
        };
        must_reset = dice.below(200) == 0;
        match played {
            Ok(batch) => {
                frames += 1;
                keep_some(batch, &mut held, plan.max_held_batches - 1, dice)?;
            }
            Err(Trouble::Client(ClientError::PoolDied { .. })) => {
                unchanged(&held)?; // what it holds outlives the pool
                say(format!("died {frames}"));
                return Ok(());
            }
            Err(error) => return Err(error.to_string()),
        }
        if dice.below(400) == 0 {
            // Something is under way when the client goes.
            let _ = player.send();
            break;
        }
        if beat.elapsed() >= BEAT {
            beat = Instant::now();
            say(format!("frames {frames}"));
            frames = 0;
        }
    }
    say(format!("frames {frames}"));
    drop(player);
    unchanged(&held)
}

/// Holds some batches for a while.
fn keep_some(
    batch: Option<Batch>,
    held: &mut Vec<(Batch, Vec<u8>)>,
    most: usize,
    dice: &mut Dice,
) -> Result<(), String> {
    if let Some(batch) = batch
        && held.len() < most
        && dice.below(4) == 0
    {
        let bytes = batch.bytes().to_vec();
        held.push((batch, bytes));
    }
    if !held.is_empty() && dice.below(10) == 0 {
        unchanged(held)?;
        held.swap_remove(dice.below(held.len() as u64) as usize);
    }
    Ok(())
}

fn unchanged(held: &[(Batch, Vec<u8>)]) -> Result<(), String> {
    match held.iter().find(|(batch, bytes)| batch.bytes() != bytes) {
        Some((batch, _)) => Err(format!("WRONG: frame {} changed while it was held", batch.sequence())),
        None => Ok(()),
    }
}

/// A learner of the plan's only lane that forks while it receives; the children read what it holds.
pub fn forker(argument: &str) -> i32 {
    let (pool, _, plan) = parse(argument);
    listen();
    let Ok(runtime_dir) = RuntimeDir::for_current_user() else { return 1 };
    while !leaves() {
        match Player::connect(&runtime_dir, &pool, &plan.lanes[0]) {
            Ok(player) => {
                if let Err(error) = forking_session(player) {
                    return complain(error);
                }
            }
            Err(error) => {
                say(format!("waits: {error}"));
                std::thread::sleep(Duration::from_millis(10));
            }
        }
    }
    0
}

fn forking_session(mut player: Player) -> Result<(), String> {
    let held = Mutex::new(None::<Arc<(Batch, Vec<u8>)>>);
    let ended = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let forks = scope.spawn(|| -> Result<(), String> {
            while !leaves() && !ended.load(Ordering::Relaxed) {
                let batch = held.lock().expect("no panic").clone();
                if let Some(held) = batch {
                    child_reads(&held.0, &held.1, LONG / 12)?;
                    say("forked");
                }
                std::thread::sleep(Duration::from_millis(20));
            }
            Ok(())
        });
        let mut played = player.reset(None, LONG);
        while played.is_ok() && !leaves() && !forks.is_finished() {
            played = player.step(LONG).map(|batch| {
                let bytes = batch.bytes().to_vec();
                *held.lock().expect("no panic") = Some(Arc::new((batch, bytes)));
            });
        }
        ended.store(true, Ordering::Relaxed);
        forks.join().expect("no panic")?;
        match played {
            Ok(()) | Err(Trouble::Client(ClientError::PoolDied { .. })) => Ok(()),
            Err(error) => Err(error.to_string()),
        }
    })
}

/// A process in a process namespace of its own: it may be served or refused, but is answered.
pub fn visitor(argument: &str) -> i32 {
    let (pool, _, plan) = parse(argument);
    listen();
    let Ok(runtime_dir) = RuntimeDir::for_current_user() else { return 1 };
    while !leaves() {
        let visited = match Player::connect(&runtime_dir, &pool, &plan.lanes[0]) {
            Ok(mut player) => player.reset(None, LONG).and_then(|()| player.step(LONG).map(drop)),
            Err(_) => Ok(()),
        };
        match visited {
            Ok(()) | Err(Trouble::Client(ClientError::PoolDied { .. })) => say("visited"),
            Err(error) => return complain(error),
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    0
}

/// A spectator of the plan's only lane, that reads at times.
pub fn spectator(argument: &str) -> i32 {
    let (pool, mut dice, plan) = parse(argument);
    listen();
    let Ok(runtime_dir) = RuntimeDir::for_current_user() else { return 1 };
    while !leaves() {
        match Spectator::connect(&runtime_dir, &pool, Some(&plan.lanes[0].name)) {
            Ok(mut spectator) => {
                say("watches");
                while !leaves() && spectator.latest().is_ok() {
                    say("looked");
                    std::thread::sleep(Duration::from_millis(dice.below(100)));
                }
            }
            Err(error) => {
                say(format!("waits: {error}"));
                std::thread::sleep(Duration::from_millis(50));
            }
        }
    }
    0
}

/// Sends what no lane may accept, to all lanes of a pool.
pub fn liar(argument: &str) -> i32 {
    let (pool, mut dice, _) = parse(argument);
    listen();
    let Ok(runtime_dir) = RuntimeDir::for_current_user() else { return 1 };
    while !leaves() {
        say("looks for a lane");
        std::thread::sleep(Duration::from_millis(100));
        let Ok(status) = status(&runtime_dir, &pool) else { continue };
        let lane = dice.pick(&status.lanes).description.clone();
        // Where the pool dies while it is spoken to, a panic of this program tells nothing and is not shown.
        std::panic::set_hook(Box::new(|_| {}));
        let lied =
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| lie(&runtime_dir, &lane, &mut dice)));
        if lied.is_err() {
            say("the lane is gone");
        }
    }
    0
}

fn lie(runtime_dir: &RuntimeDir, lane: &smaclite_ipc::LaneDescription, dice: &mut Dice) {
    let node = raw::node(runtime_dir);
    let requests = raw::requests(&node, lane, 4096);
    let layout = lane.layout().expect("a layout");
    for number in 0..20 {
        // Sessions count from 1, so these belong to nobody.
        let session = (1 << 40) + dice.below(100);
        let count = dice.below(9) as usize;
        let mut header = RequestHeader::new(&layout, session, number, RequestKind::Step, count);
        if dice.below(2) == 0 {
            header.layout_hash ^= 1 << dice.below(64);
        }
        let payload = vec![dice.below(256) as u8; 1 + dice.below(4000) as usize];
        if requests.offer(header, &payload).is_some() {
            say("lied");
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}
