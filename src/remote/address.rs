//! Reads the address of a shared store: where it is, and never how one is let in.

use std::fmt;
use std::path::{Component, Path, PathBuf};

use url::Url;

use super::error::RemoteError;

/// Where a shared store is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address {
    /// As it was given, without a slash at the end.
    text: String,
    pub(super) place: Place,
}

/// What kind of place that is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Place {
    Folder(PathBuf),
    S3(Bucket),
    Gcs(Bucket),
    Azure(Bucket),
}

/// A bucket, or a container, and what the names in it begin with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Bucket {
    pub url: String,
    pub prefix: String,
}

impl Address {
    /// Reads an address: `s3://bucket/prefix`, `gs://…`, `az://…`, `file:///folder`, or a folder, which is taken from `base`.
    ///
    /// # Errors
    /// If it is none, or if it has credentials in it: it would be kept in records.
    pub fn read(text: &str, base: &Path) -> Result<Self, RemoteError> {
        let Some((scheme, _)) = text.split_once("://") else {
            if text.is_empty() {
                return Err(refused(text, "it is empty"));
            }
            return Self::folder(&base.join(text), text);
        };
        // Before anything of the text is repeated.
        let url = Url::parse(text).map_err(|error| refused(&format!("{scheme}://…"), error.to_string()))?;
        check_secrets(&url)?;
        let bucket = || Bucket { url: text.to_owned(), prefix: url.path().trim_matches('/').to_owned() };
        let place = match scheme {
            "file" => {
                let path =
                    url.to_file_path().map_err(|()| refused(text, "a folder is `file:///…`, with three slashes"))?;
                return Self::folder(&path, text);
            }
            _ if url.host_str().is_none_or(str::is_empty) => return Err(refused(text, "it names no bucket")),
            "s3" | "s3a" => Place::S3(bucket()),
            "gs" => Place::Gcs(bucket()),
            "az" | "azure" | "abfs" | "abfss" | "adl" => Place::Azure(bucket()),
            _ => return Err(refused(text, format!("nothing is known of `{scheme}://`"))),
        };
        Ok(Self { text: text.trim_end_matches('/').to_owned(), place })
    }

    fn folder(path: &Path, text: &str) -> Result<Self, RemoteError> {
        let path = std::path::absolute(path).map_err(|error| refused(text, error.to_string()))?;
        let path = resolved(&path);
        Ok(Self { text: path.display().to_string(), place: Place::Folder(path) })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// Follows links and goes up by `..` as far as a path exists; the rest may be made later.
fn resolved(path: &Path) -> PathBuf {
    match (std::fs::canonicalize(path), path.parent(), path.components().next_back()) {
        (Ok(found), ..) => found,
        (Err(_), Some(above), Some(Component::ParentDir)) => {
            let above = resolved(above);
            above.parent().map_or(above.clone(), Path::to_path_buf)
        }
        (Err(_), Some(above), Some(last)) => resolved(above).join(last),
        _ => path.to_path_buf(),
    }
}

fn refused(address: &str, why: impl Into<String>) -> RemoteError {
    RemoteError::Address { address: address.to_owned(), why: why.into() }
}

/// Refuses what may be a secret: a user, a password, and signatures, which stand behind a question mark.
fn check_secrets(url: &Url) -> Result<(), RemoteError> {
    let host = || url.host_str().unwrap_or_default().to_owned();
    // `abfss://container@account.…` is how Azure names a container.
    let names_container = url.scheme().starts_with("abfs") && url.password().is_none();
    if url.password().is_some() || !(url.username().is_empty() || names_container) {
        return Err(RemoteError::Secret { host: host(), what: "a user or a password" });
    }
    if url.query().is_some() || url.fragment().is_some() {
        return Err(RemoteError::Secret { host: host(), what: "a query, which may be a signature," });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: &str) {
        let read = Address::read(text, Path::new("/base"));
        let told = read.map_or_else(|error| error.to_string(), |address| format!("{:?}", address.place));
        assert_eq!(told, expected, "{text}");
    }

    #[test]
    fn addresses_name_buckets_and_folders() {
        check("s3://bucket/a/b/", r#"S3(Bucket { url: "s3://bucket/a/b/", prefix: "a/b" })"#);
        check("s3://bucket", r#"S3(Bucket { url: "s3://bucket", prefix: "" })"#);
        check("gs://bucket/x", r#"Gcs(Bucket { url: "gs://bucket/x", prefix: "x" })"#);
        check(
            "abfss://box@account.dfs.core.windows.net/x",
            r#"Azure(Bucket { url: "abfss://box@account.dfs.core.windows.net/x", prefix: "x" })"#,
        );
        check("file:///srv/shared", r#"Folder("/srv/shared")"#);
        check("shared", r#"Folder("/base/shared")"#);
        check("../a/../shared", r#"Folder("/shared")"#);
        check("/srv/shared", r#"Folder("/srv/shared")"#);
        check("", "`` is not the address of a shared store: it is empty");
        check("s3://", "`s3://` is not the address of a shared store: it names no bucket");
        check(
            "https://host/bucket",
            "`https://host/bucket` is not the address of a shared store: nothing is known of `https://`",
        );
        check(
            "file://host/shared",
            "`file://host/shared` is not the address of a shared store: a folder is `file:///…`, with three slashes",
        );
    }

    #[test]
    fn secrets_are_refused_and_not_repeated() {
        for text in [
            "s3://key:hush@bucket/a",
            "s3://hush@bucket/a",
            "az://box/a?sig=hush",
            "s3://bucket/a#hush",
            "abfss://box:hush@account/a",
        ] {
            let error = Address::read(text, Path::new("")).expect_err("it has a secret");
            assert!(matches!(error, RemoteError::Secret { .. }) && error.help().is_some(), "{error}");
            assert!(!error.to_string().contains("hush"), "{error}");
        }
    }
}
