//! The control socket: supervisors that do not answer, pools of very many lanes, idle connections, other
//! namespaces.

use crate::assert_says;
use rustix::process::{Resource, Rlimit, Signal, getrlimit, setrlimit};
use smaclite_ipc::{
    Client, ConnectError, ControlSocketError, Supervisor, WaitOptions, WaitStrategy, status, status_within,
};
use smaclite_tests::pools::process::{ROLE_VARIABLE, SOON, eventually};
use smaclite_tests::pools::raw::Control;
use smaclite_tests::pools::{Child, LanePlan, PoolPlan, Room};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::process::Command;
use std::time::{Duration, Instant};

/// The tests here open thousands of files.
fn raise_file_limit() {
    let limit = getrlimit(Resource::Nofile);
    let _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
}

fn connect_within(
    room: &Room,
    timeout: Option<Duration>,
    interrupted: &mut dyn FnMut() -> bool,
) -> Result<Client, ConnectError> {
    Client::connect_within(
        room.runtime_dir(),
        "train",
        None,
        WaitStrategy::default(),
        WaitOptions { timeout, interrupted },
    )
}

/// Questions to a stopped supervisor once took ten seconds, whatever their timeout; `list` then said that no
/// pool runs, and `serve` with its name waited as long to find the number of its process.
#[test]
fn a_stopped_supervisor_does_not_stop_those_who_ask_it() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let supervisor = Child::supervisor(&room, &plan);
    supervisor.signal(Signal::STOP);
    let time = Duration::from_millis(300);
    let error = connect_within(&room, Some(time), &mut || false).err().expect("it is stopped");
    assert_says(
        &error.to_string(),
        &["`train`", &supervisor.pid().to_string(), "did not answer within 0.3 s"],
    );

    // Without a timeout these would never end.
    let interrupted = |result: ConnectError| {
        matches!(result, ConnectError::Control(ControlSocketError::Interrupted { .. }))
    };
    let mut looks = 0;
    let mut third_look = || {
        looks += 1;
        looks >= 3
    };
    assert!(interrupted(connect_within(&room, None, &mut third_look).err().expect("it is stopped")));
    let wait = WaitOptions { timeout: None, interrupted: &mut || true };
    assert!(interrupted(status_within(room.runtime_dir(), "train", wait).expect_err("it is stopped")));

    let second = Child::supervisor_refused(&room, &plan);
    let error = second.answer(SOON).expect_err("the name is taken");
    assert_says(&error, &["runs already", &format!("process {}", supervisor.pid())]);

    let list = program(&room, "list").output().expect("a child process");
    let (said, error) = (String::from_utf8_lossy(&list.stdout), String::from_utf8_lossy(&list.stderr));
    assert_eq!(list.status.code(), Some(1), "{said}{error}");
    assert!(!said.contains("no pool is running"), "{said}");
    assert_says(&error, &["`train`", "did not answer", "1 of 1 pools"]);
    assert_eq!(smaclite_ipc::running_pools(room.runtime_dir()), ["train"]);
    supervisor.signal(Signal::CONT);
    assert!(status(room.runtime_dir(), "train").is_ok());
}

fn program(room: &Room, arguments: &str) -> Command {
    let mut command = Command::new(std::env::current_exe().expect("a path of this program"));
    command.args(["--exact", "role", "--ignored", "--nocapture"]);
    command.env(ROLE_VARIABLE, format!("program smaclite-pool {arguments}"));
    command.env(smaclite_ipc::ROOT_VARIABLE, room.root());
    command
}

#[test]
fn a_pool_that_comes_later_is_waited_for() {
    let room = Room::new();
    let error =
        connect_within(&room, Some(Duration::from_millis(100)), &mut || false).err().expect("no pool");
    assert!(matches!(error, ConnectError::Control(ControlSocketError::NoSuchPool { .. })), "{error}");
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    std::thread::scope(|scope| {
        let client = scope.spawn(|| connect_within(&room, Some(SOON * 2), &mut || false));
        std::thread::sleep(Duration::from_millis(200));
        let _supervisor = Child::supervisor(&room, &plan);
        client.join().expect("no panic").expect("a client");
    });
}

/// The status of 240 lanes is longer than the socket's buffer: it was cut off, and the pool said not to
/// answer.
#[test]
fn a_pool_of_very_many_lanes_answers_in_full() {
    const LANES: usize = 300;
    raise_file_limit();
    let room = Room::new();
    let lane = |i: usize| LanePlan {
        name: format!("learner-number-{i}"),
        fields: Some(vec!["obs".to_owned()]),
        max_held_batches: 2,
        spectators: 0,
        ..LanePlan::new("2s_vs_1sc", 1)
    };
    let _supervisor =
        Supervisor::start(PoolPlan::new((0..LANES).map(lane)).config(room.runtime_dir())).expect("a pool");
    assert_eq!(status(room.runtime_dir(), "train").expect("a status").lanes.len(), LANES);

    // One that asks faster than it reads gets every answer in the end, and keeps the others from nothing.
    const QUESTIONS: usize = 20;
    let mut slow = UnixStream::connect(room.runtime_dir().socket("train")).expect("the pool's socket");
    slow.write_all("{\"request\":\"status\"}\n".repeat(QUESTIONS).as_bytes())
        .expect("room for the questions");
    assert_eq!(status(room.runtime_dir(), "train").expect("a status").lanes.len(), LANES);
    let answers = BufReader::new(slow).lines().take(QUESTIONS).map(|line| line.expect("a whole line"));
    let lanes = answers.map(|line| {
        let answer: serde_json::Value = serde_json::from_str(&line).expect("an answer");
        answer["lanes"].as_array().expect("lanes").len()
    });
    assert_eq!(lanes.collect::<Vec<_>>(), [LANES; QUESTIONS]);
}

/// 512 connections that asked nothing once shut all others out.
#[test]
fn idle_connections_shut_no_one_out() {
    raise_file_limit();
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2), LanePlan::new("3s5z", 2)]);
    let _supervisor = Child::supervisor(&room, &plan);
    let mut before = Child::attached(&room, &plan.lanes[0]);
    before.must("reset");
    let socket = room.runtime_dir().socket("train");
    let idle: Vec<_> = (0..600).map(|_| UnixStream::connect(&socket).expect("the pool's socket")).collect();
    let mut after = Child::attached(&room, &plan.lanes[1]);
    for learner in [&mut before, &mut after] {
        learner.must("reset");
        learner.must("step 5");
    }
    assert_eq!(status(room.runtime_dir(), "train").expect("a status").lanes.len(), 2);
    let oldest = idle[0].try_clone().expect("a copy");
    oldest.set_read_timeout(Some(SOON)).expect("a time");
    assert_eq!((&oldest).read(&mut [0; 1]).expect("an end"), 0, "the oldest idle connection is closed");
}

/// The kernel gives 0 as the process of a peer that cannot be seen. It was read as a process number, which
/// has no 0.
#[test]
fn a_learner_outside_of_the_pools_process_namespace_is_told_so() {
    let unshare = ["--pid", "--fork", "--kill-child"];
    if !Command::new("unshare").args(unshare).arg("true").status().is_ok_and(|status| status.success()) {
        println!("skipped: this user cannot make process namespaces");
        return;
    }
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let mut command = Command::new("unshare");
    command.args(unshare).arg(std::env::current_exe().expect("a path of this program"));
    command.args(["--exact", "role", "--ignored", "--nocapture"]);
    let role = format!("supervisor {}", serde_json::to_string(&plan).expect("plain data"));
    command.env(ROLE_VARIABLE, role).env(smaclite_ipc::ROOT_VARIABLE, room.root());
    let supervisor = Child::of_command(&mut command, "supervisor");
    supervisor.answer(SOON * 2).expect("it serves");
    let error = Client::connect(room.runtime_dir(), "train", None, WaitStrategy::default())
        .err()
        .expect("another namespace");
    assert_says(&error.to_string(), &["process namespace", "`train`", "--pid=container"]);
    assert_eq!(status(room.runtime_dir(), "train").expect("a status").lanes[0].learner_pid, None);
}

#[test]
fn a_name_that_no_pool_can_have_is_an_error_of_its_own() {
    let room = Room::new();
    for name in ["../../etc", "a\0b", "", "a\nb"] {
        let error =
            Client::connect(room.runtime_dir(), name, None, WaitStrategy::default()).err().expect("no name");
        assert!(matches!(error, ConnectError::Control(ControlSocketError::Name(_))), "{error}");
        assert_says(&error.to_string(), &[&name.escape_debug().to_string(), "letters"]);
        assert!(!error.to_string().contains('\n'), "{error}");
    }
}

/// A learner that attached while its pool died was told of services that do not exist, or of a broken pipe.
#[test]
fn a_pool_that_dies_while_one_attaches_is_gone() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let mut supervisor = Child::supervisor(&room, &plan);
    let attached =
        Control::connect(room.runtime_dir()).ask(r#"{"request":"attach","version":1,"lane":null}"#);
    supervisor.kill();
    let instance = attached.split("\"instance\":\"").nth(1).and_then(|rest| rest.split('"').next());
    let answer = attached.replace(instance.expect("an instance"), "train.1.0");
    for last_words in [answer.as_str(), ""] {
        let socket = room.runtime_dir().socket("train");
        let _ = std::fs::remove_file(&socket);
        let listener = UnixListener::bind(&socket).expect("a socket");
        std::thread::scope(|scope| {
            scope.spawn(move || {
                let mut stream = BufReader::new(listener.accept().expect("a learner").0);
                drop(listener);
                stream.read_line(&mut String::new()).expect("a question");
                stream.get_mut().write_all(last_words.as_bytes()).expect("a learner that reads");
            });
            let error = Client::connect(room.runtime_dir(), "train", None, WaitStrategy::default())
                .err()
                .expect("it is gone");
            assert!(matches!(error, ConnectError::Control(ControlSocketError::Gone { .. })), "{error}");
            assert_says(&error.to_string(), &["supervisor", "`train`", "gone"]);
        });
    }
}

/// While a supervisor waits for a signal it does nothing else, and before it has made anything it need not
/// clean up.
#[test]
fn a_signal_ends_serve_at_once_also_while_it_starts() {
    let room = Room::new();
    for delay in [0, 20, 60, 150, 400] {
        let mut serve = Child::start(&room, "program", "smaclite-pool serve 27m_vs_30m:64 --name train");
        std::thread::sleep(Duration::from_millis(delay));
        let told = Instant::now();
        serve.signal(Signal::TERM);
        assert!(serve.wait(SOON).is_some());
        println!("ended {:?} after a signal at {delay} ms", told.elapsed());
        assert!(eventually(|| room.files().is_empty()), "left behind: {:#?}", room.files());
    }
}
