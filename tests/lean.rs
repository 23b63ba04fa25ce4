//! What is built for what: crates that only a feature needs, and one build of the rest for programs and tests.

use std::collections::BTreeSet;
use std::process::Command;

/// Returns the crates of a build with their versions and features, the crates of tests besides if `edges` has `dev`.
fn crates(edges: &str, options: &[&str]) -> BTreeSet<String> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["tree", "--locked", "--offline", "--prefix", "none", "--format", "{p} [{f}]", "--edges", edges]);
    let output = cargo.args(options).current_dir(env!("CARGO_MANIFEST_DIR")).output().expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("text");
    text.lines().map(|line| line.trim_end_matches(" (*)").to_owned()).filter(|line| !line.is_empty()).collect()
}

fn names(crates: &BTreeSet<String>) -> BTreeSet<&str> {
    crates.iter().filter_map(|line| line.split(' ').next()).collect()
}

#[test]
fn programs_and_tests_share_one_build() {
    let (run, test) = (crates("normal,build", &[]), crates("normal,build,dev", &[]));
    assert!(run.len() > 300, "cargo lists the crates");
    let again: Vec<&String> = run.difference(&test).collect();
    assert!(again.is_empty(), "tests ask more of these, so they and all above would be compiled twice: {again:?}");
}

#[test]
fn a_feature_brings_what_it_needs_and_nothing_else_does() {
    let with = |features: &'static str| crates("normal,build", &["--no-default-features", "--features", features]);
    let (none, pages, sql) = (with(""), with("pages"), with("sql"));
    let brought = |with: &BTreeSet<String>| {
        names(with).difference(&names(&none)).map(ToString::to_string).collect::<BTreeSet<String>>()
    };
    // And base64, which shared stores have as well, in another version.
    assert_eq!(brought(&pages), ["maud", "maud_macros", "proc-macro2-diagnostics"].map(str::to_owned).into());
    let sql = brought(&sql);
    for expected in ["polars", "polars-core", "sqlparser"] {
        assert!(sql.contains(expected), "{expected}");
    }
    assert!(sql.len() > 60 && !sql.contains("maud") && !names(&none).contains("comfy-table"));
}
