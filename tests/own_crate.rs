//! A program of somebody else's on the library: `tests/own_crate/main.rs`, run as its users would.

use std::path::PathBuf;
use std::process::Command;

use serde_json::Value;

const TEXTS: &str = "
name: texts
texts: { all: { files: [a.txt, b.txt] } }
stages:
  counts: { use: count-words, text: $texts, shortest: 2 }
  top: { use: rank-words, counts: counts, keep: 2 }
";

/// The example lies beside the folder of the tests.
fn program() -> PathBuf {
    let tests = std::env::current_exe().expect("a test has a path");
    tests.ancestors().nth(2).expect("lies below the target folder").join("examples/own_crate")
}

struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().expect("creates"));
        place.write("texts.yaml", TEXTS);
        // With words of two letters and more: the 3, dog 2, cat 1, an 1.
        place.write("a.txt", "The dog, the cat.");
        place.write("b.txt", "An a the dog");
        place
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.0.path().join(name), text).expect("writes");
    }

    fn said(&self, words: &[&str]) -> (Option<i32>, String) {
        let output = Command::new(program()).args(words).current_dir(self.0.path()).output().expect("starts");
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("is text");
        (output.status.code(), text(output.stdout) + &text(output.stderr))
    }

    fn out(&self, words: &[&str]) -> String {
        let (code, said) = self.said(words);
        assert_eq!(code, Some(0), "{words:?}: {said}");
        said
    }

    /// Runs; returns how many nodes ran and were hits.
    fn run(&self, words: &[&str]) -> (u64, u64) {
        let said = self.out(&[&["run", "texts.yaml", "--json"], words].concat());
        let last: Value = serde_json::from_str(said.lines().last().expect("ends")).expect("is JSON");
        (last["ran"].as_u64().expect("a number"), last["hit"].as_u64().expect("a number"))
    }

    fn top(&self) -> Value {
        let bytes = std::fs::read(self.0.path().join("artifacts/latest/texts/top.json")).expect("is there");
        serde_json::from_slice(&bytes).expect("is JSON")
    }
}

#[test]
fn stages_of_a_crate_of_ones_own_run_beside_ours() {
    let place = Place::new();
    assert_eq!(place.run(&[]), (5, 0));
    assert_eq!(place.top(), serde_json::json!({ "dog": 2, "the": 3 }));
    assert_eq!(place.run(&[]), (0, 5));
    // Another text changes its counts and what is made of them, with what was there.
    place.write("b.txt", "An a the cat cat");
    assert_eq!(place.run(&[]), (3, 2));
    assert_eq!(place.top(), serde_json::json!({ "cat": 3, "the": 3 }));
    assert!(place.out(&["why", "top"]).contains("input `counts` changed: counts/b"));
    assert_eq!(place.run(&["--set", "top.keep=1"]), (1, 4));
    assert!(place.out(&["why", "top"]).contains("keep 2 → 1"));
    // What is wrong is told as it is for stages of ours.
    let (code, said) = place.said(&["check", "texts.yaml", "--set", "top.keeep=1"]);
    assert!(
        code == Some(2) && said.contains("`top` has no parameter `keeep`") && said.contains("did you mean `keep`?"),
        "{said}"
    );
    let (code, said) = place.said(&["check", "texts.yaml", "--set", "top.counts=$texts"]);
    assert!(code == Some(2) && said.contains("port `counts` takes WordCounts, but `$texts` is Text"), "{said}");
    let schema: Value = serde_json::from_str(&place.out(&["schema"])).expect("is JSON");
    assert!(schema["properties"]["texts"].is_object() && schema["properties"]["maps"].is_object());
    // Its figures are those of its kind.
    let swept = place.out(&["sweep", "texts.yaml", "counts.shortest=1,3", "-q"]);
    let table = place.out(&["table", "--json"]);
    // The two most frequent words are the same, and what does not differ has no column.
    assert!(swept.contains("counts.different") && !swept.contains("top.words"), "{swept}");
    let rows: Vec<Value> = table
        .lines()
        .filter(|line| line.starts_with('{'))
        .map(|line| serde_json::from_str(line).expect("is JSON"))
        .collect();
    // Of one letter and more a has 4 words and b 5, of three and more 4 and 3.
    let means: Vec<f64> =
        rows.iter().map(|row| row["metrics"]["counts.words"]["mean"].as_f64().expect("a number")).collect();
    assert_eq!(means, [4.5, 3.5]);
}
