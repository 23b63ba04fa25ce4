//! Fuzzing that runs wherever the tests run: every parser of foreign bytes gets good inputs with random changes, and may
//! refuse them, but neither panic nor hang nor take more than 2 GiB.
//!
//! Cases are numbered, and a case's input depends on the target's name and that number alone. The tests try the first
//! thousand of each target. A campaign is the same with more of them, on all processors:
//!
//! ```sh
//! TRODDEN_FUZZ_CASES=1000000 TRODDEN_FUZZ_TARGET=png cargo test --release --test main fuzz::
//! ```
//!
//! `TRODDEN_FUZZ_FIRST` begins at another case, so one can be tried again by itself. Cases run in processes of their own,
//! each on one thread with a guard beside it; the input of one that fails is kept in the folder that the message names.

mod images;
pub mod memory;
mod mutate;
mod recordings;
mod tables;
mod texts;

use std::cell::RefCell;
use std::fs::{self, File};
use std::io::Write;
use std::os::unix::fs::FileExt;
use std::os::unix::process::ExitStatusExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use mutate::Dice;

/// Cases of each target that the tests try.
const CASES: u64 = 1000;
/// Processor time that one case may take.
const LONGEST: Duration = Duration::from_secs(20);
/// Failures after which a campaign gives up.
const MOST_FAILURES: usize = 20;
/// Tells a process of this binary what to run: `TARGET FIRST CASES FILE`.
const CHILD: &str = "TRODDEN_FUZZ_CHILD";

/// Makes an input of good ones.
type Mutate = dyn Fn(&mut Dice, &[Vec<u8>]) -> Vec<u8>;
/// Parses an input and uses what comes out; returns whether it was accepted.
type Parse = dyn FnMut(&[u8]) -> bool;

/// A parser, and how to feed it.
struct Target {
    name: &'static str,
    /// Good inputs.
    seeds: Vec<Vec<u8>>,
    mutate: Box<Mutate>,
    run: Box<Parse>,
}

impl Target {
    fn new(
        name: &'static str,
        seeds: Vec<Vec<u8>>,
        mutate: impl Fn(&mut Dice, &[Vec<u8>]) -> Vec<u8> + 'static,
        run: impl FnMut(&[u8]) -> bool + 'static,
    ) -> Self {
        Self { name, seeds, mutate: Box::new(mutate), run: Box::new(run) }
    }

    fn named(name: &str) -> Self {
        let found = texts::target(name).or_else(|| images::target(name)).or_else(|| tables::target(name));
        let found = found.or_else(|| recordings::target(name)).or_else(|| broken(name));
        found.unwrap_or_else(|| panic!("there is no target `{name}`"))
    }

    /// Returns the input of a case; of the first ones it is a seed as it is.
    fn input(&self, case: u64) -> Vec<u8> {
        let seed = usize::try_from(case).ok().and_then(|case| self.seeds.get(case));
        seed.cloned().unwrap_or_else(|| (self.mutate)(&mut Dice::new(self.name, case), &self.seeds))
    }
}

thread_local! {
    /// Where and why the thread panicked last.
    static PANIC: RefCell<String> = const { RefCell::new(String::new()) };
}

/// The case that runs, for the guard.
static CASE: AtomicU64 = AtomicU64::new(0);

/// Runs the cases of a child process: notes each in a file first, and stops at the first that fails.
#[test]
fn child() {
    let Ok(task) = std::env::var(CHILD) else { return };
    let words: Vec<&str> = task.splitn(4, ' ').collect();
    let number = |word: &str| word.parse::<u64>().expect("a number");
    let (first, cases) = (number(words[1]), number(words[2]));
    let note = File::create(words[3]).expect("creates");
    let mut target = Target::named(words[0]);
    std::panic::set_hook(Box::new(|info| {
        let place = info.location().map(ToString::to_string).unwrap_or_default();
        let message = info.payload_as_str().unwrap_or("a payload that is no text");
        PANIC.with_borrow_mut(|panic| *panic = format!("{message} ({place})"));
    }));
    std::thread::spawn(guard);
    memory::limit();
    for case in first..first + cases {
        note.write_at(&case.to_le_bytes(), 0).expect("notes");
        let input = target.input(case);
        memory::start();
        CASE.store(case, Ordering::Relaxed);
        let Ok(accepted) = catch_unwind(AssertUnwindSafe(|| (target.run)(&input))) else {
            PANIC.with_borrow(|panic| eprintln!("panicked: {panic}"));
            std::process::exit(3);
        };
        if !accepted && case < target.seeds.len() as u64 {
            eprintln!("refused: a good input, from which the others are made");
            std::process::exit(5);
        }
    }
}

/// Ends the process when a case takes too much processor time: other programs may slow it down, that is no hang.
fn guard() {
    let (mut case, mut since) = (u64::MAX, processor_time());
    loop {
        std::thread::sleep(Duration::from_millis(200));
        let (now, spent) = (CASE.load(Ordering::Relaxed), processor_time());
        if now != case {
            (case, since) = (now, spent);
        } else if spent.saturating_sub(since) > LONGEST {
            eprintln!("hung: {LONGEST:?} of processor time were not enough");
            std::process::exit(4);
        }
    }
}

/// Returns the processor time of this process; a process that sleeps for ever spends none and is seen by its parent.
fn processor_time() -> Duration {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // utime and stime, in hundredths of a second, are fields 14 and 15; the name before them may hold spaces.
    let fields = stat.rsplit_once(") ").map_or("", |(_, rest)| rest);
    let ticks: u64 = fields.split(' ').skip(11).take(2).filter_map(|field| field.parse::<u64>().ok()).sum();
    Duration::from_millis(10 * ticks)
}

/// Runs some cases in a process; returns the one that failed, and how.
fn spawn(target: &str, first: u64, cases: u64, folder: &Path) -> Option<(u64, String)> {
    let note = folder.join(format!("{target}-{first}"));
    let mut child = Command::new(std::env::current_exe().expect("the tests have a file"))
        .args(["fuzz::child", "--exact", "--nocapture"])
        .env(CHILD, format!("{target} {first} {cases} {}", note.display()))
        .env("RAYON_NUM_THREADS", "1")
        .env("RUST_BACKTRACE", "0")
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("starts");
    // What a child has to say fits into a pipe.
    let mut seen = (Vec::new(), Instant::now());
    let status = loop {
        if let Some(status) = child.try_wait().expect("waits") {
            break status;
        }
        std::thread::sleep(Duration::from_millis(20));
        let now = fs::read(&note).unwrap_or_default();
        if now != seen.0 {
            seen = (now, Instant::now());
        } else if seen.1.elapsed() > 30 * LONGEST {
            child.kill().expect("kills");
        }
    };
    let case = fs::read(&note).ok().and_then(|bytes| Some(u64::from_le_bytes(bytes.try_into().ok()?)));
    drop(fs::remove_file(&note));
    if status.success() {
        return None;
    }
    let mut said = String::new();
    std::io::Read::read_to_string(&mut child.stderr.take().expect("piped"), &mut said).expect("reads");
    let tail: Vec<&str> = said.lines().rev().take(3).collect();
    let how = status.signal().map_or_else(String::new, |signal| format!("signal {signal}: "));
    Some((case.unwrap_or(first), how + &tail.into_iter().rev().collect::<Vec<_>>().join(" / ")))
}

/// Runs the cases of a target in as many processes as there are processors, and goes on behind those that fail.
fn campaign(name: &str, first: u64, cases: u64) -> Vec<(u64, String)> {
    let folder = tempfile::tempdir().expect("creates");
    let workers = if cases <= CASES { 1 } else { std::thread::available_parallelism().map_or(1, usize::from) as u64 };
    let failures = std::sync::Mutex::new(Vec::new());
    let work = |worker: u64| {
        let (mut at, end) = (first + cases * worker / workers, first + cases * (worker + 1) / workers);
        while at < end && failures.lock().expect("no panic").len() < MOST_FAILURES {
            // A process now and then gives back what a library may keep for good.
            let count = (end - at).min(100_000);
            match spawn(name, at, count, folder.path()) {
                None => at += count,
                Some((case, how)) => {
                    failures.lock().expect("no panic").push((case, how));
                    at = case + 1;
                }
            }
        }
    };
    std::thread::scope(|scope| (0..workers).for_each(|worker| drop(scope.spawn(move || work(worker)))));
    let mut failures = failures.into_inner().expect("no panic");
    failures.sort();
    failures
}

/// Tries a target, and reports each case that fails with its input.
fn check(name: &str) {
    if std::env::var("TRODDEN_FUZZ_TARGET").is_ok_and(|wanted| wanted != name) {
        return;
    }
    let number = |variable: &str, default| {
        std::env::var(variable)
            .map_or(default, |text| text.parse().unwrap_or_else(|_| panic!("{variable} is a number")))
    };
    let (first, cases) = (number("TRODDEN_FUZZ_FIRST", 0), number("TRODDEN_FUZZ_CASES", CASES));
    let started = Instant::now();
    let failures = campaign(name, first, cases);
    println!("{name}: {cases} cases in {:.1} s", started.elapsed().as_secs_f64());
    let mut report = String::new();
    for (case, how) in &failures {
        let path = keep(name, *case);
        report.push_str(&format!("case {case}: {how}\n  its input is {}\n", path.display()));
    }
    assert!(failures.is_empty(), "{name}: {} cases failed\n{report}", failures.len());
}

fn keep(name: &str, case: u64) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fuzz");
    fs::create_dir_all(&folder).expect("creates");
    let path = folder.join(format!("{name}-{case}"));
    File::create(&path).and_then(|mut file| file.write_all(&Target::named(name).input(case))).expect("writes");
    path
}

macro_rules! targets {
    ($($test:ident $name:literal),* $(,)?) => {
        $(#[test]
        fn $test() {
            check($name);
        })*
    };
}

targets! {
    map_yaml "map-yaml",
    building "building",
    wkt "wkt",
    dxf "dxf",
    svg "svg",
    geojson "geojson",
    tracks_table "tracks-table",
    tracks_vadere "tracks-vadere",
    tracks_trajnet "tracks-trajnet",
    tracks_jupedsim "tracks-jupedsim",
    tracks_mcap "tracks-mcap",
    tracks_parquet "tracks-parquet",
    pgm "pgm",
    png "png",
    jpeg "jpeg",
    pipeline "pipeline",
    recipe "recipe",
    run "run",
    occupancy_map "OccupancyMap",
    trajectories "Trajectories",
    visit_counts "VisitCounts",
    labels "Labels",
    tiles "Tiles",
    heat "Heat",
    nav_episodes "NavEpisodes",
    class_scores "ClassScores",
    social_costs "SocialCosts",
    path_trials "PathTrials",
    tables "table",
    checkpoint "checkpoint",
}

/// Targets in which a case of ten fails in one way.
fn broken(name: &str) -> Option<Target> {
    fn deep(levels: u64) -> u64 {
        if levels == 0 { 0 } else { std::hint::black_box(deep(levels - 1) + 1) }
    }
    let fail: fn() = match name {
        "test-none" => || {},
        "test-panic" => || panic!("as it should"),
        "test-memory" => || drop(std::hint::black_box(vec![1u8; 3 << 30])),
        "test-stack" => || assert!(deep(1 << 40) > 0),
        _ => return None,
    };
    let mut cases = 0;
    Some(Target::new(
        "test",
        vec![Vec::new()],
        |_, _| Vec::new(),
        move |_| {
            cases += 1;
            if cases == 7 {
                fail();
            }
            true
        },
    ))
}

/// The limits hold: a case that takes too much memory, panics or overflows its stack is found and named.
#[test]
fn what_fails_is_found() {
    let folder = tempfile::tempdir().expect("creates");
    let check = |target: &str, how: &str| {
        let (found, said) = spawn(target, 100, 10, folder.path()).expect("it fails");
        assert!(found == 106 && said.contains(how), "{target}: case {found}: {said}");
    };
    check("test-panic", "panicked: as it should");
    check("test-memory", "signal 6: memory allocation of 3221225472 bytes failed");
    check("test-stack", "signal 6");
    assert!(spawn("test-none", 0, 10, folder.path()).is_none());
}
