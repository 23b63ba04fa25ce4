//! Over a Slurm of three nodes on this host, which `slurm.sh` sets up, and an S3 server.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::{Place, Said, Value, outcomes, until};
use crate::needs::Need;
use crate::remote::s3::Server;

/// A Slurm of its own.
struct Slurm {
    folder: tempfile::TempDir,
}

impl Slurm {
    /// Starts one; says that a test is skipped where that cannot be.
    fn start() -> Option<Self> {
        let slurm = Self { folder: tempfile::tempdir().expect("creates") };
        let output = slurm.script(&["up"]);
        if output.code != Some(0) {
            Need::Slurm.missing(output.err.trim());
            return None;
        }
        Some(slurm)
    }

    fn script(&self, words: &[&str]) -> Said {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/slurm.sh");
        let mut command = Command::new(script);
        command.args(words).env("BOX", self.folder.path().join("box")).env("MAX_ARRAY", "4").env("MIN_JOB_AGE", "300");
        Said::of(command.stdin(Stdio::null()).output().expect("starts"))
    }

    fn conf(&self) -> PathBuf {
        self.folder.path().join("box/slurm.conf")
    }

    fn out(&self, program: &str, words: &[&str]) -> String {
        let output = Command::new(program).args(words).env("SLURM_CONF", self.conf()).output().expect("starts");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        self.script(&["down"]);
    }
}

/// A home, a Slurm and an S3 server.
struct Site {
    slurm: Slurm,
    server: Server,
    home: Place,
}

impl Site {
    fn start() -> Option<Self> {
        let (slurm, server) = (Slurm::start()?, Server::start()?);
        let home = Place::empty();
        home.write("site.yaml", "partition: main\ncpus: 1\nmemory: 400\narray: 2\n");
        Some(Self { slurm, server, home })
    }

    fn command(&self, more: &[&str]) -> Command {
        let words = ["run", "tiny.yaml", "--on", "slurm", "--unit-time", "1s", "--site", "site.yaml", "--json"];
        let mut command = self.server.command(&self.home, &[&words[..], more].concat());
        command.env("SLURM_CONF", self.slurm.conf());
        command
    }

    fn events(&self, code: i32, more: &[&str]) -> Vec<Value> {
        let said = Said::of(self.command(more).output().expect("starts"));
        assert_eq!(said.code, Some(code), "{}{}", said.out, said.err);
        said.out.lines().map(|line| serde_json::from_str(line).expect("every line is JSON")).collect()
    }
}

#[test]
fn slurm_makes_what_a_local_run_makes() {
    let Some(site) = Site::start() else { return };
    let alone = Place::finished();
    let events = site.events(0, &[]);
    let last = events.last().expect("the end");
    assert_eq!(last["status"], "finished");
    assert_eq!(outcomes(&events, "ran").count(), alone.digests().len());
    assert_eq!(site.home.digests(), alone.digests());
    // Arrays are no larger than the site takes.
    let tasks = site.slurm.out("squeue", &["-h", "-r", "-t", "all", "-o", "%K"]);
    let indices: Vec<usize> = tasks.lines().filter_map(|line| line.trim().parse().ok()).collect();
    assert!(indices.len() > 2 && indices.iter().all(|index| *index < 2), "{tasks}");
    // A second run submits nothing.
    let events = site.events(0, &[]);
    assert_eq!(events.last().expect("the end")["ran"], 0);
    assert_eq!(site.slurm.out("squeue", &["-h", "-r", "-t", "all", "-o", "%K"]), tasks);
}

#[test]
fn a_node_that_is_lost_midway_costs_what_it_was_at() {
    let Some(site) = Site::start() else { return };
    let more = ["--set", "walks.episodes=40", "--set", "walks.duration=300"];
    let child = site.command(&more).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
    let running = || site.slurm.out("squeue", &["-h", "-r", "-t", "R", "-o", "%N"]);
    until("work on the first node", || running().lines().any(|node| node == "n1"));
    assert_eq!(site.slurm.script(&["kill-node", "1", "now"]).code, Some(0));
    let said = Said::of(child.wait_with_output().expect("ends"));
    assert_eq!(said.code, Some(0), "{}{}", said.out, said.err);
    assert!(said.out.contains("was lost with its node, and Slurm has it started again"), "{}", said.out);
    let alone = Place::empty();
    alone.out(&[&["run", "tiny.yaml", "-q"], &more[..]].concat());
    assert_eq!(site.home.digests(), alone.digests());
}

#[test]
fn a_worker_that_is_killed_again_and_again_is_given_up_and_its_log_is_shown() {
    let Some(site) = Site::start() else { return };
    site.home.write("site.yaml", "setup: [\"echo out of order; exit 9\"]\n");
    let said = Said::of(site.command(&[]).output().expect("starts"));
    assert_eq!(said.code, Some(1), "{}{}", said.out, said.err);
    assert!(said.err.contains("exit code 9") && said.err.contains("out of order"), "{}", said.err);
    assert_eq!(said.out.matches("submitted again").count() % 3, 0, "{}", said.out);
    // Once the site is mended the same command makes everything.
    site.home.write("site.yaml", "partition: main\n");
    assert_eq!(site.events(0, &[]).last().expect("the end")["status"], "finished");
}
