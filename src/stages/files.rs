//! The section `files:`: files of any kind, each as it is, for stages of one's own.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::{Value, json};

use super::{parse, refused};
use crate::pipeline::stage::{
    Context, Inputs, KindSpec, Needs, Output, ParameterError, Part, Section, Source, SourceNode, SourceType, Stage,
    StageError, StageSpec, Surroundings,
};
use crate::store::{Store, open_regular};

/// What helps when a file is not there.
const RELATIVE: &str = "a relative path starts at the folder of the file that names it";
const ROLE: &str = "file";

/// The section `files:`.
pub(super) fn section() -> Section {
    let doc = "Files as they are, by path or glob; each is named after itself, without its ending.";
    let schema = || json!({ "type": "object", "required": ["paths"], "properties": { "paths": paths_schema() } });
    let schema = move || json!({ "anyOf": [paths_schema(), schema()] });
    Section::new("files", "file", "paths").with(SourceType::new("paths", doc, expand, schema))
}

fn expand(value: &Value, surroundings: &Surroundings) -> Result<Vec<SourceNode>, ParameterError> {
    let folder = surroundings.folder;
    let mut nodes = Vec::new();
    for (at, pattern) in patterns(value)?.iter().enumerate() {
        let found = matching(pattern, folder, &|path| path.is_file());
        let found = found.map_err(|message| placed(at, value, message, Some(relative(pattern))))?;
        nodes.extend(found.into_iter().map(|path| {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let extension = path.extension().unwrap_or_default().to_string_lossy().into_owned();
            // An ending that is none becomes part of no name.
            let extension =
                if extension.bytes().all(|byte| byte.is_ascii_alphanumeric()) { extension } else { String::new() };
            let output = KindSpec { extension: Cow::Owned(extension), ..KindSpec::new("File", 1, "") };
            let spec = StageSpec::new("import-file", 1, Vec::new(), output, "Reads a file as it is.");
            SourceNode { name, spec: Arc::new(spec), stage: Arc::new(ImportFile { path }) }
        }));
    }
    Ok(nodes)
}

/// A file to read as it is.
#[derive(Debug)]
struct ImportFile {
    path: PathBuf,
}

impl Stage for ImportFile {
    fn parameters(&self) -> Value {
        json!({})
    }

    fn sources(&self) -> Result<Vec<Source>, StageError> {
        Ok(vec![Source { role: ROLE.to_owned(), path: self.path.clone() }])
    }

    fn needs(&self, _: Part, _: &Inputs, _: &Store) -> Needs {
        Needs { memory: 1 << 20, exclusive: false }
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (path, _) = &inputs.sources[ROLE];
        let read = |source| StageError::Source { path: path.clone(), source };
        let mut writer = context.store.create()?;
        std::io::copy(&mut open_regular(path).map_err(read)?, &mut writer).map_err(read)?;
        Ok(Output::File(writer.finish("")?))
    }
}

/// Reads a path, a list of paths, or either under `paths`.
pub(super) fn patterns(value: &Value) -> Result<Vec<String>, ParameterError> {
    match value {
        Value::String(path) => Ok(vec![path.clone()]),
        Value::Array(_) => parse(value),
        Value::Object(object) => match object.get("paths") {
            Some(paths) if !paths.is_object() => patterns(paths),
            _ => Err(refused("paths", "`paths` is missing")),
        },
        other => Err(refused_here(format!("expected a path, a list of paths or `{{ paths: … }}`, found `{other}`"))),
    }
}

/// The paths that a pattern stands for, in order, as far as they fit. What names a file or a folder that is there is no
/// pattern, whatever it looks like.
pub(super) fn matching(pattern: &str, folder: &Path, fits: &dyn Fn(&Path) -> bool) -> Result<Vec<PathBuf>, String> {
    let full = folder.join(pattern);
    if !pattern.contains(['*', '?', '[']) || full.symlink_metadata().is_ok() {
        return Ok(vec![full]);
    }
    // The folder is not part of the pattern, and may look like one.
    let folder = PathBuf::from(glob::Pattern::escape(&folder.to_string_lossy()));
    let wanted = folder.join(pattern);
    let paths = glob::glob(&wanted.to_string_lossy()).map_err(|error| format!("`{pattern}` is no pattern: {error}"))?;
    let found: Result<Vec<PathBuf>, glob::GlobError> = paths.collect();
    let mut found = found.map_err(|error| format!("failed to look for `{pattern}`: {error}"))?;
    found.retain(|path| fits(path));
    found.sort();
    if found.is_empty() { Err(format!("no file matches `{}`", full.display())) } else { Ok(found) }
}

pub(super) fn paths_schema() -> Value {
    json!({
        "description": "A path or glob, or a list of them; relative ones start at the folder of the pipeline file.",
        "anyOf": [{ "type": "string" }, { "type": "array", "items": { "type": "string" } }],
    })
}

/// Says where the paths of a pipeline file start.
pub(super) fn relative(pattern: &str) -> String {
    if pattern.starts_with('~') {
        return "`~` is not expanded: write `${HOME}` instead".to_owned();
    }
    RELATIVE.to_owned()
}

pub(super) fn refused_here(message: String) -> ParameterError {
    ParameterError { path: Vec::new(), message, help: None }
}
/// A refusal of the path at position `at`, wherever the list of paths stands.
pub(super) fn placed(at: usize, value: &Value, message: String, help: Option<String>) -> ParameterError {
    let (mut path, list) = match value {
        Value::Object(object) => (vec!["paths".to_owned()], object.get("paths").is_some_and(Value::is_array)),
        other => (Vec::new(), other.is_array()),
    };
    if list {
        path.push(at.to_string());
    }
    ParameterError { path, message, help }
}
