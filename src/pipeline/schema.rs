//! The JSON Schema (draft-07) of the pipeline file, for editors: built from the register's own schemas.

use serde_json::{Map, Value, json};

use super::stage::{Arity, Entry, Port, Register, Section};

/// What a reference looks like.
const REFERENCE: &str = r"^\$?[A-Za-z_][A-Za-z0-9_-]*(\.[A-Za-z_][A-Za-z0-9_-]*)?$";

/// Returns the schema of a whole pipeline file.
#[must_use]
pub fn schema(register: &Register) -> Value {
    let mut definitions = Map::new();
    let uses: Vec<Value> = register.stages.iter().map(|entry| stage_schema(entry, &mut definitions)).collect();
    definitions.insert("stage".to_owned(), json!({ "oneOf": uses }));
    let mut properties = Map::new();
    let name = json!({
        "type": "string",
        "pattern": "^[A-Za-z_][A-Za-z0-9_-]*$",
        "description": "Name of the pipeline; by default that of its file."
    });
    properties.insert("name".to_owned(), name);
    let doc = "What every stage that draws random numbers starts from, unless it names a seed of its own [0].";
    properties.insert("seed".to_owned(), seed_schema(doc));
    let store = json!({
        "type": "object",
        "description": "A store elsewhere that others use as well; no result depends on it.",
        "properties": {
            "remote": {
                "type": "string",
                "description": "`s3://bucket/prefix`, `gs://…`, `az://…`, or a folder beside this file."
            },
            "read_only": { "type": "boolean", "description": "Whether nothing is given to it [false]." }
        },
        "required": ["remote"],
        "additionalProperties": false
    });
    properties.insert("store".to_owned(), store);
    for section in &register.sections {
        properties.insert(section.key.to_string(), section_schema(section, &mut definitions));
    }
    let stages = json!({
        "type": "object",
        "description": "Named uses of stages; a port takes `$SECTION`, `$SECTION.GROUP`, `STAGE` or `STAGE.GROUP`.",
        "additionalProperties": { "$ref": "#/definitions/stage" }
    });
    properties.insert("stages".to_owned(), stages);
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "trodden pipeline",
        "type": "object",
        "required": ["stages"],
        "properties": properties,
        "definitions": definitions
    })
}

/// Returns the schema of one use of a stage.
fn stage_schema(entry: &Entry, definitions: &mut Map<String, Value>) -> Value {
    let mut own = adopt(entry.schema(), &entry.spec.name, definitions);
    let mut properties = Map::new();
    properties.insert("use".to_owned(), json!({ "const": entry.spec.name, "description": entry.spec.doc }));
    for port in &entry.spec.ports {
        properties.insert(port.name.to_string(), port_schema(port));
    }
    if entry.spec.open {
        properties.insert("inputs".to_owned(), inputs_schema());
    }
    if let Some(Value::Object(parameters)) = own.get_mut("properties").map(Value::take) {
        properties.extend(parameters);
    }
    if entry.spec.seeded {
        let doc = "What its random numbers start from, in place of the pipeline's seed: another one makes a replicate.";
        properties.insert("seed".to_owned(), seed_schema(doc));
    }
    let mut required = vec![json!("use")];
    let needed = entry.spec.ports.iter().filter(|port| matches!(port.arity, Arity::One | Arity::Group));
    required.extend(needed.map(|port| json!(port.name)));
    if let Some(Value::Array(more)) = own.get("required") {
        required.extend(more.iter().cloned());
    }
    json!({
        "type": "object",
        "description": entry.spec.doc,
        "properties": properties,
        "required": required,
        // Merge keys are resolved by the program; a validator sees them as they are written.
        "patternProperties": { "^<<$": {} },
        "additionalProperties": false
    })
}

fn seed_schema(doc: &str) -> Value {
    json!({ "type": "integer", "minimum": 0, "maximum": u64::MAX, "description": doc })
}

fn port_schema(port: &Port) -> Value {
    let takes = match &port.arity {
        Arity::One => format!("{} Takes {}.", port.doc, port.kind),
        Arity::Optional => format!("{} Takes {}; may be left out.", port.doc, port.kind),
        Arity::Group => format!("{} Takes {} of a whole group.", port.doc, port.kind),
        Arity::OptionalGroup => format!("{} Takes {} of a whole group; may be left out.", port.doc, port.kind),
        Arity::GroupOr(other) => {
            format!("{} Takes {} of a whole group; in the place of `{other}`.", port.doc, port.kind)
        }
    };
    json!({ "type": "string", "pattern": REFERENCE, "description": takes })
}

fn inputs_schema() -> Value {
    let one = json!({ "type": "string", "pattern": REFERENCE });
    json!({
        "type": "object",
        "description": "Its inputs by name: one artifact at a time, or with `all` those of a whole group.",
        "additionalProperties": {
            "anyOf": [
                one,
                { "type": "object", "required": ["all"], "properties": { "all": one }, "additionalProperties": false }
            ]
        }
    })
}

/// Returns the schema of a section: groups of entries of its sources.
fn section_schema(section: &Section, definitions: &mut Map<String, Value>) -> Value {
    let mut properties = Map::new();
    for source in &section.sources {
        let mut schema = adopt(source.schema(), &source.name, definitions);
        if let Value::Object(schema) = &mut schema {
            schema.insert("description".to_owned(), json!(source.doc));
            if let (true, Some(Value::Object(properties))) = (source.seeded, schema.get_mut("properties")) {
                let doc = "What these are drawn from, in place of the pipeline's seed.";
                properties.insert("seed".to_owned(), seed_schema(doc));
            }
        }
        properties.insert(source.name.to_string(), schema);
    }
    let fold_number = json!({ "type": "integer", "minimum": 0 });
    let fold = json!({
        "type": "object",
        "description": "A part of a group above, whose members are dealt out by name: a fold, or all but that fold.",
        "required": ["of", "folds"],
        "properties": {
            "of": { "type": "string" },
            "folds": { "type": "integer", "minimum": 2 },
            "take": fold_number,
            "leave": fold_number
        },
        "oneOf": [{ "required": ["take"] }, { "required": ["leave"] }],
        "additionalProperties": false
    });
    properties.insert("fold".to_owned(), fold);
    let entry =
        json!({ "type": "object", "properties": properties, "additionalProperties": false, "minProperties": 1 });
    let name = format!("{}Source", section.noun);
    let reference = json!({ "$ref": format!("#/definitions/{name}") });
    definitions.insert(name, json!({ "anyOf": [entry, { "type": "string" }] }));
    json!({
        "type": "object",
        "description": format!("Named groups of {0}s, for `${1}.GROUP`; `${1}` are all of them.", section.noun, section.key),
        "additionalProperties": { "anyOf": [reference, { "type": "array", "items": reference, "minItems": 1 }] }
    })
}

/// Turns a schema of its own into a part of another: its definitions move there under names of their own, and what newer
/// drafts call otherwise gets the names of draft-07.
fn adopt(mut schema: Value, owner: &str, definitions: &mut Map<String, Value>) -> Value {
    let prefix = format!("{owner}.");
    rewrite(&mut schema, &prefix);
    if let Value::Object(object) = &mut schema {
        object.remove("$schema");
        object.remove("title");
        for name in ["$defs", "definitions"] {
            if let Some(Value::Object(own)) = object.remove(name) {
                definitions.extend(own.into_iter().map(|(name, schema)| (format!("{prefix}{name}"), schema)));
            }
        }
    }
    schema
}

fn rewrite(schema: &mut Value, prefix: &str) {
    match schema {
        Value::Array(items) => items.iter_mut().for_each(|item| rewrite(item, prefix)),
        Value::Object(object) => {
            if let Some(Value::String(reference)) = object.get_mut("$ref") {
                let name = reference.strip_prefix("#/$defs/").or_else(|| reference.strip_prefix("#/definitions/"));
                if let Some(name) = name {
                    *reference = format!("#/definitions/{prefix}{name}");
                }
            }
            // Draft-07 overlooks everything beside a `$ref`.
            if object.len() > 1
                && let Some(reference) = object.remove("$ref")
            {
                object.insert("allOf".to_owned(), json!([{ "$ref": reference }]));
            }
            if let Some(items) = object.remove("prefixItems") {
                let rest = object.remove("items");
                object.insert("items".to_owned(), items);
                object.extend(rest.map(|rest| ("additionalItems".to_owned(), rest)));
            }
            object.values_mut().for_each(|value| rewrite(value, prefix));
        }
        _ => {}
    }
}
