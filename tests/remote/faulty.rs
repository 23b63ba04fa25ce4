//! A shared store in memory that goes wrong when it is told to.

use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use async_trait::async_trait;
use futures_util::stream::{self, BoxStream, StreamExt};
use object_store::memory::InMemory;
use object_store::path::Path;
use object_store::{
    CopyOptions, Error, GetOptions, GetResult, GetResultPayload, ListResult, MultipartUpload, ObjectMeta, ObjectStore,
    PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// There is no answer that helps.
    Away,
    /// The right is missing.
    Denied,
    /// What is read has a byte flipped.
    Lies,
    /// What is read breaks off in the middle.
    Cut,
    /// There is no answer at all.
    Hangs,
}

/// What is asked for: the verb and the name.
type Rule = dyn Fn(&str, &str, usize) -> Option<Fault> + Send + Sync;

/// Objects in memory, and what goes wrong with them.
pub struct Faulty {
    pub inner: InMemory,
    rule: Mutex<Arc<Rule>>,
    requests: AtomicUsize,
}

impl fmt::Debug for Faulty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Faulty")
    }
}

impl fmt::Display for Faulty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Faulty")
    }
}

impl Faulty {
    pub fn new() -> Arc<Self> {
        let rule: Arc<Rule> = Arc::new(|_, _, _| None);
        Arc::new(Self { inner: InMemory::new(), rule: Mutex::new(rule), requests: AtomicUsize::new(0) })
    }

    /// Decides from now on by verb (`get`, `head`, `put`, `list`, `delete`), name and number of the request what goes wrong.
    pub fn fail(&self, rule: impl Fn(&str, &str, usize) -> Option<Fault> + Send + Sync + 'static) {
        self.requests.store(0, Ordering::Relaxed);
        *self.rule.lock().expect("nothing panics while it holds this lock") = Arc::new(rule);
    }

    pub fn heal(&self) {
        self.fail(|_, _, _| None);
    }

    /// Returns how many requests came since the rule was set.
    pub fn requests(&self) -> usize {
        self.requests.load(Ordering::Relaxed)
    }

    async fn fault(&self, verb: &str, path: &Path) -> Result<Option<Fault>> {
        let number = self.requests.fetch_add(1, Ordering::Relaxed);
        let rule = Arc::clone(&self.rule.lock().expect("nothing panics while it holds this lock"));
        let path = path.to_string();
        match rule(verb, &path, number) {
            Some(Fault::Away) => Err(Error::Generic { store: "Faulty", source: "500 Internal Server Error".into() }),
            Some(Fault::Denied) => Err(Error::PermissionDenied { path, source: "403 Forbidden".into() }),
            Some(Fault::Hangs) => {
                tokio::time::sleep(Duration::from_secs(3600)).await;
                Ok(None)
            }
            other => Ok(other),
        }
    }
}

#[async_trait]
impl ObjectStore for Faulty {
    async fn put_opts(&self, path: &Path, payload: PutPayload, options: PutOptions) -> Result<PutResult> {
        self.fault("put", path).await?;
        self.inner.put_opts(path, payload, options).await
    }

    async fn put_multipart_opts(&self, path: &Path, options: PutMultipartOptions) -> Result<Box<dyn MultipartUpload>> {
        self.fault("put", path).await?;
        self.inner.put_multipart_opts(path, options).await
    }

    async fn get_opts(&self, path: &Path, options: GetOptions) -> Result<GetResult> {
        let fault = self.fault(if options.head { "head" } else { "get" }, path).await?;
        let result = self.inner.get_opts(path, options).await?;
        if fault.is_none() {
            return Ok(result);
        }
        let (meta, range, attributes, extensions) =
            (result.meta.clone(), result.range.clone(), result.attributes.clone(), result.extensions.clone());
        let mut bytes = result.bytes().await?.to_vec();
        let middle = bytes.len() / 2;
        let pieces = if fault == Some(Fault::Cut) {
            let cut = Error::Generic { store: "Faulty", source: "connection reset".into() };
            vec![Ok(bytes[..middle].to_vec().into()), Err(cut)]
        } else {
            bytes[middle] ^= 1;
            vec![Ok(bytes.into())]
        };
        let payload = GetResultPayload::Stream(stream::iter(pieces).boxed());
        Ok(GetResult { payload, meta, range, attributes, extensions })
    }

    fn delete_stream(&self, paths: BoxStream<'static, Result<Path>>) -> BoxStream<'static, Result<Path>> {
        self.inner.delete_stream(paths)
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        self.inner.list(prefix)
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.fault("list", prefix.unwrap_or(&Path::default())).await?;
        self.inner.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        self.inner.copy_opts(from, to, options).await
    }
}
