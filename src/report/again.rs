//! The command that runs the same once more.

use crate::store::Run;

/// Returns the command that runs the same once more.
#[must_use]
pub fn again(run: &Run) -> String {
    command(run, run.asked())
}

/// Returns the command that makes a node as a run did, where that is not at hand.
#[must_use]
pub fn again_for(run: &Run, node: &str) -> String {
    let sets = run.sets.iter().map(|set| ("--set", set.as_str()));
    command(run, sets.chain([("--only", node)]))
}

fn command<'a>(run: &'a Run, asked: impl Iterator<Item = (&'static str, &'a str)>) -> String {
    let verb = if run.axes.is_empty() { "run" } else { "sweep" };
    let axes = run.axes.iter().map(String::as_str);
    let words = ["trodden", verb, &run.file].into_iter().chain(axes);
    let words = words.chain(asked.flat_map(|(option, value)| [option, value]));
    words.map(quoted).collect::<Vec<_>>().join(" ")
}

/// Writes a word so that a shell reads it as it is.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_runs_the_same_again() {
        let check = |file: &str, sets: &[&str], only: &[&str], expected: &str| {
            let words = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect();
            let run = Run { file: file.to_owned(), sets: words(sets), only: words(only), ..Run::default() };
            assert_eq!(again(&run), expected);
        };
        check("a/b.yaml", &[], &[], "trodden run a/b.yaml");
        check(
            "my maps.yaml",
            &["labels.classes=4", "crowd.agents=[1, 8]"],
            &["labels/home_00"],
            "trodden run 'my maps.yaml' --set labels.classes=4 --set 'crowd.agents=[1, 8]' --only labels/home_00",
        );
        check("it's.yaml", &["a=$HOME"], &[], r"trodden run 'it'\''s.yaml' --set 'a=$HOME'");
    }

    #[test]
    fn a_sweep_is_swept_again() {
        let axes = vec!["a.b=1,2".to_owned()];
        let run = Run { file: "a.yaml".to_owned(), axes, sets: vec!["seed=7".to_owned()], ..Run::default() };
        assert_eq!(again(&run), "trodden sweep a.yaml a.b=1,2 --set seed=7");
    }

    #[test]
    fn a_node_is_made_again_by_itself() {
        let run = Run { file: "a.yaml".to_owned(), sets: vec!["seed=7".to_owned()], ..Run::default() };
        assert_eq!(again_for(&run, "labels/home_00"), "trodden run a.yaml --set seed=7 --only labels/home_00");
    }
}
