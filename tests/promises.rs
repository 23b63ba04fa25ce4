//! The promises of engine and store, held against the real program on a small pipeline: what runs, what is a hit, what
//! survives damage and death, and that the bytes are the same whatever the threads.

mod crowds;
mod damage;
mod death;
mod edits;
mod golden;
mod growth;
mod records;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use tempfile::TempDir;

/// Every stage once, over two maps to learn from and one to try it on; a run takes about a second.
const PIPELINE: &str = "\
seed: 7
crowd: &crowd { agents: [2, 4], radius: 0.2, duration: 10 }
maps:
  train: { files: \"maps/train_*.yaml\" }
  test: { files: \"maps/test_*.yaml\" }
stages:
  walks: { use: simulate, map: $maps, episodes: 45, <<: *crowd }
  visits: { use: rasterize, map: $maps, walks: walks }
  labels: { use: quantize, map: $maps, visits: visits, classes: 3 }
  tiles: { use: tile, map: $maps.train, labels: labels.train, size: 16, stride: 16, min_labeled: 64 }
  model: { use: train, tiles: tiles, epochs: 2 }
  heat: { use: annotate, map: $maps.test, model: model, mode: exact, stride: 16 }
  scores: { use: score, heat: heat, labels: labels.test, visits: visits.test }
  trips: { use: navigate, map: $maps.test, episodes: 5, steps: 20, <<: *crowd, agents: [5, 6] }
  costs: { use: cost, trips: trips, heat: heat }
";

/// All nodes of the pipeline.
const ALL: &[&str] = &[
    "maps/{train_a,train_b,test_a}",
    "{walks,visits}/{train_a,train_b,test_a}{,/chunk-00,/chunk-01,/chunk-02}",
    "labels/{train_a,train_b,test_a}",
    "tiles",
    "model{,/epoch-01,/epoch-02}",
    "{heat,scores,trips,costs}/test_a",
];

/// A folder with maps, the pipeline and a store of its own.
pub struct Place {
    folder: TempDir,
}

impl Place {
    /// Draws three maps and writes the pipeline; nothing has run.
    pub fn new() -> Self {
        let place = Self { folder: tempfile::tempdir().expect("there is room for a folder") };
        fs::create_dir(place.at("maps")).expect("creates");
        fs::write(place.at("tiny.yaml"), PIPELINE).expect("writes");
        place.draw("train_a", Room { desk: (10, 10), door: 30 }, "");
        place.draw("train_b", Room { desk: (40, 44), door: 12 }, "");
        place.draw("test_a", Room { desk: (24, 50), door: 40 }, "");
        place
    }

    /// As [`Place::new`], and the pipeline has run.
    pub fn finished() -> Self {
        let place = Self::new();
        place.run(&[]).ran(ALL);
        place
    }

    pub fn at(&self, path: &str) -> PathBuf {
        self.folder.path().join(path)
    }

    /// Writes a map for ROS, with a comment in the header of its image.
    fn draw(&self, name: &str, room: Room, comment: &str) {
        let (rows, cols) = (60, 70);
        let mut image = format!("P5\n{comment}{cols} {rows}\n255\n").into_bytes();
        let pixels = (0..rows).flat_map(|row| (0..cols).map(move |col| room.is_free(row, col, rows, cols)));
        image.extend(pixels.map(|free| if free { 254 } else { 0 }));
        fs::write(self.at(&format!("maps/{name}.pgm")), image).expect("writes");
        let yaml = format!(
            "image: {name}.pgm\nresolution: 0.1\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n\
             free_thresh: 0.196\n"
        );
        fs::write(self.at(&format!("maps/{name}.yaml")), yaml).expect("writes");
    }

    /// Returns the program, to be run in the folder.
    pub fn trodden(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_trodden"));
        command.current_dir(self.folder.path()).args(arguments).env_remove("RAYON_NUM_THREADS");
        command
    }

    /// Runs a command to its end, whatever that is.
    pub fn tell(&self, arguments: &[&str]) -> Told {
        Told::of(&mut self.trodden(arguments))
    }

    /// Runs the pipeline with more arguments; it must succeed.
    fn run(&self, arguments: &[&str]) -> Told {
        let told = self.try_run(arguments);
        assert_eq!(told.code, 0, "{arguments:?}: {}{}", told.stdout, told.stderr);
        told
    }

    fn try_run(&self, arguments: &[&str]) -> Told {
        self.tell(&[&["run", "tiny.yaml", "--json"], arguments].concat())
    }

    /// Holds the store against its digests; nothing may be damaged or missing.
    fn verify(&self) {
        let told = self.tell(&["verify"]);
        assert!(told.code == 0 && told.stdout.ends_with(": all is well\n"), "{}{}", told.stdout, told.stderr);
    }

    /// Returns the path of an object.
    fn object(&self, digest: &str) -> PathBuf {
        self.at(&format!("artifacts/objects/{}/{}", &digest[..2], &digest[2..]))
    }

    /// Returns the files that an artifact in `latest` has, as object digests by name; a single file has no name.
    fn files(&self, node: &str) -> BTreeMap<String, String> {
        let digest = |link: &Path| -> String {
            let target = fs::read_link(link).expect("a link into the store");
            let parts: Vec<&str> = target.iter().map(|part| part.to_str().expect("digits")).collect();
            parts[parts.len() - 2..].concat()
        };
        let folder = self.at(&format!("artifacts/latest/tiny/{node}"));
        if !folder.is_dir() {
            return BTreeMap::from([(String::new(), digest(&folder.with_extension("parquet")))]);
        }
        let links = fs::read_dir(folder).expect("lists").map(|link| link.expect("lists"));
        links.map(|link| (link.file_name().into_string().expect("a plain name"), digest(&link.path()))).collect()
    }
}

/// Two rooms with a door between them, and a desk.
#[derive(Clone, Copy)]
struct Room {
    /// Upper left corner of the desk: row and column of the image.
    desk: (usize, usize),
    /// Uppermost row of the door.
    door: usize,
}

impl Room {
    fn is_free(self, row: usize, col: usize, rows: usize, cols: usize) -> bool {
        let outside = row < 2 || col < 2 || row >= rows - 2 || col >= cols - 2;
        let wall = (34..36).contains(&col) && !(self.door..self.door + 10).contains(&row);
        let (top, left) = self.desk;
        let desk = (top..top + 8).contains(&row) && (left..left + 12).contains(&col);
        !(outside || wall || desk)
    }
}

/// What a command said.
pub struct Told {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Told {
    pub fn of(command: &mut Command) -> Self {
        let output = command.output().expect("the program starts");
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("the program writes UTF-8");
        Self {
            code: output.status.code().expect("the program ends by itself"),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }

    fn objects(&self) -> impl Iterator<Item = Value> {
        self.stdout.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|_| panic!("no JSON object: {line}")))
    }

    /// Returns the names of the nodes with an outcome.
    fn with(&self, outcome: &str) -> BTreeSet<String> {
        self.objects().filter(|event| event["outcome"] == outcome).map(|event| text(&event["node"])).collect()
    }

    /// Returns what a run says of its nodes together.
    fn total(&self, outcome: &str) -> u64 {
        let last = self.objects().last().expect("a run says something");
        assert_eq!(last["event"], "run", "{last}");
        last[outcome].as_u64().expect("a count")
    }

    /// Checks that exactly these nodes ran and all others were hits.
    fn ran(&self, patterns: &[&str]) {
        let expected: BTreeSet<String> = patterns.iter().flat_map(|pattern| expand(pattern)).collect();
        let ran = self.with("ran");
        let (more, less): (Vec<_>, Vec<_>) = (ran.difference(&expected).collect(), expected.difference(&ran).collect());
        assert!(more.is_empty() && less.is_empty(), "ran besides: {more:?}, did not run: {less:?}");
        assert_eq!(self.total("ran"), expected.len() as u64);
        assert_eq!((self.total("failed"), self.total("skipped")), (0, 0), "{}", self.stdout);
        assert_eq!(self.total("hit"), self.with("hit").len() as u64);
    }

    /// Returns the digests of all nodes that ran or were hits.
    fn digests(&self) -> BTreeMap<String, String> {
        let made = self.objects().filter(|event| event["digest"].is_string());
        made.map(|event| (text(&event["node"]), text(&event["digest"]))).collect()
    }
}

fn text(value: &Value) -> String {
    value.as_str().expect("a text").to_owned()
}

/// Writes out all choices in braces: `a{b,c}` stands for `ab` and `ac`.
fn expand(pattern: &str) -> Vec<String> {
    let Some((before, rest)) = pattern.split_once('{') else { return vec![pattern.to_owned()] };
    let (choices, after) = rest.split_once('}').expect("braces come in pairs");
    let ends = expand(after);
    choices.split(',').flat_map(|choice| ends.iter().map(move |end| format!("{before}{choice}{end}"))).collect()
}
