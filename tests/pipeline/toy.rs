//! Stages of a few lines that write text, to test the engine with: no crowd, no tensor, no Parquet.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use trodden::pipeline::stage::{
    Arity, Context, Division, Entry, Inputs, KindSpec, Needs, Output, ParameterError, Part, Port, Register, Section,
    Source, SourceNode, SourceType, Stage, StageError, StageSpec, Surroundings,
};
use trodden::store::{Artifact, Store};

fn port(name: &'static str, kind: &'static str, arity: Arity) -> Port {
    Port::new(name, kind, arity, "What is read.")
}

/// Describes a toy.
fn spec(name: &'static str) -> StageSpec {
    let (ports, kind) = match name {
        "seed-map" | "read-map" => (Vec::new(), "Map"),
        "walk" => (vec![port("map", "Map", Arity::One)], "Walks"),
        "count" => (vec![port("map", "Map", Arity::One), port("walks", "Walks", Arity::One)], "Counts"),
        "label" => (vec![port("map", "Map", Arity::Optional), port("counts", "Counts", Arity::One)], "Labels"),
        "join" => (vec![port("maps", "Map", Arity::Group), port("labels", "Labels", Arity::Group)], "Table"),
        "train" => (vec![port("table", "Table", Arity::One)], "Model"),
        "heat" => (vec![port("map", "Map", Arity::One), port("model", "Model", Arity::One)], "Heat"),
        "score" => (vec![port("heat", "Heat", Arity::One), port("labels", "Labels", Arity::One)], "Score"),
        "sum" => (
            vec![
                port("labels", "Labels", Arity::group_or("counts")),
                port("counts", "Counts", Arity::group_or("labels")),
            ],
            "Sum",
        ),
        other => panic!("there is no toy `{other}`"),
    };
    let output = KindSpec::new(kind, 1, if name == "walk" { "" } else { "txt" });
    let spec = StageSpec::new(name, 1, ports, output, "Does what a toy does.");
    StageSpec { seeded: matches!(name, "walk" | "train"), ..spec }
}

/// How often a [`Random`] stage has run in this process: what makes it give other bytes every time.
static RANDOM: AtomicU64 = AtomicU64::new(0);

/// Parameters that all toys share, as far as they use them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Common {
    /// A word to write.
    word: String,
    /// Number of classes.
    classes: u32,
    /// Number of episodes, four a chunk.
    episodes: u32,
    /// Number of steps.
    epochs: u32,
    /// Letters of the map that are looked at; what lies beyond changes nothing.
    letters: usize,
    /// A range.
    range: Option<Range>,
    /// Milliseconds to wait.
    wait: u64,
    /// Waits until it is told to stop.
    hang: bool,
    /// Fails for the member whose map says so.
    fail: String,
    /// Says that this is odd, and goes on. It came after the golden keys and leaves them as they were.
    #[serde(skip_serializing_if = "String::is_empty")]
    odd: String,
    /// Panics.
    panic: bool,
    /// Writes something else each time.
    random: bool,
    /// A file to read.
    file: Option<PathBuf>,
    /// What computes; it changes the bytes, and is known to the others as `red` and `blue`.
    #[serde(skip_serializing)]
    device: String,
    /// Asks to be alone.
    exclusive: bool,
    /// Asks for that many bytes.
    memory: u64,
}

/// A nested parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Range {
    first: u32,
    last: u32,
}

impl Default for Common {
    fn default() -> Self {
        Self {
            word: String::new(),
            classes: 3,
            episodes: 8,
            epochs: 3,
            letters: 64,
            range: None,
            wait: 0,
            hang: false,
            fail: String::new(),
            odd: String::new(),
            panic: false,
            random: false,
            file: None,
            device: String::new(),
            exclusive: false,
            memory: 1 << 20,
        }
    }
}

fn named(device: String) -> (String, String) {
    ("device".to_owned(), device)
}

#[derive(Debug)]
struct Toy {
    name: &'static str,
    common: Common,
}

fn read(store: &Store, artifact: &Artifact) -> Result<String, StageError> {
    let mut text = String::new();
    for file in &artifact.files {
        text.push_str(&String::from_utf8(store.read(&file.digest)?).expect("toys write text"));
    }
    Ok(text)
}

impl Toy {
    /// Writes a text, after what the parameters ask for besides.
    fn write(&self, text: &str, context: &Context) -> Result<Output, StageError> {
        let common = &self.common;
        assert!(!common.panic, "asked to panic");
        std::thread::sleep(Duration::from_millis(common.wait));
        if !common.odd.is_empty() {
            (context.warn)(common.odd.clone());
        }
        if common.hang {
            while !(context.cancelled)() {
                std::thread::sleep(Duration::from_millis(2));
            }
            return Err(StageError::Cancelled);
        }
        if !common.fail.is_empty() && text.contains(&common.fail) {
            return Err(StageError::failed(std::io::Error::other("asked to fail")).with_help("take `fail` out"));
        }
        let mut text = text.to_owned();
        if common.random {
            text.push_str(&RANDOM.fetch_add(1, Ordering::Relaxed).to_string());
        }
        Ok(Output::File(context.store.put("", text.as_bytes())?))
    }

    /// Mixes a text, so that what comes out depends on every byte and is short.
    fn mix(text: &str) -> String {
        trodden::store::Digest::of(text.as_bytes()).to_string()
    }

    fn run_whole(&self, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let store = context.store;
        let common = &self.common;
        let text = match self.name {
            "seed-map" => format!("map {}", common.word),
            "read-map" => {
                let (path, _) = &inputs.sources["image"];
                let text = std::fs::read_to_string(path)
                    .map_err(|source| StageError::Source { path: path.clone(), source })?;
                text.lines().filter(|line| !line.starts_with('#')).collect::<Vec<_>>().join("\n")
            }
            "label" => {
                let counts = read(store, inputs.one("counts"))?;
                let map = inputs.maybe("map").map(|map| read(store, map)).transpose()?.unwrap_or_default();
                format!("labels {} of {counts} {map}", common.classes)
            }
            "count" => format!("counts {}", read(store, inputs.one("walks"))?),
            "join" => {
                let mut text = String::from("table");
                for (name, map) in inputs.group("maps") {
                    let labels = &inputs.group("labels")[name];
                    text += &format!("\n{name}: {} {}", read(store, map)?, Self::mix(&read(store, labels)?));
                }
                text
            }
            "heat" => {
                let map = read(store, inputs.one("map"))?;
                let map: String = map.chars().take(common.letters).collect();
                format!("heat {map} {}", read(store, inputs.one("model"))?)
            }
            "score" => format!("{} {}", read(store, inputs.one("heat"))?, read(store, inputs.one("labels"))?),
            other => panic!("`{other}` divides its work"),
        };
        self.write(&text, context)
    }
}

impl Stage for Toy {
    fn parameters(&self) -> Value {
        let mut common = self.common.clone();
        // As a path, it must not enter the recipe: the content does.
        common.file = None;
        serde_json::to_value(common).expect("parameters are JSON")
    }

    fn environment(&self) -> BTreeMap<String, String> {
        let device = self.common.device.clone();
        Some(device).filter(|device| !device.is_empty()).map(named).into_iter().collect()
    }

    fn environments(&self) -> Vec<BTreeMap<String, String>> {
        ["red", "blue"].map(|device| BTreeMap::from([named(device.to_owned())])).to_vec()
    }

    fn sharing_advice(&self) -> Option<&'static str> {
        Some("paint it")
    }

    fn part_parameters(&self, part: Part) -> Value {
        let mut parameters = self.parameters();
        match part {
            Part::Chunk(number) if self.name == "walk" => {
                parameters["episodes"] = (4.min(self.common.episodes - 4 * number)).into();
                parameters["first"] = (4 * number).into();
            }
            Part::Step(number) => parameters["epochs"] = number.into(),
            Part::Chunk(_) | Part::Gather | Part::Whole => {}
        }
        parameters
    }

    fn step_word(&self) -> &'static str {
        "epoch"
    }

    fn division(&self) -> Division {
        match self.name {
            "walk" => Division::Chunks(self.common.episodes.div_ceil(4)),
            "count" => Division::Follows("walks"),
            "train" => Division::Chain(self.common.epochs),
            _ => Division::Whole,
        }
    }

    fn part_ports(&self, part: Part) -> Option<&'static [&'static str]> {
        (part == Part::Gather).then_some(&[])
    }

    fn sources(&self) -> Result<Vec<Source>, StageError> {
        let source = |path: &PathBuf| Source { role: "image".to_owned(), path: path.clone() };
        Ok(self.common.file.iter().map(source).collect())
    }

    fn needs(&self, _: Part, _: &Inputs, _: &Store) -> Needs {
        Needs { memory: self.common.memory, exclusive: self.common.exclusive }
    }

    fn run(&self, part: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        (context.progress)(1, 2);
        match part {
            Part::Whole => self.run_whole(inputs, context),
            Part::Chunk(number) if self.name == "walk" => {
                let map = read(context.store, inputs.one("map"))?;
                let first = 4 * number;
                let last = (first + 4).min(self.common.episodes);
                self.write(&format!("[{} {first}..{last} {}]", Self::mix(&map), context.seed), context)
            }
            Part::Chunk(_) => {
                let walks = read(context.store, inputs.one("walks"))?;
                self.write(&format!("<{} {}>", walks.len(), Self::mix(&walks)), context)
            }
            Part::Gather if self.name == "walk" => {
                let named = |(name, artifact): &(String, Artifact)| {
                    let mut file = artifact.files[0].clone();
                    file.name.clone_from(name);
                    file
                };
                Ok(Output::Bundle(inputs.parts.iter().map(named).collect()))
            }
            Part::Gather => {
                let mut text = String::new();
                for (_, part) in &inputs.parts {
                    text.push_str(&read(context.store, part)?);
                }
                self.write(&text, context)
            }
            Part::Step(number) => {
                let table = read(context.store, inputs.one("table"))?;
                let previous = inputs.previous.as_ref().map(|before| read(context.store, before)).transpose()?;
                let text = format!("{number} {} {}", previous.unwrap_or_default(), Self::mix(&table));
                self.write(&format!("model {number} {} {}", Self::mix(&text), context.seed), context)
            }
        }
    }
}

fn toy(name: &'static str, value: &Value) -> Result<Arc<dyn Stage>, ParameterError> {
    let common: Common = serde_json::from_value(value.clone()).map_err(|error| ParameterError {
        path: Vec::new(),
        message: error.to_string(),
        help: None,
    })?;
    if common.classes < 2 {
        return Err(ParameterError {
            path: vec!["classes".to_owned()],
            message: format!("`classes` is {}: it must be from 2 to 100", common.classes),
            help: Some("two classes tell walked from not walked".to_owned()),
        });
    }
    Ok(Arc::new(Toy { name, common }))
}

fn schema() -> Value {
    schemars::schema_for!(Common).to_value()
}

fn entry(name: &'static str) -> Entry {
    Entry::new(spec(name), move |value, _| toy(name, value), schema)
}

fn node(name: String, stage: &'static str, common: Common) -> SourceNode {
    SourceNode { name, spec: Arc::new(spec(stage)), stage: Arc::new(Toy { name: stage, common }) }
}

fn count_maps(value: &Value, _: &Surroundings) -> Result<Vec<SourceNode>, ParameterError> {
    let refuse = |path: &str, message: &str| {
        let path = if path.is_empty() { Vec::new() } else { vec![path.to_owned()] };
        ParameterError { path, message: message.to_owned(), help: None }
    };
    let object = value.as_object().ok_or_else(|| refuse("", "`homes` is a mapping"))?;
    if let Some(key) = object.keys().find(|key| !["count", "first", "word"].contains(&key.as_str())) {
        return Err(refuse("", &format!("unknown field `{key}`")));
    }
    let count =
        object.get("count").and_then(Value::as_u64).ok_or_else(|| refuse("count", "`count` is a whole number"))?;
    let first = object.get("first").and_then(Value::as_u64).unwrap_or(0);
    let word = object.get("word").and_then(Value::as_str).unwrap_or("of home");
    Ok((first..first + count)
        .map(|number| {
            let common = Common { word: format!("{word} {number}"), ..Common::default() };
            node(format!("home_{number:02}"), "seed-map", common)
        })
        .collect())
}

fn count_schema() -> Value {
    serde_json::json!({
        "type": "object",
        "properties": { "count": { "type": "integer" }, "first": { "type": "integer" }, "word": { "type": "string" } },
        "additionalProperties": false
    })
}

fn file_maps(value: &Value, surroundings: &Surroundings) -> Result<Vec<SourceNode>, ParameterError> {
    let names = value.as_array().cloned().unwrap_or_else(|| vec![value.clone()]);
    let map = |name: &Value| {
        let path = surroundings.folder.join(name.as_str().unwrap_or_default());
        let common = Common { file: Some(path.clone()), ..Common::default() };
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        node(stem, "read-map", common)
    };
    Ok(names.iter().map(map).collect())
}

/// The register of the toys.
pub fn register() -> Register {
    let stages = ["walk", "count", "label", "join", "train", "heat", "score", "sum", "seed-map"];
    let maps = Section::new("maps", "map", "files")
        .with(SourceType::new("homes", "Numbered maps.", count_maps, count_schema))
        .with(SourceType::new("files", "Files.", file_maps, || serde_json::json!({})));
    Register { stages: stages.map(entry).to_vec(), sections: vec![maps], kinds: Vec::new() }
}
