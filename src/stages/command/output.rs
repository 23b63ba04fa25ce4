//! What a command is to write, and whether it has.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Seek};
use std::path::Path;
use std::sync::Arc;

use arrow::datatypes::DataType;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::kinds::Outline;
use crate::pipeline::stage::{KindSpec, KindType, Output, ParameterError, Register, StageError};
use crate::store::{Artifact, FileRef, Store};

/// What comes out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(super) enum Form {
    /// One Parquet file.
    Parquet,
    /// Files by name.
    Files,
}

/// The field `output`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum OutputField {
    /// `parquet`: one table; `files`: whatever files.
    Short(Form),
    /// What comes out, and what it is.
    Long(LongOutput),
}

/// What comes out, and what it is.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LongOutput {
    /// `parquet`: one table; `files`: whatever files.
    #[serde(rename = "as")]
    form: Form,
    /// The kind of the artifact: one of ours, such as `Heat`, so that stages take it that ask for that kind (it is read and
    /// checked), or a name of your own [Table or Files].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    kind: Option<String>,
    /// The columns that a table must have, no more and no less, by name with their types: `int64`, `float64`, `string`,
    /// `boolean`, …
    #[serde(default, skip_serializing_if = "Option::is_none")]
    columns: Option<BTreeMap<String, String>>,
}

/// What comes out, checked.
#[derive(Debug, Clone)]
pub(super) struct Wanted {
    pub form: Form,
    pub kind: KindSpec,
    columns: Option<Vec<(String, DataType)>>,
    /// What is known of the kind.
    known: Option<Arc<dyn KindType>>,
}

impl Wanted {
    /// Reads the field.
    pub(super) fn read(field: &OutputField, register: &Register) -> Result<Self, ParameterError> {
        let (form, kind, columns) = match field {
            OutputField::Short(form) => (*form, None, None),
            OutputField::Long(LongOutput { form, kind, columns }) => (*form, kind.as_deref(), columns.as_ref()),
        };
        let refused = |field: &str, message: String, help: Option<&str>| ParameterError {
            path: vec!["output".to_owned(), field.to_owned()],
            message,
            help: help.map(str::to_owned),
        };
        let (name, extension) = match form {
            Form::Parquet => ("Table", "parquet"),
            Form::Files => ("Files", ""),
        };
        let known = kind.and_then(|kind| register.kind(kind)).cloned();
        let kind = match kind {
            None => KindSpec::new(name, 1, extension),
            Some(kind) => match known.as_ref().map(|known| known.spec()) {
                Some(known) if known.extension == extension => known,
                Some(known) => {
                    let form = if known.extension.is_empty() { "files" } else { "parquet" };
                    return Err(refused("as", format!("`{kind}` is made as `{form}`"), None));
                }
                None if kind.chars().next().is_some_and(char::is_alphabetic)
                    && kind.chars().all(|letter| letter.is_alphanumeric() || letter == '_') =>
                {
                    KindSpec { name: kind.to_owned().into(), ..KindSpec::new(name, 1, extension) }
                }
                None => {
                    let help = "start with a letter; letters, digits and `_` may follow";
                    return Err(refused("kind", format!("`{kind}` cannot be the name of a kind"), Some(help)));
                }
            },
        };
        if columns.is_some() && form == Form::Files {
            return Err(refused("columns", "`columns` are those of a table".to_owned(), Some("write `as: parquet`")));
        }
        let read = |(name, text): (&String, &String)| match data_type(text) {
            Some(data) => Ok((name.clone(), data)),
            None => {
                let help = "known are int8 to int64, uint8 to uint64, float32, float64, boolean, string, date32 and \
                            what Arrow calls them, such as `Timestamp(Microsecond, None)`";
                Err(refused("columns", format!("`{text}`, the type of `{name}`, is not known"), Some(help)))
            }
        };
        let columns = columns.map(|columns| columns.iter().map(read).collect::<Result<_, _>>()).transpose()?;
        Ok(Self { form, kind, columns, known })
    }

    /// Returns what the command has to write to, below its working directory.
    pub(super) const fn name(&self) -> &'static str {
        match self.form {
            Form::Parquet => "output.parquet",
            Form::Files => "output",
        }
    }

    /// Takes what the command has written into the store.
    ///
    /// # Errors
    /// If it is not what it should be; the message is a fragment.
    pub(super) fn take(&self, path: &Path, store: &Store) -> Result<Output, StageError> {
        let output = match self.form {
            Form::Parquet => Output::File(self.take_table(path, store)?),
            Form::Files => Output::Bundle(take_files(path, store)?),
        };
        if let Some(kind) = &self.known {
            let artifact = match &output {
                Output::File(file) => Artifact::single(file.clone()),
                Output::Bundle(files) => store.bundle(&self.kind.name, self.kind.format, files.clone())?,
            };
            kind.check(store, &artifact).map_err(|error| {
                let message = format!("what the command wrote is no `{}`: {error}", self.kind.name);
                failed(message, "write it as the stage does that makes this kind, or declare another `kind`")
            })?;
        }
        Ok(output)
    }

    fn take_table(&self, path: &Path, store: &Store) -> Result<FileRef, StageError> {
        let mut file = File::open(path).map_err(|error| not_written(path, error))?;
        let found = Outline::read(&file).ok_or_else(|| {
            let message = format!("what the command wrote to `{}` is no Parquet file", self.name());
            failed(message, "write one, or declare `output: files`")
        })?;
        if let Some(wanted) = &self.columns {
            check_columns(wanted, &found.columns)?;
        }
        put(&mut file, "", path, store)
    }
}

/// Reads the name of a type, as Arrow or as data frames have it.
fn data_type(text: &str) -> Option<DataType> {
    Some(match text {
        "int8" => DataType::Int8,
        "int16" => DataType::Int16,
        "int32" => DataType::Int32,
        "int64" | "int" => DataType::Int64,
        "uint8" => DataType::UInt8,
        "uint16" => DataType::UInt16,
        "uint32" => DataType::UInt32,
        "uint64" => DataType::UInt64,
        "float32" => DataType::Float32,
        "float64" | "float" | "double" => DataType::Float64,
        "boolean" | "bool" => DataType::Boolean,
        "string" | "utf8" | "str" => DataType::Utf8,
        "date32" | "date" => DataType::Date32,
        other => other.parse().ok()?,
    })
}

/// Makes sure that a table has these columns and no others.
fn check_columns(wanted: &[(String, DataType)], found: &[(String, DataType)]) -> Result<(), StageError> {
    // Writers differ in how long a text may get; readers do not mind.
    let plain = |data: &DataType| match data {
        DataType::LargeUtf8 | DataType::Utf8View => DataType::Utf8,
        other => other.clone(),
    };
    let of = |columns: &[(String, DataType)], name: &str| {
        columns.iter().find(|(column, _)| column == name).map(|(_, data)| plain(data))
    };
    let mut wrong = Vec::new();
    for (name, data) in wanted {
        match of(found, name) {
            None => wrong.push(format!("`{name}` is missing")),
            Some(other) if other != plain(data) => {
                wrong.push(format!("`{name}` is of type {other}, declared is {}", plain(data)));
            }
            Some(_) => {}
        }
    }
    let undeclared = found.iter().filter(|(name, _)| of(wanted, name).is_none());
    wrong.extend(undeclared.map(|(name, _)| format!("`{name}` is not declared")));
    if wrong.is_empty() {
        return Ok(());
    }
    let message = format!("the table that the command wrote has other columns: {}", wrong.join(", "));
    Err(failed(message, "mend the command, or `columns` of `output`"))
}

/// Takes all files of a folder; folders in it are refused, as artifacts are flat.
fn take_files(path: &Path, store: &Store) -> Result<Vec<FileRef>, StageError> {
    let read = |error| StageError::Source { path: path.to_path_buf(), source: error };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(path).map_err(|error| not_written(path, error))? {
        let entry = entry.map_err(read)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        // Through links: what counts is the content.
        if !entry.path().metadata().map_err(read)?.is_file() {
            let message = format!("`{name}` in the folder that the command wrote is no file");
            return Err(failed(message, "write files without folders, or pack them into one"));
        }
        let mut file = File::open(entry.path()).map_err(read)?;
        files.push(put(&mut file, &name, &entry.path(), store)?);
    }
    if files.is_empty() {
        let message = "the command wrote nothing into the folder `output`".to_owned();
        return Err(failed(message, "its place is in `{output}` and in the variable `TRODDEN_OUTPUT`"));
    }
    Ok(files)
}

fn put(file: &mut File, name: &str, path: &Path, store: &Store) -> Result<FileRef, StageError> {
    let mut writer = store.create()?;
    let copied = file.rewind().and_then(|()| io::copy(file, &mut writer));
    copied.map_err(|source| StageError::Source { path: path.to_path_buf(), source })?;
    Ok(writer.finish(name)?)
}

fn not_written(path: &Path, error: io::Error) -> StageError {
    if error.kind() != io::ErrorKind::NotFound {
        return StageError::Source { path: path.to_path_buf(), source: error };
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let message = format!("the command ended well, but wrote no `{name}`");
    failed(message, "its place is in `{output}` and in the variable `TRODDEN_OUTPUT`")
}

fn failed(message: String, help: &str) -> StageError {
    StageError::Failed { message, help: Some(help.to_owned()), source: None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_compared() {
        let column = |name: &str, data: DataType| (name.to_owned(), data);
        let wanted = [column("day", DataType::Utf8), column("mean", DataType::Float64)];
        let check = |found: &[(String, DataType)]| check_columns(&wanted, found).map_err(|error| error.to_string());
        let good = [column("mean", DataType::Float64), column("day", DataType::LargeUtf8)];
        assert_eq!(check(&good), Ok(()));
        let other = [column("mean", DataType::Float32), column("n", DataType::Int64)];
        let expected = "the table that the command wrote has other columns: `day` is missing, `mean` is of type Float32, \
                        declared is Float64, `n` is not declared";
        assert_eq!(check(&other), Err(expected.to_owned()));
    }

    #[test]
    fn types_have_names() {
        assert_eq!(data_type("int64"), Some(DataType::Int64));
        assert_eq!(data_type("Float32"), Some(DataType::Float32));
        assert_eq!(data_type("List(Int8)").is_some(), "List(Int8)".parse::<DataType>().is_ok());
        assert_eq!(data_type("number"), None);
    }
}
