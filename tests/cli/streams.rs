//! What reaches stdout and stderr: all of it or an error, no orders to a terminal, warnings however quiet; and signals.

use std::fs::File;
use std::io::Write;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use super::{Place, Said};
use crate::needs::Need;

/// A title for the window and a red name, and a line end.
const ODD: &str = "a\u{1b}]0;owned\u{7}\u{1b}[31m\nb";

#[test]
fn a_full_stdout_is_an_error() {
    let place = Place::finished();
    let commands = [
        "ls --all",
        "--json ls --all",
        "schema",
        "completions bash",
        "--help",
        "run --help",
        "--version",
        "status",
        "verify",
        "sql SELECT*FROM'labels/home_00'",
        "--json sql SELECT*FROM'labels/home_00'",
        "run tiny.yaml --json",
        "show labels/home_00",
        "check tiny.yaml",
        "plan tiny.yaml",
        "why labels",
    ];
    for words in commands {
        let words: Vec<&str> = words.split(' ').collect();
        let full = File::options().write(true).open("/dev/full").expect("opens");
        let said = Said::of(place.command(&words).stdout(full).stderr(Stdio::piped()).output().expect("starts"));
        assert_eq!(said.code, Some(1), "{words:?}: {}", said.err);
        assert!(said.err.contains("failed to write to stdout: No space left on device"), "{words:?}: {}", said.err);
    }
}

#[test]
fn a_stdout_that_fills_up_on_the_way_is_an_error() {
    let place = Place::finished();
    let Some(said) = super::stores::in_namespace_with(
        &place,
        "mkdir small && mount -t tmpfs -o size=4k tmpfs small",
        "--json sql \"SELECT * FROM 'walks/home_00'\" > small/out",
    ) else {
        return;
    };
    assert_eq!(said.code, Some(1), "{}", said.err);
    assert!(said.err.contains("failed to write to stdout"), "{}", said.err);
}

/// A store whose newest run has a node and a warning that would give orders.
fn odd() -> Place {
    let place = Place::finished();
    let runs = std::fs::read_dir(place.path("artifacts/runs")).expect("lists");
    let folder = runs.map(|entry| entry.expect("lists").path()).find(|path| path.is_dir()).expect("has a run");
    let file = folder.join("run.json");
    let text = std::fs::read_to_string(&file).expect("reads");
    let odd = serde_json::to_string(ODD).expect("is JSON");
    let text = text.replace("\"labels/home_00\"", &odd).replace("\"warnings\":[]", &format!("\"warnings\":[{odd}]"));
    let text = text.replace("\"warnings\": []", &format!("\"warnings\": [{odd}]"));
    // As the first format had it: without a checksum, which would not be that of the new text.
    let (body, _) = text.split_once(",\n  \"checksum\"").expect("is sealed");
    let text = body.replacen("\"format\":2,", "", 1) + "\n}\n";
    std::fs::remove_file(&file).expect("removes");
    std::fs::write(&file, text).expect("writes");
    place
}

#[test]
fn names_give_no_orders_to_a_terminal() {
    let place = odd();
    let commands: [&[&str]; 7] = [
        &["ls"],
        &["ls", "--json"],
        &["status"],
        &["show", ODD],
        &["show", ODD, "--json"],
        &["show", "a\u{9b}31m"],
        &["sql", "SELECT 1 AS \"a\u{1b}[31m\", '\u{9b}31m' AS b FROM 'labels/home_01' LIMIT 1"],
    ];
    let mut seen = 0;
    for words in commands {
        let said = place.run(words);
        for text in [&said.out, &said.err] {
            let raw = |c: char| c.is_control() && c != '\n';
            assert!(!text.contains(raw), "{words:?}: {text:?}");
            seen += text.matches("\\u{1b}").count() + text.matches("\\u001b").count();
        }
    }
    assert!(seen >= 8, "they were shown {seen} times");
    assert!(
        place.run(&["ls"]).out.lines().any(|line| line.starts_with("a\\u{1b}]0;owned") && line.contains("\\u{a}b"))
    );
}

#[test]
fn quiet_runs_still_warn() {
    let place = Place::finished();
    std::fs::remove_dir_all(place.path("artifacts/latest/tiny")).expect("removes");
    place.write("artifacts/latest/tiny", "mine");
    let said = place.run(&["run", "tiny.yaml", "--quiet"]);
    assert_eq!((said.code, said.out.as_str()), (Some(0), ""));
    assert!(said.err.starts_with("warning: ") && said.err.contains("artifacts/latest/tiny"), "{}", said.err);
    assert_eq!(said.err.lines().count(), 1, "{}", said.err);
}

#[test]
fn the_last_line_of_json_says_where_the_report_is() {
    let place = Place::finished();
    let last = place.events(0, &["run", "tiny.yaml", "--json"]).pop().expect("has lines");
    let path = last["report"].as_str().expect("is told").to_owned();
    assert!(place.path(&path).is_file() && path.ends_with("report.html"), "{path}");
}

/// Sends a signal to a process.
fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args([name, &child.id().to_string()]).status().expect("starts");
    assert!(sent.success());
}

/// Waits for a process to end; kills it if it does not in time.
fn ended(mut child: Child) -> Output {
    let begun = Instant::now();
    while child.try_wait().expect("waits").is_none() {
        if begun.elapsed() > Duration::from_secs(60) {
            child.kill().expect("kills");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.wait_with_output().expect("ends")
}

#[test]
fn a_hang_up_that_is_ignored_stays_ignored() {
    let place = Place::empty();
    let script = format!("trap '' HUP; exec '{}' run tiny.yaml --quiet", env!("CARGO_BIN_EXE_trodden"));
    let run = |script: &str, name: &str| {
        let mut command = Command::new("sh");
        command.args(["-c", script]).current_dir(place.path("")).stderr(Stdio::piped());
        super::heed_signals(&mut command);
        let child = command.spawn().expect("starts");
        // Once the store is there the handlers are, too.
        while !place.path("artifacts/store.json").exists() {
            std::thread::sleep(Duration::from_millis(1));
        }
        signal(&child, name);
        ended(child)
    };
    let output = run(&script, "-HUP");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    std::fs::remove_dir_all(place.path("artifacts")).expect("removes");
    let output = run(&script.replace("trap '' HUP; ", ""), "-HUP");
    assert_eq!(output.status.code(), Some(130), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn ctrl_c_is_heard_while_sources_are_read() {
    let place = Place::empty();
    place.write(
        "map.yaml",
        "image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n",
    );
    let mut image = File::create(place.path("map.pgm")).expect("creates");
    image.write_all(b"P5 8 8 255\n").expect("writes");
    // A hole of 64 GiB: nothing to write, half a minute to read.
    image.set_len(64 << 30).expect("grows");
    place.write(
        "big.yaml",
        "seed: 1\nmaps: { all: { files: map.yaml } }\nstages: { walks: { use: simulate, map: $maps, episodes: 1 } }\n",
    );
    let mut command = place.command(&["run", "big.yaml"]);
    let child = command.stderr(Stdio::piped()).spawn().expect("starts");
    while !place.path("artifacts/temp").exists() {
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(Duration::from_millis(300));
    let begun = Instant::now();
    signal(&child, "-INT");
    let output = ended(child);
    assert_eq!((output.status.code(), output.status.signal()), (Some(130), None));
    assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
}

#[test]
fn faults_at_single_calls_break_no_promise() {
    let folder = tempfile::tempdir().expect("creates");
    let mut bash = Command::new("bash");
    bash.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/faults.sh")).arg(env!("CARGO_BIN_EXE_trodden"));
    let said = Said::of(bash.arg(folder.path()).arg("90").output().expect("starts"));
    if said.code == Some(77) {
        Need::Cc.missing(&said.out);
        return;
    }
    assert_eq!(said.code, Some(0), "{}{}", said.out, said.err);
    assert!(said.out.contains(" 0 broken promises"), "{}", said.out);
}
