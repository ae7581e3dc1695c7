//! Tests of the log of an environment: what is read, what is dropped, and how much memory it uses.

use super::*;
use smaclite_engine::{Arena, Battle, Rules};
use smaclite_scenarios::Scenario;

const FIRST: FollowerId = FollowerId(1);
const SECOND: FollowerId = FollowerId(2);

fn start() -> Vec<u8> {
    let arena = Arena::new(&Scenario::resolve("3m").unwrap(), Rules::Smaclite);
    Battle::new(Arc::new(arena), 0).record()
}

fn log(followers: &[FollowerId], memory: &LogMemory) -> EpisodeLog {
    let mut log = EpisodeLog::new(3, start(), memory.clone());
    followers.iter().for_each(|follower| log.add_reader(*follower));
    log
}

fn play(log: &mut EpisodeLog, steps: usize) {
    (1..=steps).for_each(|step| log.step([1, 2, 3].into_iter(), step == steps));
}

/// Number, steps, and whether there is a start.
fn read(log: &mut EpisodeLog, follower: FollowerId) -> Vec<(u64, usize, bool)> {
    let parts = log.read(follower, &mut usize::MAX.clone()).into_iter();
    parts.map(|part| (part.number, part.actions.len() / 3, part.start.is_some())).collect()
}

#[test]
fn every_step_is_read_once_and_every_start() {
    let mut log = log(&[FIRST], &LogMemory::new());
    assert_eq!(read(&mut log, FIRST), [(0, 0, true)]);
    assert_eq!(read(&mut log, FIRST), []);
    log.step([1, 2, 3].into_iter(), false);
    assert_eq!(read(&mut log, FIRST), [(0, 1, false)]);
    assert!(!log.is_full(), "one step fills no log");
    log.step([1, 2, 3].into_iter(), true);
    log.begin(start());
    log.begin(start());
    log.step([4, 5, 6].into_iter(), false);
    log.add_reader(SECOND);
    assert_eq!(read(&mut log, FIRST), [(0, 1, false), (1, 0, true), (2, 1, true)]);
    assert_eq!(read(&mut log, FIRST), []);
    assert_eq!(read(&mut log, SECOND), [(2, 1, true)], "it begins with the present episode");
}

/// Episodes that all followers had read stayed until there were 4096.
#[test]
fn what_all_followers_have_read_is_dropped() {
    let mut log = log(&[FIRST, SECOND], &LogMemory::new());
    for _ in 0..10 {
        play(&mut log, 5);
        log.begin(start());
    }
    read(&mut log, FIRST);
    assert_eq!(log.episodes.len(), 11, "the second has not read them");
    read(&mut log, SECOND);
    assert_eq!(log.episodes.len(), 1);
    assert_eq!(log.bytes, log.episodes[0].bytes());
    play(&mut log, 5);
    log.begin(start());
    read(&mut log, FIRST);
    log.remove_reader(SECOND);
    assert_eq!(log.episodes.len(), 1, "one that left reads no more");
}

/// Only actions were counted: 4096 snapshots per environment took 14 to 26 MB.
#[test]
fn logs_of_a_lane_use_no_more_than_its_limit_and_say_what_was_lost() {
    let memory = LogMemory::new();
    let mut logs: Vec<EpisodeLog> = (0..256).map(|_| log(&[FIRST, SECOND], &memory)).collect();
    let next = start();
    let share = MAX_LOG_BYTES / logs.len();
    let episodes = 2 * share / next.len();
    for log in &mut logs {
        read(log, SECOND);
        (0..episodes).for_each(|_| {
            play(log, 1);
            log.begin(next.clone());
        });
        let counted: usize = log.episodes.iter().map(LoggedEpisode::bytes).sum();
        assert_eq!(log.bytes, counted);
        assert!(counted <= share && counted > share / 2, "{counted} of {share}");
    }
    let parts = logs[0].read(FIRST, &mut usize::MAX.clone());
    let first = &parts[0];
    assert_eq!((first.lost, first.number), (first.number, first.lost));
    assert!(first.lost > 0 && first.start.is_some());
    assert!(parts[1..].iter().all(|part| part.lost == 0 && part.start.is_some()));
    let read_first = logs[0].read(SECOND, &mut usize::MAX.clone());
    assert_eq!(read_first[0].lost, first.lost, "the end of episode 0 is lost to it");
}

#[test]
fn more_followed_environments_have_smaller_logs() {
    let memory = LogMemory::new();
    let mut first = log(&[FIRST], &memory);
    let next = start();
    (0..1000).for_each(|_| first.begin(next.clone()));
    let others: Vec<EpisodeLog> = (0..1023).map(|_| log(&[FIRST], &memory)).collect();
    first.trim();
    assert!(first.bytes <= MAX_LOG_BYTES / 1024);
    drop(others);
    assert_eq!(memory.share(), MAX_LOG_BYTES);
    let limit = MAX_LOG_BYTES / (MIN_SNAPSHOTS * next.len());
    assert_eq!(memory.check(limit, next.len()), Err(TooManyFollowed { limit }));
    assert_eq!(memory.check(limit - 1, next.len()), Ok(()));
}

#[test]
fn an_episode_without_end_is_limited_too() {
    let memory = LogMemory::new();
    let mut logs: Vec<EpisodeLog> = (0..256).map(|_| log(&[FIRST], &memory)).collect();
    let now = start();
    let share = MAX_LOG_BYTES / logs.len();
    for _ in 0..share / 2 {
        logs[0].step([7; 3].into_iter(), false);
        if logs[0].is_full() {
            logs[0].begin_again(now.clone());
        }
        assert!(logs[0].bytes <= share + (share / 4));
    }
    let parts = logs[0].read(FIRST, &mut usize::MAX.clone());
    assert_eq!(parts.iter().map(|part| part.lost).sum::<u64>(), logs[0].next_number - 1);
    assert!(logs[0].next_number > 2);
}

/// What an episode has room for counts as used.
#[test]
fn the_memory_of_an_episode_grows_seldom_and_by_a_quarter() {
    let mut log = log(&[FIRST], &LogMemory::new());
    let mut grown = 0;
    for step in 1..=10_000 {
        let before = log.episodes[0].actions.capacity();
        log.step([1, 2, 3].into_iter(), false);
        let (room, needed) = (log.episodes[0].actions.capacity(), 3 * step);
        grown += usize::from(room != before);
        assert!(needed <= room && room <= needed + (needed / 4).max(48), "{room} for {needed}");
        assert_eq!(log.bytes, size_of::<LoggedEpisode>() + log.episodes[0].start.capacity() + 2 * room);
    }
    assert!(grown < 30, "it grew {grown} times");
}

/// One answer carried everything that was not read: gigabytes.
#[test]
fn a_log_is_read_in_pieces() {
    for size in (100..3000).step_by(7).chain((3000..12_000).step_by(500)) {
        let mut log = log(&[FIRST], &LogMemory::new());
        for steps in [1000, 1, 0, 500] {
            play(&mut log, steps);
            log.begin(start());
        }
        let (mut played, mut ends, mut starts) = (Vec::new(), Vec::new(), 0);
        loop {
            let mut budget = size;
            let parts = log.read(FIRST, &mut budget);
            let bytes: usize = parts.iter().map(|part| part.actions.len() * 2).sum();
            assert!(bytes <= size);
            for part in parts {
                starts += usize::from(part.start.is_some());
                played.extend(std::iter::repeat_n(part.number, part.actions.len() / 3));
                ends.extend(part.is_over.then_some(played.len()));
            }
            if budget > 0 {
                break;
            }
        }
        assert_eq!((starts, ends), (5, vec![1000, 1001, 1501]), "in pieces of {size} bytes");
        assert_eq!(played.iter().filter(|number| **number == 3).count(), 500);
    }
}
