//! A program of somebody else's, in a field of its own, on the engine of `trodden`: word counts of texts.
//!
//! It has a section of its own (`texts:`), a stage with typed ports (`count-words`) that makes a kind of its own
//! (`WordCounts`), and one that gathers a group (`rank-words`); everything else comes from the library: plans, keys, caching,
//! runs, reports, sweeps, and the commands that look at them. `cargo run --release --example own_crate -- run texts.yaml`.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use serde_json::{Value, json};
use trodden::pipeline::stage::{
    Arity, Context, Entry, Inputs, KindSpec, KindType, Metric, Output, ParameterError, Part, Port, Section, Source,
    SourceNode, SourceType, Stage, StageError, StageSpec, Surroundings,
};
use trodden::store::{Artifact, Store};

fn main() -> ExitCode {
    let texts = SourceType::new("files", "Texts, by path.", texts, || json!({ "type": "array" }));
    let register = trodden::stages::register()
        .with_section(Section::new("texts", "text", "files").with(texts))
        .with_stage(Entry::new(count_words(), parse::<CountWords>, schema::<CountWords>))
        .with_stage(Entry::new(rank_words(), parse::<RankWords>, schema::<RankWords>))
        .with_kind(WordCounts);
    trodden::run(&register)
}

/// A kind of one's own: JSON that maps words to their number.
#[derive(Debug)]
struct WordCounts;

const KIND: KindSpec = KindSpec::new("WordCounts", 1, "json");

impl WordCounts {
    fn read(store: &Store, artifact: &Artifact) -> Result<BTreeMap<String, u64>, StageError> {
        let bytes = store.read(&artifact.digest)?;
        serde_json::from_slice(&bytes).map_err(StageError::failed)
    }

    fn write(counts: &BTreeMap<String, u64>, store: &Store) -> Result<Output, StageError> {
        let bytes = serde_json::to_vec_pretty(counts).expect("counts are JSON");
        Ok(Output::File(store.put("", &bytes)?))
    }
}

impl KindType for WordCounts {
    fn spec(&self) -> KindSpec {
        KIND
    }

    fn check(&self, store: &Store, artifact: &Artifact) -> Result<(), StageError> {
        Self::read(store, artifact).map(drop)
    }

    fn metrics(&self, store: &Store, artifact: &Artifact) -> Result<Vec<Metric>, StageError> {
        let counts = Self::read(store, artifact)?;
        Ok(vec![
            Metric::new("words", counts.values().sum::<u64>() as f64),
            Metric::new("different", counts.len() as f64),
        ])
    }
}

fn texts(value: &Value, surroundings: &Surroundings) -> Result<Vec<SourceNode>, ParameterError> {
    let refused = |message: String| ParameterError { path: Vec::new(), message, help: None };
    let paths = value.as_array().ok_or_else(|| refused("`files` is a list of paths".to_owned()))?;
    let node = |path: &Value| {
        let path = path.as_str().ok_or_else(|| refused(format!("`{path}` is no path")))?;
        let path = surroundings.folder.join(path);
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let spec = StageSpec::new("read-text", 1, vec![], KindSpec::new("Text", 1, "txt"), "Reads a text.");
        Ok(SourceNode { name, spec: Arc::new(spec), stage: Arc::new(ReadText { path }) })
    };
    paths.iter().map(node).collect()
}

#[derive(Debug)]
struct ReadText {
    path: PathBuf,
}

impl Stage for ReadText {
    fn parameters(&self) -> Value {
        json!({})
    }

    fn sources(&self) -> Result<Vec<Source>, StageError> {
        Ok(vec![Source { role: "text".to_owned(), path: self.path.clone() }])
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (path, _) = &inputs.sources["text"];
        let text = std::fs::read(path).map_err(|source| StageError::Source { path: path.clone(), source })?;
        Ok(Output::File(context.store.put("", &text)?))
    }
}

fn count_words() -> StageSpec {
    let ports = vec![Port::new("text", "Text", Arity::One, "The text.")];
    StageSpec::new("count-words", 1, ports, KIND, "Counts the words of a text.")
}

/// Parameters of `count-words`.
#[derive(Debug, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct CountWords {
    /// The shortest word that is counted, in letters.
    shortest: usize,
}

impl Default for CountWords {
    fn default() -> Self {
        Self { shortest: 1 }
    }
}

impl Stage for CountWords {
    fn parameters(&self) -> Value {
        serde_json::to_value(self).expect("parameters are JSON")
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let bytes = context.store.read(&inputs.one("text").digest)?;
        let text = String::from_utf8_lossy(&bytes).to_lowercase();
        let mut counts = BTreeMap::new();
        for word in text.split(|letter: char| !letter.is_alphanumeric()).filter(|word| !word.is_empty()) {
            if word.chars().count() >= self.shortest {
                *counts.entry(word.to_owned()).or_default() += 1;
            }
        }
        WordCounts::write(&counts, context.store)
    }
}

fn rank_words() -> StageSpec {
    let ports = vec![Port::new("counts", "WordCounts", Arity::Group, "Counts of a group of texts.")];
    StageSpec::new("rank-words", 1, ports, KIND, "Adds counts up and keeps the most frequent words.")
}

/// Parameters of `rank-words`.
#[derive(Debug, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct RankWords {
    /// How many words are kept.
    keep: usize,
}

impl Stage for RankWords {
    fn parameters(&self) -> Value {
        serde_json::to_value(self).expect("parameters are JSON")
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let mut sum: BTreeMap<String, u64> = BTreeMap::new();
        for artifact in inputs.group("counts").values() {
            for (word, count) in WordCounts::read(context.store, artifact)? {
                *sum.entry(word).or_default() += count;
            }
        }
        let mut ranked: Vec<(String, u64)> = sum.into_iter().collect();
        ranked.sort_by(|(a, a_count), (b, b_count)| b_count.cmp(a_count).then(a.cmp(b)));
        ranked.truncate(self.keep);
        WordCounts::write(&ranked.into_iter().collect(), context.store)
    }
}

fn parse<S>(value: &Value, _: &Surroundings) -> Result<Arc<dyn Stage>, ParameterError>
where
    S: Stage + serde::de::DeserializeOwned + 'static,
{
    let parsed: Result<S, _> = serde_json::from_value(value.clone());
    let refused =
        |error: serde_json::Error| ParameterError { path: Vec::new(), message: error.to_string(), help: None };
    Ok(Arc::new(parsed.map_err(refused)?))
}

fn schema<S: schemars::JsonSchema>() -> Value {
    schemars::schema_for!(S).to_value()
}
