//! Why a value could not be stored or read back.

use crate::store::StoreError;

/// What went wrong between a value and its bytes.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum KindError {
    /// The store could not keep or find the bytes.
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("failed to encode `{kind}` as Parquet")]
    Encode {
        kind: &'static str,
        #[source]
        source: parquet::errors::ParquetError,
    },
    #[error("the Parquet file of `{kind}` is damaged")]
    Decode {
        kind: &'static str,
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    #[error("the file holds no `{expected}`: its metadata name no kind")]
    NoKind { expected: &'static str },
    #[error("the file holds `{found}`, expected was `{expected}`")]
    WrongKind { expected: &'static str, found: String },
    #[error("`{kind}` is of format {found}, this version of trodden reads format {known}")]
    Format { kind: &'static str, found: u32, known: u32 },
    #[error("`{kind}` has no metadata `{key}`")]
    MissingMetadata { kind: &'static str, key: String },
    #[error("the metadata `{key}` of `{kind}` are `{value}`, expected was {expected}")]
    Metadata { kind: &'static str, key: String, value: String, expected: &'static str },
    #[error("`{kind}` has no column `{column}`")]
    MissingColumn { kind: &'static str, column: String },
    #[error("the column `{column}` of `{kind}` is of type {found}, expected was {expected}")]
    ColumnType { kind: &'static str, column: String, found: String, expected: String },
    #[error("the column `{column}` of `{kind}` holds `{value}` in row {row}, expected was {expected}")]
    Value { kind: &'static str, column: String, row: usize, value: String, expected: String },
    #[error("`{kind}` has {found} rows, its metadata tell {expected}")]
    Rows { kind: &'static str, found: usize, expected: usize },
    #[error("`{kind}` does not fit together: {what}")]
    Shape { kind: &'static str, what: String },
    #[error("`{kind}` has no file `{file}`")]
    MissingFile { kind: &'static str, file: String },
    #[error("the file `{file}` of `{kind}` is damaged")]
    Damaged {
        kind: &'static str,
        file: &'static str,
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl KindError {
    /// Returns advice for a help line, if there is any.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        match self {
            Self::Store(_) | Self::Encode { .. } => None,
            Self::Format { found, known, .. } if found > known => Some(
                "a newer version of trodden wrote it: use that version, or another store (`--store DIR`)".to_owned(),
            ),
            Self::Format { .. } => Some("an older version of trodden wrote it: run the pipeline again".to_owned()),
            Self::NoKind { .. } | Self::WrongKind { .. } => {
                Some("give the file of a node whose kind fits; `trodden ls` lists nodes and kinds".to_owned())
            }
            Self::Value { .. } | Self::Shape { .. } => Some(
                "a stage made it from its inputs: look at these with `trodden show`, or report it if they are fine"
                    .to_owned(),
            ),
            _ => Some("`trodden verify` sets damaged objects aside; the next run makes them again".to_owned()),
        }
    }
}
