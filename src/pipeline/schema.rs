//! The JSON Schema (draft-07) of the pipeline file, for editors: built from the register's own schemas.

use serde_json::{Map, Value, json};

use super::stage::{Arity, Entry, MapSource, Port, Register};

/// Returns the schema of a whole pipeline file.
#[must_use]
pub fn schema(register: &Register) -> Value {
    let mut definitions = Map::new();
    let uses: Vec<Value> = register.stages.iter().map(|entry| stage_schema(entry, &mut definitions)).collect();
    let source = source_schema(register.maps, &mut definitions);
    definitions.insert("mapSource".to_owned(), source);
    definitions.insert("stage".to_owned(), json!({ "oneOf": uses }));
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "trodden pipeline",
        "type": "object",
        "required": ["stages"],
        "properties": {
            "name": {
                "type": "string",
                "pattern": "^[A-Za-z_][A-Za-z0-9_-]*$",
                "description": "Name of the pipeline; by default that of its file."
            },
            "seed": seed_schema("What every stage that draws random numbers starts from, unless it names a seed of its own [0]."),
            "store": {
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
            },
            "maps": {
                "type": "object",
                "description": "Named groups of maps, for `$maps.GROUP`; `$maps` are all of them.",
                "additionalProperties": {
                    "anyOf": [
                        { "$ref": "#/definitions/mapSource" },
                        { "type": "array", "items": { "$ref": "#/definitions/mapSource" }, "minItems": 1 }
                    ]
                }
            },
            "stages": {
                "type": "object",
                "description": "Named uses of stages; a port takes `$maps`, `$maps.GROUP`, `STAGE` or `STAGE.GROUP`.",
                "additionalProperties": { "$ref": "#/definitions/stage" }
            }
        },
        "definitions": definitions
    })
}

/// Returns the schema of one use of a stage.
fn stage_schema(entry: &Entry, definitions: &mut Map<String, Value>) -> Value {
    let mut own = adopt((entry.schema)(), entry.spec.name, definitions);
    let mut properties = Map::new();
    properties.insert("use".to_owned(), json!({ "const": entry.spec.name, "description": entry.spec.doc }));
    for port in entry.spec.ports {
        properties.insert(port.name.to_owned(), port_schema(port));
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
    let takes = match port.arity {
        Arity::One => format!("{} Takes {}.", port.doc, port.kind),
        Arity::Optional => format!("{} Takes {}; may be left out.", port.doc, port.kind),
        Arity::Group => format!("{} Takes {} of a whole group.", port.doc, port.kind),
        Arity::OptionalGroup => format!("{} Takes {} of a whole group; may be left out.", port.doc, port.kind),
        Arity::GroupOr(other) => {
            format!("{} Takes {} of a whole group; in the place of `{other}`.", port.doc, port.kind)
        }
    };
    let pattern = r"^(\$maps|[A-Za-z_][A-Za-z0-9_-]*)(\.[A-Za-z_][A-Za-z0-9_-]*)?$";
    json!({ "type": "string", "pattern": pattern, "description": takes })
}

fn source_schema(sources: &[MapSource], definitions: &mut Map<String, Value>) -> Value {
    let mut properties = Map::new();
    for source in sources {
        let mut schema = adopt((source.schema)(), source.name, definitions);
        if let Value::Object(schema) = &mut schema {
            schema.insert("description".to_owned(), json!(source.doc));
            if let (true, Some(Value::Object(properties))) = (source.seeded, schema.get_mut("properties")) {
                let doc = "What these maps are drawn from, in place of the pipeline's seed.";
                properties.insert("seed".to_owned(), seed_schema(doc));
            }
        }
        properties.insert(source.name.to_owned(), schema);
    }
    json!({ "type": "object", "properties": properties, "additionalProperties": false, "minProperties": 1 })
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
