//! A program without some of the features: it says what it lacks, and does the rest.

use std::process::{Command, Output};

use tempfile::TempDir;

fn trodden(folder: &TempDir, arguments: &[&str]) -> Output {
    let mut program = Command::new(env!("CARGO_BIN_EXE_trodden"));
    program.args(arguments).current_dir(folder.path()).output().expect("the program runs")
}

fn check_absent(feature: &str, arguments: &[&str]) {
    let folder = tempfile::tempdir().expect("creates");
    let output = trodden(&folder, arguments);
    let said = String::from_utf8(output.stderr).expect("text");
    let expected = format!("error: this program was built without the feature `{feature}`\nhelp: build it with");
    assert!(output.status.code() == Some(2) && said.starts_with(&expected), "{arguments:?}: {said}");
}

#[cfg(not(feature = "sql"))]
#[test]
fn sql_is_told_to_be_absent() {
    check_absent("sql", &["sql", "SELECT 1", "--rows", "3"]);
    check_absent("sql", &["sql"]);
}

#[cfg(not(feature = "pages"))]
#[test]
fn pages_are_told_to_be_absent() {
    check_absent("pages", &["report"]);
    check_absent("pages", &["show", "heat", "--html"]);
    check_absent("pages", &["table", "--html", "study.html"]);
    check_absent("pages", &["diff", "a", "b", "--html", "diff.html"]);
}

#[cfg(not(feature = "pages"))]
#[test]
fn runs_and_maps_need_no_pages() {
    let folder = tempfile::tempdir().expect("creates");
    let pipeline = "seed: 1\nmaps:\n  all: { homes: { count: 1 } }\n";
    std::fs::write(folder.path().join("maps.yaml"), pipeline).expect("writes");
    let output = trodden(&folder, &["run", "maps.yaml"]);
    let said = String::from_utf8(output.stderr).expect("text");
    assert!(output.status.success() && !said.contains("report"), "{said}");
    let runs = std::fs::read_dir(folder.path().join("artifacts/runs")).expect("there are runs");
    let files =
        runs.flatten().filter(|run| run.path().is_dir()).flat_map(|run| std::fs::read_dir(run.path()).expect("reads"));
    assert!(files.flatten().all(|file| file.file_name() != "report.html"));
    let output = trodden(&folder, &["run", "maps.yaml", "--json"]);
    let told = String::from_utf8(output.stdout).expect("text");
    let last: serde_json::Value = serde_json::from_str(told.lines().last().expect("a line")).expect("is JSON");
    assert!(last["report"].is_null() && last.get("report_error").is_none(), "{last}");
}
