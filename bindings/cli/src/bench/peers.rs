//! Other programs that step environments, measured in turn with this one. `peers.py` steps them, in processes
//! of a Python interpreter that can import them; here are the processes and the comparison.

use super::throughput::MeasureError;
use super::throughput::median;
use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

const SCRIPT: &str = include_str!("peers.py");

/// A program that steps environments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Peer {
    /// The published SMAClite, with its C++ addon if that can be imported
    Published,
    /// SMAX of JaxMARL, compiled by JAX for this processor
    Smax,
    /// EnvPool's CartPole-v1, compared with environments that do nothing
    Envpool,
    /// PufferLib with environments that do nothing, compared with ours
    Pufferlib,
}

impl Peer {
    /// The name that is typed on the command line.
    pub fn name(self) -> String {
        self.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned())
    }

    /// How it is installed.
    pub fn install(self) -> &'static str {
        match self {
            Peer::Published => {
                "pip install . in a checkout of SMAClite, and of its addon SMAClite-Python-RVO2"
            }
            Peer::Smax => "pip install jaxmarl",
            Peer::Envpool => "pip install envpool",
            Peer::Pufferlib => "pip install pufferlib",
        }
    }
}

/// A peer that an interpreter can import.
pub struct Found {
    peer: Peer,
    python: PathBuf,
    description: Description,
}

#[derive(Deserialize)]
struct Description {
    versions: String,
    scenarios: Option<Vec<String>>,
    configurations: Vec<String>,
    processes: usize,
}

/// Why a peer is not measured.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum PeerError {
    #[error("the Python interpreter {} cannot be started: {source}", python.display())]
    Python { python: PathBuf, source: std::io::Error },
    #[error("{} is not installed: {}; install it ({}) or name its interpreter with --python", peer.name(),
        reasons.join("; "), peer.install())]
    Missing { peer: Peer, reasons: Vec<String> },
    #[error("{}: {message}", peer.name())]
    Failed { peer: Peer, message: String },
    #[error("{}: its process ended without an answer", peer.name())]
    Ended { peer: Peer },
    #[error(transparent)]
    Here(#[from] MeasureError),
}

/// What a process answers, a line at a time.
#[derive(Deserialize)]
#[serde(untagged)]
enum Reply {
    Error { error: String },
    Missing { missing: String },
    Description(Description),
    Ready { ready: bool },
    Rate { steps_per_s: f64 },
}

impl Peer {
    /// Finds the peer with the first of the interpreters that can import it.
    ///
    /// # Errors
    /// [`PeerError::Missing`] if none can; and if an interpreter cannot be started or the peer fails.
    pub fn find(self, pythons: &[PathBuf]) -> Result<Found, PeerError> {
        let mut reasons = Vec::new();
        for python in pythons {
            match Process::start(self, python, &["describe", &self.name()])?.reply()? {
                Reply::Description(description) => {
                    return Ok(Found { peer: self, python: python.clone(), description });
                }
                Reply::Missing { missing } => reasons.push(format!("{missing} ({})", python.display())),
                _ => return Err(PeerError::Failed { peer: self, message: "unexpected answer".to_owned() }),
            }
        }
        Err(PeerError::Missing { peer: self, reasons })
    }
}

impl Found {
    /// The versions of its packages.
    pub fn versions(&self) -> &str {
        &self.description.versions
    }

    /// The scenarios that it has; `None` if its environments do nothing.
    pub fn scenarios(&self) -> Option<&[String]> {
        self.description.scenarios.as_deref()
    }

    /// Measures all of its configurations and `here` in turn, once per round. The result has the best
    /// configuration.
    ///
    /// # Errors
    /// If the peer or `here` fails.
    pub fn compare(
        &self,
        scenario: &str,
        rounds: usize,
        time: Duration,
        here: &mut dyn FnMut() -> Result<f64, MeasureError>,
    ) -> Result<Comparison, PeerError> {
        let mut running = Running::start(self, scenario)?;
        let configurations = &self.description.configurations;
        let mut theirs = vec![Vec::new(); configurations.len()];
        let mut ours = Vec::new();
        for _ in 0..rounds {
            for (configuration, results) in theirs.iter_mut().enumerate() {
                results.push(running.measure(configuration, time)?);
            }
            ours.push(here()?);
        }
        let medians = theirs.into_iter().map(median).zip(configurations);
        let best = medians.max_by(|(a, _), (b, _)| a.total_cmp(b));
        let (peer_steps_per_s, configuration) =
            best.ok_or_else(|| self.failed("it has no configurations".to_owned()))?;
        let steps_per_s = median(ours);
        let configuration = match self.description.processes {
            1 => configuration.clone(),
            processes => format!("{processes} processes on a core each, {configuration} per process"),
        };
        let ratio = steps_per_s / peer_steps_per_s;
        Ok(Comparison {
            scenario: scenario.to_owned(),
            peer: self.peer,
            configuration,
            peer_steps_per_s,
            steps_per_s,
            ratio,
        })
    }

    fn failed(&self, message: String) -> PeerError {
        PeerError::Failed { peer: self.peer, message }
    }
}

/// Medians of measurements in turn.
#[derive(Debug, Serialize)]
pub struct Comparison {
    /// What was played.
    pub scenario: String,
    /// The other program.
    pub peer: Peer,
    /// Its best configuration.
    pub configuration: String,
    /// Steps of single environments per second, of all its processes together.
    pub peer_steps_per_s: f64,
    /// The same of this program.
    pub steps_per_s: f64,
    /// How many times as many.
    pub ratio: f64,
}

/// The processes of a peer, ready to step.
struct Running(Vec<Process>);

impl Running {
    fn start(found: &Found, scenario: &str) -> Result<Running, PeerError> {
        let name = found.peer.name();
        let start = |index: usize| {
            Process::start(found.peer, &found.python, &["measure", &name, scenario, &index.to_string()])
        };
        let mut processes = (0..found.description.processes).map(start).collect::<Result<Vec<_>, _>>()?;
        for process in &mut processes {
            match process.reply()? {
                Reply::Ready { ready: true } => {}
                _ => return Err(found.failed("expected that it is ready".to_owned())),
            }
        }
        Ok(Running(processes))
    }

    /// Steps per second of all processes together, which step at the same time.
    fn measure(&mut self, configuration: usize, time: Duration) -> Result<f64, PeerError> {
        for process in &mut self.0 {
            process.ask(&format!("{configuration} {}", time.as_secs_f64()))?;
        }
        let mut sum = 0.0;
        for process in &mut self.0 {
            match process.reply()? {
                Reply::Rate { steps_per_s } => sum += steps_per_s,
                _ => return Err(process.failed("expected steps per second".to_owned())),
            }
        }
        Ok(sum)
    }
}

/// A process of a peer. It ends when its input ends, so when this is dropped.
struct Process {
    peer: Peer,
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Process {
    fn start(peer: Peer, python: &Path, arguments: &[&str]) -> Result<Process, PeerError> {
        let mut command = Command::new(python);
        command.args(["-c", SCRIPT]).args(arguments);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let failed = |source| PeerError::Python { python: python.to_owned(), source };
        let mut child = command.spawn().map_err(failed)?;
        let (input, output) = (child.stdin.take(), child.stdout.take().expect("it is piped"));
        Ok(Process { peer, child, input, output: BufReader::new(output) })
    }

    fn failed(&self, message: String) -> PeerError {
        PeerError::Failed { peer: self.peer, message }
    }

    fn ask(&mut self, line: &str) -> Result<(), PeerError> {
        let ended = PeerError::Ended { peer: self.peer };
        let input = self.input.as_mut().expect("it is taken only when this is dropped");
        writeln!(input, "{line}").map_err(|_| ended)
    }

    fn reply(&mut self) -> Result<Reply, PeerError> {
        let mut line = String::new();
        match self.output.read_line(&mut line) {
            Ok(1..) => {}
            _ => return Err(PeerError::Ended { peer: self.peer }),
        }
        match serde_json::from_str(&line) {
            Ok(Reply::Error { error }) => Err(self.failed(error)),
            Ok(reply) => Ok(reply),
            Err(_) => Err(self.failed(format!("unexpected answer `{}`", line.trim_end()))),
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.input = None;
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A script in place of the interpreter: `$3` and the following are the arguments of the script.
    fn interpreter(folder: &Path, name: &str, script: &str) -> PathBuf {
        let path = folder.join(name);
        std::fs::write(folder.join(format!("{name}.script")), script).unwrap();
        let sourced = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scripts/sourced");
        let _ = std::fs::remove_file(&path); // of an earlier script of this name
        std::os::unix::fs::symlink(sourced, &path).unwrap();
        path
    }

    const TWO_CONFIGURATIONS: &str = r#"
        if [ "$3" = describe ]; then
            echo '{"versions": "x 1", "scenarios": ["3m"],
                   "configurations": ["slow", "fast"], "processes": 2}' | tr -d '\n'
            exit
        fi
        echo '{"ready": true}'
        while read configuration seconds; do echo "{\"steps_per_s\": $((configuration * 40 + 10))}"; done"#;

    #[test]
    fn the_best_configuration_of_all_processes_is_compared() {
        let folder = tempfile::tempdir().unwrap();
        let missing = interpreter(folder.path(), "a", r#"echo '{"missing": "No module named x"}'"#);
        let python = interpreter(folder.path(), "b", TWO_CONFIGURATIONS);
        let found = Peer::Smax.find(&[missing, python]).unwrap();
        assert_eq!((found.versions(), found.scenarios()), ("x 1", Some(&["3m".to_owned()][..])));
        let mut ours = [500.0, 600.0, 400.0].into_iter();
        let mut here = || Ok(ours.next().unwrap());
        let result = found.compare("3m", 3, Duration::from_secs(1), &mut here).unwrap();
        assert_eq!((result.peer_steps_per_s, result.steps_per_s, result.ratio), (100.0, 500.0, 5.0));
        assert_eq!(result.configuration, "2 processes on a core each, fast per process");
    }

    #[test]
    fn what_is_missing_or_fails_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let check = |script: &str, expected: &str| {
            let python = interpreter(folder.path(), "python", script);
            let result = Peer::Smax.find(std::slice::from_ref(&python)).and_then(|found| {
                found.compare("3m", 1, Duration::from_secs(1), &mut || Ok(1.0)).map(|_| ())
            });
            let expected = expected.replace("PYTHON", &python.display().to_string());
            assert_eq!(result.unwrap_err().to_string(), expected);
        };
        check(
            r#"echo '{"missing": "No module named x"}'"#,
            "smax is not installed: No module named x (PYTHON); install it (pip install jaxmarl) or name its \
             interpreter with --python",
        );
        check(r#"echo '{"error": "ValueError: what"}'"#, "smax: ValueError: what");
        check("echo hello", "smax: unexpected answer `hello`");
        check("", "smax: its process ended without an answer");
        let ends = TWO_CONFIGURATIONS.replace("while read configuration seconds; do", "while false; do");
        check(&ends, "smax: its process ended without an answer");
        let python = folder.path().join("none");
        let error = Peer::Smax.find(&[python]).err().unwrap().to_string();
        assert!(error.ends_with("none cannot be started: No such file or directory (os error 2)"), "{error}");
    }
}
