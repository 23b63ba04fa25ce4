//! The stages, sources and kinds that a program has.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use serde_json::Value;

use super::{KindType, ParameterError, Port, Stage, StageSpec};

/// What surrounds the parameters that a use of a stage, or a source, has in the pipeline file.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    /// The folder of the pipeline file: relative paths start there.
    pub folder: &'a Path,
    /// The inputs that a use of an [open](StageSpec::open) stage names, each with a reference.
    pub inputs: &'a [Port],
    /// All stages, sources and kinds.
    pub register: &'a Register,
    /// The environment's variables.
    pub variables: &'a BTreeMap<String, String>,
}

type Parse = dyn Fn(&Value, &Surroundings) -> Result<Arc<dyn Stage>, ParameterError> + Send + Sync;
type Expand = dyn Fn(&Value, &Surroundings) -> Result<Vec<SourceNode>, ParameterError> + Send + Sync;
type Schema = dyn Fn() -> Value + Send + Sync;

/// A stage of the register.
#[derive(Clone)]
pub struct Entry {
    /// What is the same for every use of the stage.
    pub spec: Arc<StageSpec>,
    parse: Arc<Parse>,
    schema: Arc<Schema>,
}

impl Entry {
    /// Describes a stage: what every use has in common, how the parameters of a use are read (a JSON object without `use`,
    /// `seed` and the ports), and their JSON Schema.
    pub fn new(
        spec: StageSpec,
        parse: impl Fn(&Value, &Surroundings) -> Result<Arc<dyn Stage>, ParameterError> + Send + Sync + 'static,
        schema: impl Fn() -> Value + Send + Sync + 'static,
    ) -> Self {
        Self { spec: Arc::new(spec), parse: Arc::new(parse), schema: Arc::new(schema) }
    }

    /// Reads and checks the parameters of a use.
    ///
    /// # Errors
    /// [`ParameterError`] that names the parameter.
    pub fn parse(&self, value: &Value, surroundings: &Surroundings) -> Result<Arc<dyn Stage>, ParameterError> {
        (self.parse)(value, surroundings)
    }

    /// Returns the JSON Schema of the parameters.
    #[must_use]
    pub fn schema(&self) -> Value {
        (self.schema)()
    }
}

/// A part of the pipeline file that names groups of what the pipeline starts from: `maps:` with its groups of maps.
///
/// Each group expands to nodes of stages without ports, `KEY/NAME`; ports refer to them as `$KEY` or `$KEY.GROUP`.
#[derive(Clone)]
pub struct Section {
    /// The key in the file, such as `maps`.
    pub key: Cow<'static, str>,
    /// What one of its members is called, such as `map`.
    pub noun: Cow<'static, str>,
    /// What a group may be made of.
    pub sources: Vec<SourceType>,
    /// Name of the source that takes a group that is a path or a list of paths.
    pub plain: Cow<'static, str>,
}

impl Section {
    /// Begins a section without sources.
    #[must_use]
    pub fn new(key: &'static str, noun: &'static str, plain: &'static str) -> Self {
        let (key, noun, plain) = (Cow::Borrowed(key), Cow::Borrowed(noun), Cow::Borrowed(plain));
        Self { key, noun, sources: Vec::new(), plain }
    }

    /// Adds a source.
    #[must_use]
    pub fn with(mut self, source: SourceType) -> Self {
        self.sources.push(source);
        self
    }
}

/// A source of a section: `{ homes: { count: 12 } }`, `{ files: "maps/*.yaml" }`, …
///
/// It expands one entry of a group into named nodes of stages without ports.
#[derive(Clone)]
pub struct SourceType {
    /// The key, such as `homes` or `files`.
    pub name: Cow<'static, str>,
    /// What it does, in a sentence.
    pub doc: Cow<'static, str>,
    /// Whether its nodes draw random numbers: then an entry that is a mapping may name a `seed` of its own.
    pub seeded: bool,
    expand: Arc<Expand>,
    schema: Arc<Schema>,
}

impl SourceType {
    /// Describes a source: key, purpose, how a value expands to nodes (the values of environment variables have been put in
    /// already) and its JSON Schema.
    pub fn new(
        name: &'static str,
        doc: &'static str,
        expand: impl Fn(&Value, &Surroundings) -> Result<Vec<SourceNode>, ParameterError> + Send + Sync + 'static,
        schema: impl Fn() -> Value + Send + Sync + 'static,
    ) -> Self {
        let (name, doc) = (Cow::Borrowed(name), Cow::Borrowed(doc));
        Self { name, doc, seeded: false, expand: Arc::new(expand), schema: Arc::new(schema) }
    }

    /// Says that its nodes draw random numbers.
    #[must_use]
    pub fn seeded(self) -> Self {
        Self { seeded: true, ..self }
    }

    /// Expands the value of an entry.
    ///
    /// # Errors
    /// [`ParameterError`] that names the parameter.
    pub fn expand(&self, value: &Value, surroundings: &Surroundings) -> Result<Vec<SourceNode>, ParameterError> {
        (self.expand)(value, surroundings)
    }

    /// Returns the JSON Schema of the value.
    #[must_use]
    pub fn schema(&self) -> Value {
        (self.schema)()
    }
}

/// A node that a [`SourceType`] yields.
pub struct SourceNode {
    /// Name of the member.
    pub name: String,
    /// What is the same for every use of its stage.
    pub spec: Arc<StageSpec>,
    /// The stage with its parameters.
    pub stage: Arc<dyn Stage>,
}

/// All stages, sources and kinds of a program.
#[derive(Clone, Default)]
pub struct Register {
    /// The stages.
    pub stages: Vec<Entry>,
    /// The sections of the pipeline file that name what it starts from.
    pub sections: Vec<Section>,
    /// The kinds that can be checked and summed up.
    pub kinds: Vec<Arc<dyn KindType>>,
}

impl Register {
    /// Adds a stage, or takes the place of the one of that name.
    #[must_use]
    pub fn with_stage(mut self, entry: Entry) -> Self {
        self.stages.retain(|have| have.spec.name != entry.spec.name);
        self.stages.push(entry);
        self
    }

    /// Adds a section; if there is one of that key, its sources join those.
    #[must_use]
    pub fn with_section(mut self, section: Section) -> Self {
        match self.sections.iter_mut().find(|have| have.key == section.key) {
            Some(have) => {
                have.sources.retain(|source| section.sources.iter().all(|new| new.name != source.name));
                have.sources.extend(section.sources);
            }
            None => self.sections.push(section),
        }
        self
    }

    /// Adds a kind, or takes the place of the one of that name.
    #[must_use]
    pub fn with_kind(mut self, kind: impl KindType + 'static) -> Self {
        self.kinds.retain(|have| have.spec().name != kind.spec().name);
        self.kinds.push(Arc::new(kind));
        self
    }

    /// Returns a kind by its name.
    #[must_use]
    pub fn kind(&self, name: &str) -> Option<&Arc<dyn KindType>> {
        self.kinds.iter().find(|kind| kind.spec().name == name)
    }
}
