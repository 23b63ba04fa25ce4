//! The sources of maps that a pipeline file may name under `maps:`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::files::{patterns, placed, refused_here, relative};
use super::generate_map::{self, Drawing, GenerateMap};
use super::import_map::{self, ImportMap};
use super::map_origin::Origin;
use super::{parse, schema};
use crate::domain::homes::buildings::BuildingConfig;
use crate::domain::homes::{HomeConfig, HomeKind};
use crate::domain::map::{ImportConfig, MapForm, MapImportError, igibson_floor};
use crate::pipeline::stage::{ParameterError, Section, SourceNode, SourceType, StageError, StageSpec, Surroundings};

/// The section `maps:`.
pub(super) fn section() -> Section {
    let files_doc = "Maps of ROS `map_server` (their YAML files), plain images and floor plans (buildings of Open-RMF, DXF, \
                     SVG, WKT, GeoJSON), by path or glob.";
    let igibson_doc = "Folders of iGibson scenes, by path or glob; what else matches a glob is passed over.";
    let buildings_doc =
        "Generated buildings `building_00`, `building_01`, … of many kinds, as maps or scans show them.";
    let drawn = |name, doc, kind, prefix| {
        let expand = move |value: &Value, _: &Surroundings| homes(value, kind, prefix);
        SourceType::new(name, doc, expand, homes_schema).seeded()
    };
    let filed = |name, doc, form| {
        let expand = move |value: &Value, surroundings: &Surroundings| files(value, surroundings.folder, form);
        SourceType::new(name, doc, expand, files_schema)
    };
    Section::new("maps", "map", "files")
        .with(drawn("homes", "Generated homes `home_00`, `home_01`, …", HomeKind::Home, "home"))
        .with(drawn("offices", "Generated offices `office_00`, `office_01`, …", HomeKind::Office, "office"))
        .with(SourceType::new("buildings", buildings_doc, |value, _| buildings(value), buildings_schema).seeded())
        .with(filed("files", files_doc, MapForm::Ros))
        .with(filed("igibson", igibson_doc, MapForm::Igibson))
}

/// Which maps of a series to generate.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
struct Series {
    /// How many.
    #[schemars(range(min = 1, max = 100_000))]
    count: u32,
    /// Number of the first one; the number decides what is drawn.
    #[serde(default)]
    first: u32,
}

fn homes(value: &Value, of: HomeKind, prefix: &str) -> Result<Vec<SourceNode>, ParameterError> {
    let (series, settings) = series(value)?;
    let mut config: HomeConfig = parse(&settings)?;
    config.kind = of;
    config.check().map_err(|error| super::refused_setting(&error))?;
    series.nodes(prefix, &Drawing::Home(config))
}

fn buildings(value: &Value) -> Result<Vec<SourceNode>, ParameterError> {
    let (series, settings) = series(value)?;
    let config: BuildingConfig = parse(&settings)?;
    config.check().map_err(|error| super::refused_setting(&error))?;
    series.nodes("building", &Drawing::Building(config))
}

/// Tells which maps of a series are wanted from how they are drawn.
fn series(value: &Value) -> Result<(Series, Value), ParameterError> {
    let Value::Object(fields) = value else {
        return Err(refused_here(format!("expected `{{ count: 12 }}`, found `{value}`")));
    };
    let (series, rest): (Vec<_>, Vec<_>) =
        fields.clone().into_iter().partition(|(key, _)| key == "count" || key == "first");
    Ok((parse(&Value::Object(series.into_iter().collect()))?, Value::Object(rest.into_iter().collect())))
}

impl Series {
    fn nodes(&self, prefix: &str, drawing: &Drawing) -> Result<Vec<SourceNode>, ParameterError> {
        if !(1..=100_000).contains(&self.count) {
            return Err(super::refused("count", format!("`count` is {}, allowed are 1 to 100,000", self.count)));
        }
        let last = self.first.checked_add(self.count).ok_or_else(|| super::refused("first", "`first` is too large"))?;
        let spec = Arc::new(generate_map::spec());
        let node = |number: u32| SourceNode {
            name: format!("{prefix}_{number:02}"),
            spec: Arc::clone(&spec),
            stage: Arc::new(GenerateMap::new(number, drawing.clone())),
        };
        Ok((self.first..last).map(node).collect())
    }
}

fn homes_schema() -> Value {
    let mut whole = schema::<HomeConfig>();
    if let Some(properties) = whole.get_mut("properties").and_then(Value::as_object_mut) {
        // The key of the source says which kind it is.
        properties.remove("kind");
    }
    series_schema(whole)
}

fn buildings_schema() -> Value {
    series_schema(schema::<BuildingConfig>())
}

/// Adds which maps are wanted to how they are drawn.
fn series_schema(mut whole: Value) -> Value {
    let series = schema::<Series>();
    if let Some(properties) = whole.get_mut("properties").and_then(Value::as_object_mut) {
        properties.extend(series["properties"].as_object().cloned().unwrap_or_default());
    }
    whole["required"] = serde_json::json!(["count"]);
    whole
}

/// One path, many, or paths with the way to read them.
fn files(value: &Value, folder: &Path, form: MapForm) -> Result<Vec<SourceNode>, ParameterError> {
    let (paths, config) = match value {
        Value::Object(object) => {
            let mut rest = object.clone();
            let paths = rest.remove("paths").ok_or_else(|| super::refused("paths", "`paths` is missing"))?;
            (paths, parse::<ImportConfig>(&Value::Object(rest))?)
        }
        other => (other.clone(), ImportConfig::default()),
    };
    config.check().map_err(|error| super::refused_setting(&error))?;
    let patterns = patterns(&paths)?;
    let (mut nodes, mut forms) = (Vec::new(), Vec::new());
    let spec = Arc::new(import_map::spec());
    for (at, pattern) in patterns.iter().enumerate() {
        let found = matching(pattern, folder, form);
        for path in found.map_err(|message| placed(at, value, message, Some(relative(pattern))))? {
            let node = node(&path, &config, &spec, &mut forms);
            nodes.push(node.map_err(|error| refused_file(at, value, pattern, error))?);
        }
    }
    check_forms(&config, &forms)?;
    Ok(nodes)
}

fn node(
    path: &Path,
    config: &ImportConfig,
    spec: &Arc<StageSpec>,
    forms: &mut Vec<MapForm>,
) -> Result<SourceNode, StageError> {
    let origin = Origin::of(path, config)?;
    forms.push(origin.form());
    let name = origin.map_name();
    let stage = ImportMap::new(origin, config.clone())?;
    Ok(SourceNode { name, spec: Arc::clone(spec), stage: Arc::new(stage) })
}

/// Refuses a setting that none of the maps has a use for.
fn check_forms(config: &ImportConfig, forms: &[MapForm]) -> Result<(), ParameterError> {
    let unfit: Vec<Vec<&str>> = forms.iter().map(|form| config.unfit(*form)).collect();
    let Some(field) =
        unfit.first().and_then(|first| first.iter().find(|field| unfit.iter().all(|u| u.contains(field))))
    else {
        return Ok(());
    };
    let error = MapImportError::Unfit { field, form: forms[0] };
    Err(ParameterError { help: import_map::help(&error), ..super::refused(field, error.to_string()) })
}

/// The maps that a pattern stands for, in order.
fn matching(pattern: &str, folder: &Path, form: MapForm) -> Result<Vec<PathBuf>, String> {
    let is_scene = |path: &Path| {
        path.is_dir() || path.file_name().is_some_and(|name| igibson_floor(&name.to_string_lossy()).is_some())
    };
    super::files::matching(pattern, folder, &|path| form != MapForm::Igibson || is_scene(path))
}

fn refused_file(at: usize, value: &Value, pattern: &str, error: StageError) -> ParameterError {
    match error {
        StageError::Source { path, source } => {
            placed(at, value, format!("failed to read `{}`: {source}", path.display()), Some(relative(pattern)))
        }
        StageError::Failed { message, help, .. } => placed(at, value, message, help),
        other => placed(at, value, other.to_string(), None),
    }
}

fn files_schema() -> Value {
    let mut object = schema::<ImportConfig>();
    let paths = super::files::paths_schema();
    let options = object.as_object_mut().expect("the schema of a structure");
    options.remove("$schema");
    if let Some(properties) = options.get_mut("properties").and_then(Value::as_object_mut) {
        properties.insert("paths".to_owned(), paths.clone());
    }
    options.insert("required".to_owned(), serde_json::json!(["paths"]));
    serde_json::json!({ "anyOf": [paths["anyOf"][0].clone(), paths["anyOf"][1].clone(), object] })
}
