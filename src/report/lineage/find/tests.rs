use serde_json::json;
use tempfile::TempDir;

use super::*;
use crate::report::lineage::fold::View;
use crate::report::lineage::tree::{Detail, tree};
use crate::store::{Artifact, Making, NodeName, NodePart, Recipe};

/// A store in which a map was read from a file, people walked on it in two chunks, and were counted.
struct Made {
    _folder: TempDir,
    store: Store,
    run: Run,
}

fn recipe(stage: &str, part: Option<&str>, number: u32, inputs: &[(&str, Digest)]) -> Recipe {
    Recipe {
        stage: stage.to_owned(),
        part: part.map(str::to_owned),
        version: 2,
        kind: format!("{stage}s"),
        format: 1,
        parameters: json!({ "first": number, "wide": true, "unset": null }),
        seed: None,
        environment: BTreeMap::new(),
        inputs: inputs.iter().map(|(port, digest)| ((*port).to_owned(), InputDigest::One(*digest))).collect(),
    }
}

impl Made {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("creates");
        let store = Store::open(folder.path()).expect("opens");
        let mut made = Self { _folder: folder, store, run: Run::default() };
        let source = Digest::of(b"a plan");
        let map = made.add("maps/a", recipe("read", None, 0, &[("source:image", source)]), b"map", &[]);
        let chunks = [0, 1].map(|number| {
            let name = NodeName::new("walks", Some("a")).part_of(NodePart::Chunk(number));
            let bytes = [b'c', number as u8];
            made.add(&name, recipe("walk", Some("chunk"), number * 20, &[("map", map)]), &bytes, &["maps/a"])
        });
        let parts: BTreeMap<String, Digest> =
            chunks.iter().enumerate().map(|(n, digest)| (format!("chunk-{n:02}"), *digest)).collect();
        let mut gather = recipe("walk", Some("gather"), 0, &[]);
        gather.inputs.insert("parts".to_owned(), InputDigest::Many(parts));
        let walks = made.add("walks/a", gather, b"walks", &["walks/a/chunk-00", "walks/a/chunk-01"]);
        let inputs = [("map", map), ("walks", walks)];
        made.add("visits/a", recipe("count", None, 0, &inputs), b"visits", &["maps/a", "walks/a"]);
        made
    }

    fn add(&mut self, name: &str, recipe: Recipe, bytes: &[u8], reads: &[&str]) -> Digest {
        let artifact = Artifact::single(self.store.put("", bytes).expect("puts"));
        let sources = recipe.inputs.keys().filter_map(|port| port.strip_prefix(SOURCE));
        let sources = sources.map(|role| (role.to_owned(), "plans/a.png".to_owned())).collect();
        let making = Making { program: "trodden 0.1.0".to_owned(), wall_s: 0.5, sources, ..Making::default() };
        let record = Record { recipe, artifact, making: Some(making) };
        self.store.remember(&record.recipe.key(), &record).expect("writes");
        let node = NodeName::from(name);
        self.run.nodes.push(RunNode {
            amount: None,
            pulled: None,
            absent: false,
            role: node.role(),
            node,
            stage: record.recipe.stage.clone(),
            kind: record.recipe.kind.clone(),
            outcome: Outcome::Ran,
            key: Some(record.recipe.key()),
            artifact: Some(record.artifact.clone()),
            wall_s: 0.5,
            inputs: reads.iter().map(|read| (*read).to_owned()).collect(),
            error: None,
        });
        record.artifact.digest
    }

    fn of(&self, name: &str) -> Lineage {
        let node = self.run.nodes.iter().find(|node| node.node == name).expect("is there");
        Finder::new(&self.store, Some(&self.run)).of_node(node).expect("reads")
    }
}

const PLAIN: Detail = Detail { width: 100, parts: false, all: false };

#[test]
fn everything_behind_a_node_is_found_down_to_the_file() {
    let lineage = Made::new().of("visits/a");
    let names: Vec<String> = lineage.steps.iter().map(Step::name).collect();
    assert_eq!(names, ["maps/a", "walks/a/chunk-00", "walks/a/chunk-01", "walks/a", "visits/a"]);
    // Who reads stands behind what it reads.
    assert!(lineage.steps.iter().enumerate().all(|(at, step)| step.reads.iter().all(|read| read.step < at)));
    let [file] = lineage.sources()[..] else { panic!("{lineage:?}") };
    assert_eq!((file.path.as_deref(), file.digest), (Some("plans/a.png"), Digest::of(b"a plan")));
    assert_eq!(lineage.programs(), [("trodden 0.1.0", 5)]);
}

#[test]
fn chunks_fold_into_their_node() {
    let made = Made::new();
    let lineage = made.of("visits/a");
    let view = View::folded(&lineage);
    let names: Vec<String> = (0..view.made.len()).map(|at| view.name(at)).collect();
    assert_eq!(names, ["maps/a", "walks/a", "visits/a"]);
    assert_eq!((view.parts(1).as_deref(), view.parts(2)), (Some("2 chunks"), None));
    assert_eq!(view.seconds(1), Some(1.5));
    let parameters = [("first", "0 | 20"), ("wide", "true")].map(|(name, text)| (name.to_owned(), text.to_owned()));
    assert_eq!(view.parameters(1), parameters);
    let text = tree(&lineage, PLAIN);
    let digest = |bytes: &[u8]| Digest::of(bytes).to_string();
    let expected = format!(
        "visits/a  counts  {}  6 B  500 ms\n\
         │  count version 2: first 0, wide true\n\
         ├─ map: maps/a  reads  {}  3 B  500 ms\n\
         │  │  read version 2: first 0, wide true\n\
         │  └─ source image: plans/a.png  {}\n\
         └─ walks: walks/a  walks  {}  2 chunks  5 B  1.5 s\n   \
            │  walk version 2: first 0 | 20, wide true\n   \
            └─ map: maps/a  (above)\n\n\
         5 artifacts by 3 stages in 2.5 s, by trodden 0.1.0\n\
         files from outside of the store:\n  {}  plans/a.png",
        digest(b"visits"),
        digest(b"map"),
        digest(b"a plan"),
        digest(b"walks"),
        Digest::of(b"a plan").to_hex(),
    );
    assert_eq!(text, expected);
    let parts = tree(&lineage, Detail { parts: true, ..PLAIN });
    assert!(parts.contains(&format!("· chunk-01  {}  2 B  500 ms", digest(b"c\x01"))), "{parts}");
}

#[test]
fn records_alone_tell_the_same_when_all_objects_are_gone() {
    let made = Made::new();
    for entry in std::fs::read_dir(made.store.root().join("objects")).expect("lists") {
        std::fs::remove_dir_all(entry.expect("lists").path()).expect("removes");
    }
    let with_run = made.of("visits/a");
    let finder = Finder::new(&made.store, None);
    let alone = finder.of_digest(&Digest::of(b"visits")).expect("reads").expect("is on record");
    for lineage in [&with_run, &alone] {
        assert!(lineage.steps.iter().all(|step| !step.is_here));
        let parts = lineage.steps.iter().filter(|step| step.part().is_some()).count();
        assert_eq!((lineage.steps.len(), parts, lineage.sources().len()), (5, 2, 1));
        assert_eq!(View::folded(lineage).made.len(), 3);
    }
    assert_eq!(finder.of_digest(&Digest::of(b"never made")).expect("reads"), None);
}

#[test]
fn equal_bytes_made_of_each_other_end_somewhere() {
    let mut made = Made::new();
    let (one, two) = (Digest::of(b"one"), Digest::of(b"two"));
    made.add("turned/a", recipe("turn", None, 0, &[("of", two)]), b"one", &[]);
    made.add("back/a", recipe("turn", None, 0, &[("of", one)]), b"two", &["turned/a"]);
    let lineage = Finder::new(&made.store, None).of_digest(&two).expect("reads").expect("is on record");
    assert_eq!(lineage.steps.len(), 2);
    assert!(lineage.steps.iter().enumerate().all(|(at, step)| step.reads.iter().all(|read| read.step < at)));
}
