//! What all stages have in common: parameters that are the stage itself, reading inputs and writing the output.

use std::sync::Arc;

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::domain::geometry::Frame;
use crate::kinds::{Kind, KindError, Written};
use crate::pipeline::stage::{
    Context, Entry, KindSpec, Needs, Output, ParameterError, Stage, StageError, StageSpec, Surroundings,
};
use crate::store::{Artifact, Digest};

/// A stage that is its own parameters.
pub(super) trait Definition: Stage + Serialize + DeserializeOwned + JsonSchema + 'static {
    /// Returns what is the same for every use.
    fn spec() -> StageSpec;

    /// The line of the register.
    fn entry() -> Entry {
        Entry::new(Self::spec(), parse_stage::<Self>, schema::<Self>)
    }

    /// Checks what types cannot say.
    ///
    /// # Errors
    /// [`ParameterError`] that names the parameter and its range.
    fn check(&self) -> Result<(), ParameterError> {
        Ok(())
    }
}

fn parse_stage<S: Definition>(value: &Value, _: &Surroundings) -> Result<Arc<dyn Stage>, ParameterError> {
    let stage: S = parse(value)?;
    stage.check()?;
    Ok(Arc::new(stage))
}

/// Reads parameters from JSON; an error names the way to the value.
pub(super) fn parse<T: DeserializeOwned>(value: &Value) -> Result<T, ParameterError> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let path = error.path().iter().map(ToString::to_string).filter(|segment| segment != "?").collect();
        ParameterError { path, message: error.into_inner().to_string(), help: None }
    })
}

pub(super) fn schema<T: JsonSchema>() -> Value {
    SchemaSettings::draft07().into_generator().into_root_schema_for::<T>().to_value()
}

/// A refusal of the parameter `field`.
pub(super) fn refused(field: &str, message: impl Into<String>) -> ParameterError {
    ParameterError { path: vec![field.to_owned()], message: message.into(), help: None }
}

/// A refusal by the domain, whose messages name the parameter first, in backticks.
pub(super) fn refused_setting(error: &dyn std::error::Error) -> ParameterError {
    let message = error.to_string();
    let field = message.split('`').nth(1).unwrap_or_default();
    ParameterError { path: field.split('.').map(str::to_owned).collect(), message, help: None }
}

/// Parameters as the JSON that enters recipes.
pub(super) fn to_json(parameters: &impl Serialize) -> Value {
    serde_json::to_value(parameters).expect("parameters are JSON")
}

/// A kind as the pipeline sees it.
pub(super) const fn kind<K: Kind>() -> KindSpec {
    KindSpec::new(K::NAME, K::FORMAT, K::EXTENSION).bulky(K::BULKY)
}

/// What a part asks for that holds so many bytes of its own, beside what every part does.
pub(super) const fn memory(bytes: u64) -> Needs {
    Needs { memory: (64_u64 << 20).saturating_add(bytes), exclusive: false }
}

/// Reads an artifact and hands back its digest too.
pub(super) fn read<K: Kind>(context: &Context, artifact: &Artifact) -> Result<(K, Digest), StageError> {
    Ok((K::read(context.store, artifact).map_err(kind_failed)?, artifact.digest))
}

/// Writes an artifact.
pub(super) fn write<K: Kind>(context: &Context, value: &K) -> Result<Output, StageError> {
    Ok(match value.write(context.store).map_err(kind_failed)? {
        Written::File(file) => Output::File(file),
        Written::Bundle(files) => Output::Bundle(files),
    })
}

pub(super) fn kind_failed(error: KindError) -> StageError {
    match error {
        KindError::Store(error) => StageError::Store(error),
        error => {
            let help = error.help();
            StageError::Failed { message: error.to_string(), help, source: Some(Box::new(error)) }
        }
    }
}

/// Checks that two inputs lie on the same map.
pub(super) fn same_frame(a_name: &str, a: &Frame, b_name: &str, b: &Frame) -> Result<(), StageError> {
    if a == b {
        return Ok(());
    }
    let size = |frame: &Frame| format!("{} × {} cells of {} m", frame.rows, frame.cols, frame.resolution);
    Err(StageError::Failed {
        message: format!("`{a_name}` ({}) and `{b_name}` ({}) do not lie on the same map", size(a), size(b)),
        help: Some("connect inputs that come from the same map".to_owned()),
        source: None,
    })
}
