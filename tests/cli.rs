//! The command as a user meets it: what each subcommand prints, what it says of bad input, and its exit codes.
//!
//! One small pipeline is run once for all tests; a test that needs its store gets a copy. Ids, times, digests and sizes are
//! pinned by filters. The snapshots lie in `cli/snapshots`.

mod answers;
mod commands;
mod contents;
mod exports;
mod habits;
mod live;
mod maps;
mod own_stages;
mod plan_path;
mod requests;
mod runs;
mod shows;
mod stores;
mod streams;
mod tracks;

use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use tempfile::TempDir;

/// Two homes to learn from and one to predict, a few short walks, windows of 16 cells, one epoch.
pub const PIPELINE: &str = "\
seed: 7
crowd: &crowd { agents: [2, 4], radius: 0.2, duration: 8 }
maps:
  train: { homes: { count: 2, area: [50, 60] } }
  test: { homes: { count: 1, first: 1000, area: [50, 60] } }
stages:
  walks: { use: simulate, map: $maps, episodes: 12, <<: *crowd }
  visits: { use: rasterize, map: $maps, walks: walks }
  labels: { use: quantize, map: $maps, visits: visits, classes: 3 }
  tiles: { use: tile, map: $maps.train, labels: labels.train, size: 16, stride: 12, min_labeled: 40 }
  model: { use: train, tiles: tiles, epochs: 1 }
  heat: { use: annotate, map: $maps.test, model: model, stride: 8 }
  scores: { use: score, heat: heat, labels: labels.test, visits: visits.test }
  trips: { use: navigate, map: $maps.test, episodes: 3, <<: *crowd, agents: [5, 6] }
  costs: { use: cost, trips: trips, heat: heat }
";
/// Maps, walks and visits with a chunk each, labels, tiles, an epoch and the model, heat, scores, trips, costs.
const NODES: u64 = 3 + 3 * 2 + 3 * 2 + 3 + 1 + 2 + 1 + 1 + 1 + 1;

/// A folder to run commands in, with `tiny.yaml` in it.
pub struct Place {
    folder: TempDir,
}

/// What a command said.
pub struct Said {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

/// A finished run of the pipeline, and what it said.
struct Finished {
    place: Place,
    said: Said,
}

fn finished() -> &'static Finished {
    static FINISHED: OnceLock<Finished> = OnceLock::new();
    FINISHED.get_or_init(|| {
        let place = Place::empty();
        let said = place.run(&["run", "tiny.yaml", "--jobs", "1"]);
        assert_eq!(said.code, Some(0), "{}", said.err);
        Finished { place, said }
    })
}

impl Place {
    pub fn empty() -> Self {
        let place = Self { folder: tempfile::tempdir().expect("creates") };
        place.write("tiny.yaml", PIPELINE);
        place
    }

    /// A place whose store has one finished run.
    pub fn finished() -> Self {
        let place = Self::empty();
        copy(&finished().place.path("artifacts"), &place.path("artifacts"));
        place
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().expect("has a folder")).expect("creates");
        std::fs::write(path, content).expect("writes");
    }

    pub fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_trodden"));
        command.args(words).current_dir(self.folder.path());
        for name in [
            "NO_COLOR",
            "CLICOLOR_FORCE",
            "TERM",
            "COLUMNS",
            "RAYON_NUM_THREADS",
            "TRODDEN_STORE",
            "TRODDEN_JOBS",
            "TRODDEN_LOG",
            "TRODDEN_REMOTE",
        ] {
            command.env_remove(name);
        }
        heed_signals(&mut command);
        command
    }

    pub fn run(&self, words: &[&str]) -> Said {
        Said::of(self.command(words).output().expect("starts"))
    }

    /// Runs a command that is to succeed; returns stdout.
    pub fn out(&self, words: &[&str]) -> String {
        let said = self.run(words);
        assert_eq!(said.code, Some(0), "{words:?}: {}{}", said.out, said.err);
        said.out
    }

    /// Returns the digests of the newest run by node.
    pub fn digests(&self) -> Vec<(String, String)> {
        let text = self.out(&["ls", "--all", "--json"]);
        let nodes = text.lines().map(|line| serde_json::from_str(line).expect("every line is JSON"));
        nodes
            .map(|node: serde_json::Value| (node["node"].to_string(), node["artifact"]["digest"].to_string()))
            .collect()
    }

    /// Runs a command that is to fail in a way; returns stderr.
    pub fn refused(&self, code: i32, words: &[&str]) -> String {
        let said = self.run(words);
        assert_eq!(said.code, Some(code), "{words:?}: {}{}", said.out, said.err);
        assert!(!said.err.contains("panicked"), "{}", said.err);
        said.err
    }

    /// Runs a pipeline with `--json`; returns what it printed, line by line.
    pub fn events(&self, code: i32, words: &[&str]) -> Vec<serde_json::Value> {
        let said = self.run(words);
        assert_eq!(said.code, Some(code), "{words:?}: {}{}", said.out, said.err);
        said.out.lines().map(|line| serde_json::from_str(line).expect("every line is JSON")).collect()
    }
}

impl Said {
    pub fn of(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("is text");
        Self { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
    }
}

/// Lets a command hear signals that the tests themselves were started to ignore, as by `nohup` or in the background of a script.
fn heed_signals(command: &mut Command) {
    let heed = || {
        for signal in [libc::SIGHUP, libc::SIGINT, libc::SIGTERM] {
            // SAFETY: setting the default action of a signal touches no memory of ours.
            unsafe { libc::signal(signal, libc::SIG_DFL) };
        }
        Ok(())
    };
    // SAFETY: between fork and exec only async-signal-safe functions may be called, and `signal` is one.
    unsafe { command.pre_exec(heed) };
}

/// Copies a folder; links stay links.
pub fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("creates");
    for entry in std::fs::read_dir(from).expect("lists") {
        let entry = entry.expect("lists");
        let (kind, to) = (entry.file_type().expect("has a type"), to.join(entry.file_name()));
        if kind.is_dir() {
            copy(&entry.path(), &to);
        } else if kind.is_symlink() {
            let target = std::fs::read_link(entry.path()).expect("reads");
            std::os::unix::fs::symlink(target, to).expect("links");
        } else {
            std::fs::copy(entry.path(), to).expect("copies");
        }
    }
}

/// Compares a text with `cli/snapshots/<name>.snap`; ids, times, digests and sizes are pinned.
fn check(name: &str, text: &str) {
    check_without(name, text, &[]);
}

/// Compares with more filters: for what depends on the instruction set.
fn check_without(name: &str, text: &str, filters: &[(&str, &str)]) {
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path("cli/snapshots");
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    for (pattern, stand_in) in filters {
        settings.add_filter(pattern, *stand_in);
    }
    settings.add_filter(r"\d{8}-\d{6}-[0-9a-f]{6}", "20260314-101530-abcdef");
    settings.add_filter(r"took \d[\d., ]* times", "took N times");
    settings.add_filter(r"\b[0-9a-f]{64}\b", "<digest>");
    settings.add_filter(r"\b[0-9a-f]{12}\b", "0123456789ab");
    settings.add_filter(r" *\b\d+(\.\d+)? ([KMG]i)?B\b", " <size>");
    settings.add_filter(r"( *\b\d+ min)? *\b\d+(\.\d+)? (ms|s)\b", " <time>");
    // The widths of columns hang on the widest size and time.
    settings.add_filter(r"(?m) +time( +asked for)?$", "  time");
    settings.add_filter(" +size  digest", "  size  digest");
    settings.add_filter("skipped +-  -", "skipped  -  -");
    settings.bind(|| insta::assert_snapshot!(name, text.trim_end()));
}

/// The letters of a drawing that hangs on the crowd or on what was learned.
const DRAWING: (&str, &str) = (r"(?m)^([ .:=+*%@#\d-]*\n)+", "(drawing)\n");
/// What hangs on the crowd, or on the instruction set: every number, and the width of its column.
const NUMBERS: &[(&str, &str)] =
    &[(r"[-−]?\b\d+(\.\d+)?(e-?\d+)?\b", "N"), ("─+", "──"), (r"(?m)(\S)  +", "$1  "), (r"(?m)^ {3,}", "  ")];
