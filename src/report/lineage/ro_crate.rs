//! An RO-Crate: what is in a folder and how it came about, as linked data.
//!
//! It follows RO-Crate 1.2 and the profile Process Run Crate 0.5: each recipe is a `CreateAction` of a stage as its
//! instrument, with what it read and its parameters as objects. What was exported is a file of the crate; what is behind it is
//! named by its digest.

use std::collections::{BTreeMap, BTreeSet};

use arrow::array::temporal_conversions::timestamp_ms_to_datetime;
use arrow::compute::kernels::cast_utils::string_to_timestamp_nanos;
use serde_json::{Map, Value, json};

use super::card::{OutFile, what};
use super::step::{Lineage, Step};
use crate::store::{Digest, Making, Recipe, Run};

/// Name of the file.
pub const METADATA: &str = "ro-crate-metadata.json";

const CONTEXTS: [&str; 2] = ["https://w3id.org/ro/crate/1.2/context", "https://w3id.org/ro/terms/workflow-run/context"];
const CRATE: &str = "https://w3id.org/ro/crate/1.2";
const PROFILE: &str = "https://w3id.org/ro/wfrun/process/0.5";

/// What goes into a crate.
#[derive(Debug, Clone, Copy)]
pub struct Content<'a> {
    /// What is behind the artifact.
    pub lineage: &'a Lineage,
    /// The run that it is of.
    pub run: Option<&'a Run>,
    /// The files of the artifact.
    pub files: &'a [OutFile],
    /// Files besides.
    pub besides: &'a [Beside<'a>],
    /// Under which license it is; an address, or any words.
    pub license: &'a str,
}

/// A file beside those of the artifact.
#[derive(Debug, Clone, Copy)]
pub struct Beside<'a> {
    /// Its path below the folder.
    pub path: &'a str,
    /// What it is.
    pub about: &'a str,
    /// Its size in bytes.
    pub bytes: usize,
}

/// Entities in the order in which they were named first.
#[derive(Default)]
struct Entities {
    known: BTreeSet<String>,
    all: Vec<Value>,
}

impl Entities {
    /// Adds an entity unless there is one of its name, and returns a reference to it.
    fn add(&mut self, id: &str, entity: impl FnOnce() -> Value) -> Value {
        if self.known.insert(id.to_owned()) {
            let mut fields = Map::from_iter([("@id".to_owned(), json!(id))]);
            if let Value::Object(more) = entity() {
                fields.extend(more);
            }
            self.all.push(Value::Object(fields));
        }
        json!({ "@id": id })
    }
}

/// Returns the metadata of the crate.
#[must_use]
pub fn metadata(content: &Content<'_>) -> Value {
    let target = content.lineage.target();
    let mut entities = Entities::default();
    let profile = json!({ "@type": ["CreativeWork", "Profile"], "name": "Process Run Crate", "version": "0.5" });
    let profile = entities.add(PROFILE, || profile);
    let license = license(&mut entities, content.license);
    let exported = exported(&mut entities, content);
    let besides = content.besides.iter().map(|Beside { path, about, bytes }| {
        let (format, size) = (media_type(path), bytes.to_string());
        entities.add(&encoded(path), || {
            json!({
                "@type": "File", "name": path, "description": about, "encodingFormat": format, "contentSize": size
            })
        })
    });
    let parts: Vec<Value> = std::iter::once(exported.clone()).chain(besides).collect();
    let mut actions = Vec::new();
    for step in &content.lineage.steps {
        actions.extend(action(&mut entities, content, step, &exported));
    }
    let kind = target.recipe.as_ref().map_or("", |recipe| recipe.kind.as_str());
    let published = target.making.as_ref().map(|making| making.started.clone());
    let published = published.filter(|time| !time.is_empty()).or_else(|| content.run.map(|run| run.started.clone()));
    let root = json!({
        "@id": "./",
        "@type": "Dataset",
        "name": target.name(),
        "description": format!("{kind}: {}, with all that it was made of", what(kind)),
        "datePublished": published.unwrap_or_else(|| "1970-01-01".to_owned()),
        "license": license,
        "conformsTo": profile,
        "hasPart": compact(parts),
        "mainEntity": exported,
        "mentions": compact(actions),
    });
    let descriptor = json!({
        "@id": METADATA,
        "@type": "CreativeWork",
        "conformsTo": { "@id": CRATE },
        "about": { "@id": "./" },
    });
    let graph: Vec<Value> = [descriptor, root].into_iter().chain(entities.all).collect();
    json!({ "@context": CONTEXTS, "@graph": graph })
}

fn license(entities: &mut Entities, license: &str) -> Value {
    if license.starts_with("https://") || license.starts_with("http://") {
        entities.add(license, || {
            json!({ "@type": "CreativeWork", "name": license, "description": "the license of the crate", "url": license })
        })
    } else {
        entities.add(
            "#license",
            || json!({ "@type": "CreativeWork", "name": license, "description": format!("The license is {license}.") }),
        )
    }
}

/// Writes a list as the specification recommends: a single value by itself.
fn compact(values: Vec<Value>) -> Value {
    match <[Value; 1]>::try_from(values) {
        Ok([only]) => only,
        Err(values) => Value::Array(values),
    }
}

/// Describes what was exported: a file, or a folder with files.
fn exported(entities: &mut Entities, content: &Content<'_>) -> Value {
    let target = content.lineage.target();
    let kind = target.recipe.as_ref().map_or("", |recipe| recipe.kind.as_str());
    let mut file = |file: &OutFile| {
        entities.add(&encoded(&file.path), || {
            let mut entity = json!({
                "@type": "File",
                "name": file.path,
                "description": format!("{kind}: {}", what(kind)),
                "encodingFormat": media_type(&file.path),
                "contentSize": file.bytes.to_string(),
                "identifier": format!("blake3:{}", file.digest),
            });
            if let Some(table) = &file.table {
                entity["variableMeasured"] = table.columns.iter().map(|[name, ..]| json!(name)).collect();
            }
            entity
        })
    };
    match (content.files, target.artifact.as_ref().is_some_and(|artifact| artifact.is_bundle())) {
        ([only], false) => file(only),
        (files, _) => {
            let parts: Vec<Value> = files.iter().map(&mut file).collect();
            let folder = format!("{}/", encoded(&target.name()));
            entities.add(&folder, || {
                json!({
                    "@type": "Dataset",
                    "name": target.name(),
                    "description": format!("{kind}: {}", what(kind)),
                    "identifier": digest(&target.digest),
                    "hasPart": compact(parts),
                })
            })
        }
    }
}

/// Describes how an artifact was made, and returns a reference to that.
fn action(entities: &mut Entities, content: &Content<'_>, step: &Step, exported: &Value) -> Option<Value> {
    let recipe = step.recipe.as_ref()?;
    let key = step.key?;
    let instrument = stage(entities, recipe, step.making.as_ref());
    let result = artifact(entities, content.lineage, step, exported);
    let mut objects: Vec<Value> = Vec::new();
    for read in &step.reads {
        let read = artifact(entities, content.lineage, &content.lineage.steps[read.step], exported);
        if !objects.contains(&read) && read != result {
            objects.push(read);
        }
    }
    for file in &step.sources {
        let name = file.path.clone().unwrap_or_else(|| format!("a file, read as {}", file.role));
        objects.push(entities.add(
            &format!("#file-{}", file.digest.to_hex()),
            || json!({ "@type": "CreativeWork", "name": name, "identifier": digest(&file.digest) }),
        ));
    }
    for (name, value) in
        recipe.parameter_texts().into_iter().chain(recipe.seed.map(|s| ("seed".to_owned(), s.to_string())))
    {
        objects.push(value_of(entities, &name, &value));
    }
    let environment: Vec<Value> =
        recipe.environment.iter().map(|(name, value)| value_of(entities, name, value)).collect();
    let id = format!("#action-{}", key.to_hex());
    Some(entities.add(&id, || {
        let mut action = json!({
            "@type": "CreateAction",
            "name": format!("{} → {}", recipe.stage, step.name()),
            "description": format!("The stage `{}` of version {} made `{}`.", recipe.stage, recipe.version, step.name()),
            "instrument": instrument,
            "object": compact(objects),
            "result": result,
            "actionStatus": "http://schema.org/CompletedActionStatus",
        });
        if let Some((start, end)) = step.making.as_ref().and_then(times) {
            (action["startTime"], action["endTime"]) = (json!(start), json!(end));
        }
        if !environment.is_empty() {
            action["environment"] = compact(environment);
        }
        action
    }))
}

/// Returns when something began and ended, as the profile wants it.
fn times(making: &Making) -> Option<(String, String)> {
    let start = string_to_timestamp_nanos(&making.started).ok()? / 1_000_000;
    let end = start + (making.wall_s * 1e3).round() as i64;
    let written = |milliseconds| {
        Some(format!("{}+00:00", timestamp_ms_to_datetime(milliseconds)?.format("%Y-%m-%dT%H:%M:%S%.3f")))
    };
    Some((written(start)?, written(end)?))
}

/// Describes an artifact: as what was exported, or by its digest.
fn artifact(entities: &mut Entities, lineage: &Lineage, step: &Step, exported: &Value) -> Value {
    if step.digest == lineage.target().digest {
        return exported.clone();
    }
    entities.add(&format!("#artifact-{}", step.digest.to_hex()), || {
        let kind = step.recipe.as_ref().map_or("", |recipe| recipe.kind.as_str());
        json!({
            "@type": "CreativeWork",
            "name": step.name(),
            "description": format!("{kind}: {}", what(kind)),
            "identifier": digest(&step.digest),
        })
    })
}

/// Describes a stage of a program.
fn stage(entities: &mut Entities, recipe: &Recipe, making: Option<&Making>) -> Value {
    let program = making.map(|making| making.program.as_str()).filter(|program| !program.is_empty());
    let part = program.map(|program| {
        let (name, version) = program.rsplit_once(' ').unwrap_or((program, "unknown"));
        let id = format!("#program-{}", encoded(&program.replace(' ', "-")));
        entities.add(&id, || software(name, version))
    });
    let id = format!("#stage-{}-{}", encoded(&recipe.stage), recipe.version);
    entities.add(&id, || {
        let mut stage = software(&recipe.stage, &recipe.version.to_string());
        stage["description"] = json!(format!("a stage that makes {}", recipe.kind));
        if let Some(part) = part {
            stage["isPartOf"] = part;
        }
        stage
    })
}

fn software(name: &str, version: &str) -> Value {
    let url = format!("pkg:generic/{}@{}", encoded(name), encoded(version));
    json!({
        "@type": "SoftwareApplication", "name": name, "version": version, "url": url
    })
}

/// Describes a parameter with its value; the same one only once.
fn value_of(entities: &mut Entities, name: &str, value: &str) -> Value {
    let id = format!("#value-{}", &Digest::of(format!("{name}\n{value}").as_bytes()).to_hex()[..16]);
    entities.add(&id, || json!({ "@type": "PropertyValue", "name": name, "value": value }))
}

fn digest(digest: &Digest) -> String {
    format!("blake3:{}", digest.to_hex())
}

fn media_type(path: &str) -> &'static str {
    let types: BTreeMap<&str, &str> = BTreeMap::from([
        ("parquet", "application/vnd.apache.parquet"),
        ("json", "application/json"),
        ("md", "text/markdown"),
        ("yaml", "application/yaml"),
        ("csv", "text/csv"),
        ("png", "image/png"),
    ]);
    let ending = path.rsplit_once('.').map_or("", |(_, ending)| ending);
    types.get(ending).copied().unwrap_or("application/octet-stream")
}

/// Writes a path so that it may stand in an address.
fn encoded(path: &str) -> String {
    path.bytes().fold(String::new(), |mut out, byte| {
        if byte.is_ascii_alphanumeric() || b"-._~/".contains(&byte) {
            out.push(char::from(byte));
        } else {
            out.push_str(&format!("%{byte:02X}"));
        }
        out
    })
}
