//! Says what is wrong with a shared store, and what helps.

use std::time::Duration;

use crate::store::{Key, StoreError};

/// Why something could not be asked of a shared store.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum RemoteError {
    /// The address is none.
    #[error("`{address}` is not the address of a shared store: {why}")]
    Address { address: String, why: String },
    /// The address carries a secret, which would end up in records; it is not repeated here.
    #[error("the address of a shared store on `{host}` has {what} in it")]
    Secret { host: String, what: &'static str },
    /// This program was built without what the address needs.
    #[error("`{address}` needs a program that was built with the feature `{feature}`")]
    Feature { address: String, feature: &'static str },
    /// The settings of the environment are not right.
    #[error("the shared store `{address}` cannot be used: {why}")]
    Settings { address: String, why: String },
    /// A newer version of the program wrote it.
    #[error(
        "the shared store `{address}` was written by a newer version: it has format {found}, this program knows {known}"
    )]
    Newer { address: String, found: u64, known: u64 },
    /// Something else is there.
    #[error("`{address}` is not a shared store: {what}")]
    Foreign { address: String, what: String },
    /// It does not answer, or refuses to.
    #[error("the shared store `{address}` does not answer: {why}")]
    Away { address: String, why: String, help: Option<&'static str> },
    /// It may only be read.
    #[error("the shared store `{address}` takes nothing: {why}")]
    ReadOnly { address: String, why: String },
    /// No run of that id was given to it.
    #[error("the shared store `{address}` has no run `{id}`")]
    NoRun { address: String, id: String },
    /// Several runs begin like that.
    #[error("`{id}` may mean the runs {}", matches.join(", "))]
    AmbiguousRun { id: String, matches: Vec<String> },
    /// What is to be given is not on record here any more.
    #[error("the recipe `{key}` is not on record here any more")]
    Gone { key: Key },
    /// A record there is not what was written.
    #[error("the record of {what} in the shared store `{address}` is {how}")]
    Record { address: String, what: String, how: &'static str },
    /// The store here failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl RemoteError {
    /// Returns advice for a help line.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        Some(match self {
            Self::Address { .. } => {
                "write `s3://BUCKET/PREFIX`, `gs://BUCKET/PREFIX`, `az://CONTAINER/PREFIX`, or a folder; a server of your \
                 own that speaks S3 is named by the environment variable `AWS_ENDPOINT_URL`"
                    .to_owned()
            }
            Self::Secret { .. } => {
                "give credentials by the environment, such as `AWS_ACCESS_KEY_ID` and `AWS_SECRET_ACCESS_KEY`, or by the role \
                 of the machine: an address is kept in records that others read"
                    .to_owned()
            }
            Self::Feature { feature, .. } => format!("build it with `cargo build --release --features {feature}`"),
            Self::Newer { .. } => "use the newer program".to_owned(),
            Self::Foreign { .. } => "name an empty prefix or folder".to_owned(),
            Self::Away { help, .. } => return help.map(str::to_owned),
            Self::NoRun { .. } => "`trodden push --run ID`, where it ran, gives it one".to_owned(),
            Self::AmbiguousRun { .. } => "give more digits".to_owned(),
            Self::Store(error) => return error.help(),
            Self::Settings { .. } | Self::ReadOnly { .. } | Self::Record { .. } | Self::Gone { .. } => return None,
        })
    }
}

/// Why a request came to nothing.
#[derive(Debug)]
pub(super) enum Fault {
    /// There is nothing of that name.
    Absent,
    /// The right to do so is missing.
    Denied(String),
    /// Whoever asked for it does not want it any more.
    Interrupted,
    /// There was no answer, however often it was asked for.
    Away(String),
}

impl Fault {
    /// Makes one of a request that took too long.
    pub(super) fn timed_out(after: Duration) -> Self {
        Self::Away(format!("no answer within {} s", after.as_secs()))
    }
}

impl From<object_store::Error> for Fault {
    fn from(error: object_store::Error) -> Self {
        match &error {
            object_store::Error::NotFound { .. } => Self::Absent,
            object_store::Error::PermissionDenied { .. } | object_store::Error::Unauthenticated { .. } => {
                Self::Denied(told(&error))
            }
            _ => Self::Away(told(&error)),
        }
    }
}

/// Writes an error in a line of bearable length: what was tried, and the innermost cause.
pub(super) fn told(error: &(dyn std::error::Error + 'static)) -> String {
    const LONGEST: usize = 400;
    let causes: Vec<String> =
        std::iter::successors(Some(error), |error| error.source()).map(ToString::to_string).collect();
    // The outer ones only say `Generic S3 error: ` before all that stands below.
    let tried = causes.iter().find(|cause| !cause.starts_with("Generic ")).unwrap_or(&causes[0]);
    let innermost = &causes[causes.len() - 1];
    let text = if tried.contains(innermost.as_str()) { tried.clone() } else { format!("{tried}: {innermost}") };
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{} …", &text[..end]),
        None => text,
    }
}
