//! Commands of one's own as stages: a pipeline of another field, in shell and awk, run through the binary.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::{Place, Said};
use crate::needs::Need;

/// Twenty files of measurements are averaged one by one, the averages are gathered, and a report is made of them.
const GAUGES: &str = r#"
name: gauges
files: { days: "days/*.csv" }
stages:
  average:
    use: command
    run: [sh, average.sh, "{inputs.day}", "{output}", "{params.skip}"]
    inputs: { day: $files.days }
    params: { skip: 1 }
    output: files
  table:
    use: command
    run: [sh, -c, "for day in {inputs.all}/*; do cat $day/average.txt; done >{output}/table.txt"]
    inputs: { all: { all: average } }
    output: files
  report:
    use: command
    run: [awk, -f, report.awk, "{inputs.table}/table.txt"]
    inputs: { table: table }
    output: files
"#;
const AVERAGE: &str = "\
echo \"averages $1\"
awk -v skip=\"$3\" 'NR > skip { sum += $1; n += 1 } END { printf \"%.3f %d\\n\", sum / n, n }' \"$1\" >\"$2/average.txt\"
";
const REPORT: &str = "{ sum += $1 }
END { printf \"{\\\"days\\\": %d, \\\"mean\\\": %.3f}\\n\", NR, sum / NR >\"output/metrics.json\" }
";
const FILES: u64 = 20;
/// The files, an average of each, the table, the report.
const NODES: u64 = 2 * FILES + 2;

fn place() -> Place {
    let place = Place::empty();
    place.write("gauges.yaml", GAUGES);
    place.write("average.sh", AVERAGE);
    place.write("report.awk", REPORT);
    // Day n has 1, 2, …, n + 1, so that its average is n / 2 + 1.
    for day in 0..FILES {
        let lines: String = (1..=day + 1).map(|value| format!("{value}\n")).collect();
        place.write(&format!("days/day_{day:02}.csv"), format!("level\n{lines}"));
    }
    place
}

/// Runs the pipeline and returns how many nodes ran and were hits.
fn run(place: &Place, words: &[&str]) -> (u64, u64) {
    let words = [&["run", "gauges.yaml", "--json"], words].concat();
    let events = place.events(0, &words);
    let end = events.last().expect("ends");
    (end["ran"].as_u64().expect("a number"), end["hit"].as_u64().expect("a number"))
}

#[test]
fn commands_are_incremental() {
    let place = place();
    assert_eq!(run(&place, &[]), (NODES, 0));
    let metrics = place.path("artifacts/latest/gauges/report/metrics.json");
    let read = || serde_json::from_slice::<Value>(&std::fs::read(&metrics).expect("is there")).expect("is JSON");
    // The mean of n / 2 + 1 over n = 0, …, 19 is 9.5 / 2 + 1.
    assert_eq!(read(), serde_json::json!({ "days": 20, "mean": 5.75 }));
    assert_eq!(run(&place, &[]), (0, NODES));

    // One more value of 43 in day 2 makes its average (1 + 2 + 3 + 46) / 4 = 13, which is 11 more.
    place.write("days/day_02.csv", "level\n1\n2\n3\n46\n");
    assert_eq!(run(&place, &[]), (4, NODES - 4));
    assert_eq!(read()["mean"], 6.3);
    let why = place.out(&["why", "average/day_02"]);
    assert!(why.contains("input `day` changed: files/day_02"), "{why}");

    // A line that changes nothing of what comes out: the averages are made again, and nothing else.
    place.write("average.sh", format!("# a comment\n{AVERAGE}"));
    assert_eq!(run(&place, &[]), (FILES, NODES - FILES));
    let why = place.out(&["why", "average/day_00"]);
    assert!(why.contains("average.sh"), "{why}");
    // Without the heading the average of day 0 is that of 0 and 1.
    assert_eq!(run(&place, &["--set", "average.params.skip=0"]), (FILES + 2, FILES));
    let why = place.out(&["why", "average/day_00"]);
    assert!(why.contains("params.skip 1 → 0"), "{why}");

    assert_eq!(place.out(&["log", "average/day_07"]), "averages inputs/day.csv\n");
    let shown = place.out(&["show", "report"]);
    assert!(shown.contains("days") && shown.contains("20"), "{shown}");
    assert!(place.out(&["show", "files/day_00"]).contains("level"));
}

#[test]
fn a_command_that_fails_says_why() {
    let place = place();
    place.write("average.sh", "echo first; echo >&2; echo \"day $1 is odd\" >&2; exit 3");
    let said = place.refused(1, &["run", "gauges.yaml", "--jobs", "1"]);
    let expected = "error: `average/day_00` failed: `sh` ended with exit status: 3: day inputs/day.csv is odd\n\
                    help: `trodden log average/day_00` shows all that it printed\n";
    assert!(said.contains(expected), "{said}");
    assert_eq!(place.out(&["log", "average/day_00"]), "first\n\nday inputs/day.csv is odd\n");
    // What it printed goes when it has nothing more to say.
    place.write("average.sh", AVERAGE.replace("echo", "true"));
    assert_eq!(run(&place, &[]), (NODES - FILES, FILES));
    assert!(
        place.refused(2, &["log", "average/day_00"]).contains("nothing is on record that `average/day_00` printed")
    );
}

/// Runs one command as the only stage; returns what was said of its failure.
fn failure(place: &Place, stage: &str) -> String {
    place.write(
        "one.yaml",
        format!("files: {{ days: days/day_01.csv }}\nstages:\n  one: {{ use: command, {stage} }}\n"),
    );
    let said = place.run(&["run", "one.yaml"]);
    assert_eq!(said.code, Some(1), "{}", said.err);
    said.err
}

#[test]
fn what_a_command_leaves_is_checked() {
    let place = place();
    let check = |stage: &str, expected: &str| {
        let said = failure(&place, stage);
        assert!(said.contains(expected), "{said}");
    };
    check("run: ['true'], output: parquet", "the command ended well, but wrote no `output.parquet`");
    check("run: ['true'], output: files", "the command wrote nothing into the folder `output`");
    check("run: [sh, -c, 'echo a >{output}'], output: parquet", "is no Parquet file");
    check("run: [mkdir, '{output}/deep'], output: files", "`deep` in the folder that the command wrote is no file");
    check("run: [no-such-program], output: files", "failed to start `no-such-program`");
    check("run: [sleep, '60'], timeout: 0.2, output: files", "`sleep` was stopped after 0.2 s");
    check("run: [sh, -c, 'kill -9 $$'], output: files", "`sh` ended with signal: 9");
    // Where the one who runs it may write everywhere, it is seen; elsewhere it fails.
    let said = failure(&place, "inputs: { day: $files.days }, run: [sh, -c, 'echo 1 >>{inputs.day}'], output: files");
    assert!(said.contains("has written to its input") || said.contains("ermission denied"), "{said}");
}

#[test]
fn a_command_sees_what_it_declares() {
    let place = place();
    place.write("secret.txt", "beside");
    let said = failure(&place, "run: [cat, ./secret.csv, days], output: files");
    assert!(said.contains("No such file"), "{said}");
    // Its environment is what it names and little more.
    place.write("one.yaml", r#"
stages:
  one:
    use: command
    run: [sh, -c, "env | cut -d= -f1 | sort >{output}/names.txt; echo $ANSWER $TRODDEN_SEED {seed} >{output}/values.txt"]
    env: [ANSWER, NOT_SET]
    seed: 5
    output: files
"#);
    let mut command = place.command(&["run", "one.yaml", "-q"]);
    assert!(command.env("ANSWER", "42").env("SECRET", "1").status().expect("starts").success());
    let read = |name: &str| {
        let path = place.path("artifacts/latest/one/one").join(name);
        std::fs::read_to_string(path).expect("is there")
    };
    assert_eq!(read("values.txt"), "42 5 5\n");
    let names: String = read("names.txt");
    let names: BTreeSet<&str> = names.lines().collect();
    assert!(names.contains("PATH") && !names.contains("SECRET") && !names.contains("NOT_SET"), "{names:?}");
    // Another value is another recipe.
    let ran = |answer: &str| {
        let out = place.command(&["run", "one.yaml", "--json"]).env("ANSWER", answer).output().expect("starts").stdout;
        String::from_utf8(out).expect("is text").contains(r#""ran":1"#)
    };
    assert!(!ran("42") && ran("43"));
}

#[test]
fn a_sandbox_hides_the_rest() {
    if !Need::Bwrap.runs("bwrap", &["--unshare-all", "--ro-bind", "/", "/", "true"]) {
        return;
    }
    let place = place();
    place.write("secret.txt", "beside");
    let secret = place.path("secret.txt");
    let stage = format!("run: [cat, '{}'], output: files", secret.display());
    place.write("one.yaml", format!("stages:\n  one: {{ use: command, {stage}, sandbox: true }}\n"));
    let said = place.refused(1, &["run", "one.yaml"]);
    assert!(said.contains("No such file"), "{said}");
    // What is declared is there, and what comes out is the same.
    let open = run(&place, &[]);
    assert_eq!(open, (NODES, 0));
    let digest = || place.out(&["ls", "--json"]).lines().last().expect("a node").to_owned();
    let before = digest();
    let shut = GAUGES.replace("    output: files", "    output: files\n    sandbox: { network: false }");
    place.write("gauges.yaml", shut);
    // How it is shut in is no part of the recipe.
    assert_eq!(run(&place, &[]), (0, NODES));
    std::fs::remove_dir_all(place.path("artifacts")).expect("removes");
    assert_eq!(run(&place, &[]), (NODES, 0));
    let of = |line: &str| serde_json::from_str::<Value>(line).expect("is JSON")["artifact"].clone();
    assert_eq!(of(&before), of(&digest()));
}

/// Starts a run whose commands wait, and returns it once the first one does.
fn waiting(place: &Place) -> Child {
    place.write("average.sh", format!("[ -e \"$GO\" ] || {{ echo $$ >\"$HERE/$$\"; sleep 600 & wait; }}\n{AVERAGE}"));
    let gauges = GAUGES.replace("params: { skip: 1 }", "params: { skip: 1 }\n    env: [HERE, GO]");
    place.write("gauges.yaml", gauges);
    std::fs::create_dir(place.path("here")).expect("creates");
    let mut command = command(place, &["run", "gauges.yaml", "-q", "--jobs", "2"]);
    let child = command.spawn().expect("starts");
    wait_until(|| std::fs::read_dir(place.path("here")).expect("lists").count() == 2);
    child
}

fn command(place: &Place, words: &[&str]) -> Command {
    let mut command = place.command(words);
    command.env("HERE", place.path("here")).env("GO", place.path("go"));
    command
}

fn wait_until(mut done: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !done() {
        assert!(begun.elapsed() < Duration::from_secs(60), "it takes too long");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// The commands that have told their ids and live.
fn living(place: &Place) -> Vec<String> {
    let ids = std::fs::read_dir(place.path("here")).expect("lists").map(|entry| entry.expect("is one").file_name());
    let lives = |id: &String| {
        let stat = std::fs::read_to_string(format!("/proc/{id}/stat"));
        stat.is_ok_and(|stat| !stat.contains(") Z "))
    };
    ids.map(|id| id.to_string_lossy().into_owned()).filter(lives).collect()
}

#[test]
fn a_run_that_is_stopped_takes_its_commands_along_and_goes_on_later() {
    for signal in ["INT", "KILL"] {
        let place = place();
        let mut child = waiting(&place);
        assert_eq!(living(&place).len(), 2);
        let killed = Command::new("kill").args(["-s", signal, &child.id().to_string()]).status().expect("starts");
        assert!(killed.success());
        let ended = child.wait().expect("ends");
        assert_eq!(ended.code(), if signal == "INT" { Some(130) } else { None });
        wait_until(|| living(&place).is_empty());
        place.write("go", "");
        let said = Said::of(command(&place, &["run", "gauges.yaml", "--json"]).output().expect("starts"));
        assert_eq!(said.code, Some(0), "{}", said.err);
        // The files had been read before; two averages were lost with the work in flight.
        assert!(said.out.contains(&format!(r#""ran":{},"hit":{FILES}"#, NODES - FILES)), "{}", said.out);
    }
}

#[test]
fn what_a_command_makes_feeds_stages_of_ours() {
    let place = Place::finished();
    let tiny = std::fs::read_to_string(place.path("tiny.yaml")).expect("is there");
    let own = tiny.replace(
        "  scores: { use: score, heat: heat,",
        "  mine: { use: command, run: [cp, '{inputs.heat}', '{output}'], inputs: { heat: heat }, output: { as: parquet, kind: Heat } }\n  scores: { use: score, heat: mine,",
    );
    place.write("tiny.yaml", &own);
    let events = place.events(0, &["run", "tiny.yaml", "--json"]);
    let ran: Vec<&str> =
        events.iter().filter(|event| event["outcome"] == "ran").filter_map(|event| event["node"].as_str()).collect();
    // The copy has the same bytes, so that its score is a hit.
    assert_eq!(ran, ["mine/home_1000"]);
    assert!(place.out(&["show", "mine/home_1000"]).contains("heat"));
    // What is no heat is none.
    place.write("tiny.yaml", own.replace("inputs: { heat: heat }", "inputs: { heat: visits.test }"));
    let said = place.refused(1, &["run", "tiny.yaml"]);
    assert!(said.contains("what the command wrote is no `Heat`"), "{said}");
}

#[test]
fn an_audit_finds_commands_that_are_not_deterministic() {
    let place = place();
    place.write(
        "one.yaml",
        "stages:
  odd: { use: command, run: [sh, -c, 'cat /proc/sys/kernel/random/uuid >{output}/a'], output: files }
  even: { use: command, run: [sh, -c, 'echo same >{output}/a'], output: files }
",
    );
    place.out(&["run", "one.yaml", "-q"]);
    let uuid = || std::fs::read(place.path("artifacts/latest/one/odd/a")).expect("is there");
    let before = uuid();
    let said = place.run(&["run", "one.yaml", "--check", "*"]);
    assert_eq!(said.code, Some(1), "{}{}", said.out, said.err);
    assert!(said.err.contains("odd") && !said.err.contains("`even`"), "{}", said.err);
    // It was made beside, and nothing took the place of what is on record.
    assert_eq!(uuid(), before);
    place.out(&["run", "one.yaml", "--check", "even"]);
}

#[test]
fn what_is_wrong_with_a_command_is_said_before_it_runs() {
    let place = place();
    let check = |stage: &str, expected: &[&str]| {
        place.write(
            "one.yaml",
            format!("files: {{ days: days/day_01.csv }}\nstages:\n  one: {{ use: command, {stage} }}\n"),
        );
        let said = place.refused(2, &["check", "one.yaml"]);
        for text in expected {
            assert!(said.contains(text), "{said}");
        }
    };
    check("run: python fit.py, output: files", &["`run` is a list of the program and its arguments", "sh, -c"]);
    check("run: [], output: files", &["`run` names no program"]);
    check(
        "run: [cat, '{inputs.dya}'], inputs: { day: $files }, output: files",
        &["there is no input `dya`", "did you mean `day`?"],
    );
    check("run: [cat], deps: ['lib/*.py'], output: files", &["no file matches"]);
    check("run: [cat], deps: [../lib.py], output: files", &["does not lie below the folder of `deps`", "`folder`"]);
    check("run: [cat], output: csv", &["output"]);
    check("run: [cat], output: { as: parquet, columns: { a: number } }", &["`number`, the type of `a`, is not known"]);
    check("run: [cat], output: { as: files, kind: Heat }", &["`Heat` is made as `parquet`"]);
    check("run: [cat], inputs: { day: { every: $files } }, output: files", &["an input has no key `every`"]);
    check("run: [cat], timeout: -1, output: files", &["`timeout` is -1: it must be above 0"]);
    check("run: [cat], seed: 3, output: files", &["`command` draws no random numbers, so it takes no `seed`"]);
    check("run: [cat, '{seed}'], params: 3, output: files", &["params"]);
    check("run: [cat], inputs: { day: $fils }, output: files", &["`$fils` is not known"]);
    assert!(Path::new(&place.path("artifacts")).metadata().is_err());
}
