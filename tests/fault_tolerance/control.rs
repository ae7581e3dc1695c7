//! The control socket: supervisors that do not answer, pools with hundreds of lanes, idle connections, other
//! process namespaces.

use crate::assert_contains;
use rustix::process::{Resource, Rlimit, Signal, getrlimit, setrlimit};
use smaclite_ipc::control::protocol::PROTOCOL_VERSION;
use smaclite_ipc::{
    Client, ConnectError, ControlSocketError, Follower, Spectator, WaitOptions, WaitStrategy, lane_scenario,
    status,
};
use smaclite_tests::process::{NEW_PROCESS_NAMESPACE, TIMEOUT, can_launch, role_command, run_to_end};
use smaclite_tests::raw_client::{Control, attach_request, request};
use smaclite_tests::{Child, LanePlan, PoolPlan, TestDir, skip};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::time::{Duration, Instant};

/// The tests here open thousands of files.
fn raise_file_limit() {
    let limit = getrlimit(Resource::Nofile);
    let _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
}

fn connect_within(
    dir: &TestDir,
    timeout: Option<Duration>,
    interrupted: &mut dyn FnMut() -> bool,
) -> Result<Client, ConnectError> {
    dir.connect(None, WaitStrategy::default(), WaitOptions { timeout, interrupted })
}

/// Requests to a stopped supervisor took ten seconds, whatever their timeout; `list` then said that no pool
/// runs, and `serve` with the same name waited as long to find the process id.
#[test]
fn a_stopped_supervisor_does_not_block_its_clients() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let supervisor = Child::supervisor(&dir, &plan);
    supervisor.signal(Signal::STOP);
    let time = Duration::from_millis(300);
    let error = connect_within(&dir, Some(time), &mut || false).expect_err("it is stopped");
    assert_contains(
        &error.to_string(),
        &["`train`", &supervisor.pid().to_string(), "did not answer within 0.3 s"],
    );

    // Without a timeout these would never end.
    let interrupted = |result: ConnectError| {
        matches!(result, ConnectError::Control(ControlSocketError::Interrupted { .. }))
    };
    let mut checks = 0;
    let mut third_check = || {
        checks += 1;
        checks >= 3
    };
    assert!(interrupted(connect_within(&dir, None, &mut third_check).expect_err("it is stopped")));
    let wait = WaitOptions { timeout: None, interrupted: &mut || true };
    assert!(interrupted(status(dir.runtime_dir(), "train", wait).expect_err("it is stopped")));

    let second = Child::try_supervisor(&dir, &plan);
    let error = second.answer(TIMEOUT).expect_err("the name is in use");
    assert_contains(&error, &["runs already", &format!("process {}", supervisor.pid())]);

    let (code, output, error) = run_to_end(&mut role_command(&dir, &[], "program list"));
    assert_eq!(code, Some(1), "{output}{error}");
    assert!(!output.contains("no pool runs here"), "{output}");
    assert_contains(&error, &["`train`", "did not answer", "1 of 1 pools"]);
    assert_eq!(smaclite_ipc::running_pools(dir.runtime_dir()), ["train"]);
    supervisor.signal(Signal::CONT);
    assert!(status(dir.runtime_dir(), "train", WaitOptions::for_response()).is_ok());
}

#[test]
fn a_client_waits_for_a_pool_that_starts_later() {
    let dir = TestDir::new();
    let error = connect_within(&dir, Some(Duration::from_millis(100)), &mut || false).expect_err("no pool");
    assert!(matches!(error, ConnectError::Control(ControlSocketError::NoSuchPool { .. })), "{error}");
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    std::thread::scope(|scope| {
        let client = scope.spawn(|| connect_within(&dir, Some(TIMEOUT * 2), &mut || false));
        std::thread::sleep(Duration::from_millis(200));
        let _supervisor = Child::supervisor(&dir, &plan);
        client.join().expect("no panic").expect("a client");
    });
}

/// The status of 240 lanes is longer than the socket's buffer: it was truncated, and the client reported that
/// the pool does not answer.
#[test]
fn the_status_of_hundreds_of_lanes_is_complete() {
    const LANES: usize = 300;
    raise_file_limit();
    let dir = TestDir::new();
    let lane = |i: usize| LanePlan {
        name: format!("learner-number-{i}"),
        fields: Some(vec!["obs".to_owned()]),
        max_held_batches: 2,
        spectators: 0,
        ..LanePlan::new("2s_vs_1sc", 1)
    };
    let _supervisor = dir.start(&PoolPlan::new((0..LANES).map(lane)));
    assert_eq!(dir.status().lanes.len(), LANES);

    // A client that writes requests faster than it reads gets every answer in the end, and delays no other.
    const REQUESTS: usize = 20;
    let mut slow = UnixStream::connect(dir.runtime_dir().socket("train")).expect("the pool's socket");
    slow.write_all(format!("{}\n", request(r#""request":"status""#)).repeat(REQUESTS).as_bytes())
        .expect("a socket that can be written to");
    assert_eq!(dir.status().lanes.len(), LANES);
    let answers = BufReader::new(slow).lines().take(REQUESTS).map(|line| line.expect("a whole line"));
    let lanes = answers.map(|line| {
        let answer: serde_json::Value = serde_json::from_str(&line).expect("an answer");
        answer["lanes"].as_array().expect("lanes").len()
    });
    assert_eq!(lanes.collect::<Vec<_>>(), [LANES; REQUESTS]);
}

/// After 512 idle connections no other client could connect.
#[test]
fn idle_connections_do_not_block_other_clients() {
    raise_file_limit();
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2), LanePlan::new("3s5z", 2)]);
    let (_supervisor, mut before) = Child::supervisor_and_learner(&dir, &plan);
    let socket = dir.runtime_dir().socket("train");
    let idle: Vec<_> = (0..600).map(|_| UnixStream::connect(&socket).expect("the pool's socket")).collect();
    let mut after = Child::attached(&dir, &plan.lanes[1]);
    for learner in [&mut before, &mut after] {
        learner.must("reset");
        learner.must("step 5");
    }
    assert_eq!(dir.status().lanes.len(), 2);
    let oldest = idle[0].try_clone().expect("a copy");
    oldest.set_read_timeout(Some(TIMEOUT)).expect("a timeout");
    assert_eq!((&oldest).read(&mut [0; 1]).expect("an end"), 0, "the oldest idle connection is closed");
}

/// The kernel reports process id 0 for a peer in a process namespace that is not visible. It was used as a
/// valid process id.
#[test]
fn a_learner_outside_of_the_pools_process_namespace_gets_an_error() {
    if !can_launch(NEW_PROCESS_NAMESPACE) {
        return skip("this user cannot create process namespaces");
    }
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let supervisor = Child::launch(&dir, NEW_PROCESS_NAMESPACE, &plan.role());
    supervisor.answer(TIMEOUT * 2).expect("it serves");
    let error =
        dir.connect(None, WaitStrategy::default(), WaitOptions::no_wait()).expect_err("another namespace");
    assert_contains(&error.to_string(), &["process namespace", "`train`", "--pid=container"]);
    assert_eq!(dir.status().lanes[0].learner_pid, None);
}

#[test]
fn an_invalid_name_of_a_pool_is_its_own_error() {
    let dir = TestDir::new();
    for name in ["../../etc", "a\0b", "", "a\nb"] {
        let error =
            Client::connect(dir.runtime_dir(), name, None, WaitStrategy::default(), WaitOptions::no_wait())
                .expect_err("an invalid name");
        assert!(matches!(error, ConnectError::Control(ControlSocketError::Name(_))), "{error}");
        assert_contains(&error.to_string(), &[&name.escape_debug().to_string(), "letters"]);
        assert!(!error.to_string().contains('\n'), "{error}");
    }
}

/// A learner that attached while its pool died got an error about missing services or a broken pipe.
#[test]
fn a_pool_that_dies_while_a_learner_attaches_is_reported_as_gone() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let mut supervisor = Child::supervisor(&dir, &plan);
    let attached = Control::connect(dir.runtime_dir()).ask(&attach_request(None));
    supervisor.kill();
    let instance = attached.split("\"instance\":\"").nth(1).and_then(|rest| rest.split('"').next());
    let answer = attached.replace(instance.expect("an instance"), "train.1.0");
    for last_answer in [answer.as_str(), ""] {
        let socket = dir.runtime_dir().socket("train");
        let _ = std::fs::remove_file(&socket);
        let listener = UnixListener::bind(&socket).expect("a socket");
        std::thread::scope(|scope| {
            scope.spawn(move || {
                let mut stream = BufReader::new(listener.accept().expect("a learner").0);
                drop(listener);
                stream.read_line(&mut String::new()).expect("a request");
                stream.get_mut().write_all(last_answer.as_bytes()).expect("a learner that reads");
            });
            let error =
                dir.connect(None, WaitStrategy::default(), WaitOptions::no_wait()).expect_err("it is gone");
            assert!(matches!(error, ConnectError::Control(ControlSocketError::Gone { .. })), "{error}");
            assert_contains(&error.to_string(), &["supervisor", "`train`", "gone"]);
        });
    }
}

/// Signals at different moments: before anything was created, while memory is reserved, and while it serves.
#[test]
fn a_signal_ends_serve_also_while_it_starts() {
    let dir = TestDir::new();
    for delay in [0, 20, 60, 150, 400] {
        let mut serve = Child::program(&dir, "serve 27m_vs_30m:64 --name train");
        std::thread::sleep(Duration::from_millis(delay));
        let begin = Instant::now();
        serve.signal(Signal::TERM);
        assert!(serve.wait(TIMEOUT).is_some());
        println!("ended {:?} after a signal at {delay} ms", begin.elapsed());
        dir.assert_empty();
    }
}

/// Only the request to attach had a version; all others failed with a message about JSON.
#[test]
fn a_program_of_another_release_gets_an_error_that_names_both() {
    let dir = TestDir::new();
    let _supervisor = dir.start(&PoolPlan::new([LanePlan::new("2s3z", 2)]));
    let ours = format!("release {} (protocol {PROTOCOL_VERSION})", env!("CARGO_PKG_VERSION"));
    for keys in [
        r#""request":"status""#,
        r#""request":"attach","lane":null"#,
        r#""request":"watch","lane":null"#,
        r#""request":"follow","lane":null,"env_ids":[0]"#,
        r#""request":"read_episodes""#,
        r#""request":"of the future""#,
    ] {
        let line = format!(r#"{{"version":99,"release":"9.8.7",{keys}}}"#);
        let answer = Control::connect(dir.runtime_dir()).ask(&line);
        assert_contains(&answer, &["refused", &ours, "release 9.8.7 (protocol 99)", "run the same release"]);
    }
}

#[test]
fn a_pool_of_another_release_gives_an_error_that_names_both() {
    let dir = TestDir::new();
    let ours = format!("release {} (protocol {PROTOCOL_VERSION})", env!("CARGO_PKG_VERSION"));
    let runtime_dir = dir.runtime_dir();
    let wait = WaitOptions::for_response;
    let requests: [&dyn Fn() -> Option<ConnectError>; 5] = [
        &|| status(runtime_dir, "train", wait()).err(),
        &|| dir.connect(None, WaitStrategy::default(), wait()).err(),
        &|| Spectator::connect(runtime_dir, "train", None, wait()).err(),
        &|| Follower::connect(runtime_dir, "train", None, &[0], wait()).err(),
        &|| lane_scenario(runtime_dir, "train", None, wait()).err(),
    ];
    for request in requests {
        let socket = runtime_dir.socket("train");
        let _ = std::fs::remove_file(&socket);
        let listener = UnixListener::bind(&socket).expect("a socket");
        std::thread::scope(|scope| {
            scope.spawn(move || {
                let mut stream = BufReader::new(listener.accept().expect("a client").0);
                stream.read_line(&mut String::new()).expect("a request");
                let answer = "{\"version\":99,\"release\":\"9.8.7\",\"response\":{\"is\":\"new\"}}\n";
                stream.get_mut().write_all(answer.as_bytes()).expect("a client that reads");
            });
            let error = request().expect("another release").to_string();
            assert_contains(
                &error,
                &["`train`", "release 9.8.7 (protocol 99)", &ours, "run the same release"],
            );
        });
    }
}
