//! Opens what an address names, with the credentials that the environment has.

use std::sync::Arc;

use object_store::ObjectStore;
use object_store::local::LocalFileSystem;
use object_store::path::Path;

use super::address::{Address, Place};
use super::error::RemoteError;

/// Opens the place of an address; returns what names in it begin with, too. Nothing is asked of it yet.
///
/// # Errors
/// If the environment's settings for it are not right, or if this program was built without what it takes.
pub(super) fn open(address: &Address) -> Result<(Arc<dyn ObjectStore>, Path), RemoteError> {
    let settings = |error: object_store::Error| RemoteError::Settings {
        address: address.to_string(),
        why: super::error::told(&error),
    };
    let bucket = match &address.place {
        Place::Folder(path) => {
            let folder = Path::from_absolute_path(path).map_err(|error| settings(error.into()))?;
            // What a push says is there must be there after a power cut, too.
            return Ok((Arc::new(LocalFileSystem::new().with_fsync(true)), folder));
        }
        Place::S3(bucket) | Place::Gcs(bucket) | Place::Azure(bucket) => bucket,
    };
    let prefix = Path::from_url_path(&bucket.prefix).map_err(|error| settings(error.into()))?;
    let opened: Result<Arc<dyn ObjectStore>, RemoteError> = match &address.place {
        #[cfg(feature = "s3")]
        Place::S3(bucket) => cloud::s3(&bucket.url).map_err(settings),
        #[cfg(feature = "gcs")]
        Place::Gcs(bucket) => cloud::gcs(&bucket.url).map_err(settings),
        #[cfg(feature = "azure")]
        Place::Azure(bucket) => cloud::azure(&bucket.url).map_err(settings),
        #[cfg(not(all(feature = "s3", feature = "gcs", feature = "azure")))]
        other => {
            let feature = match other {
                Place::S3(_) => "s3",
                Place::Gcs(_) => "gcs",
                _ => "azure",
            };
            Err(RemoteError::Feature { address: address.to_string(), feature })
        }
        #[cfg(all(feature = "s3", feature = "gcs", feature = "azure"))]
        Place::Folder(_) => unreachable!("a folder was opened above"),
    };
    Ok((opened?, prefix))
}

#[cfg(feature = "cloud")]
mod cloud {
    use std::sync::{Arc, Once};
    use std::time::Duration;

    use object_store::{BackoffConfig, ClientOptions, ObjectStore, RetryConfig};

    /// Within these times a request is tried again; what takes longer counts as no answer. See [`super::super::limits`].
    fn retries() -> RetryConfig {
        let backoff =
            BackoffConfig { init_backoff: Duration::from_millis(100), max_backoff: Duration::from_secs(2), base: 2.0 };
        RetryConfig { backoff, max_retries: 4, retry_timeout: Duration::from_secs(10) }
    }

    /// Who waits sets the limits: a whole transfer may take as long as it takes.
    fn client() -> ClientOptions {
        static RING: Once = Once::new();
        // It fails if the program has one already, which is as good.
        RING.call_once(|| drop(rustls::crypto::ring::default_provider().install_default()));
        ClientOptions::new().with_connect_timeout(Duration::from_secs(4)).with_timeout_disabled()
    }

    #[cfg(feature = "s3")]
    pub(super) fn s3(url: &str) -> object_store::Result<Arc<dyn ObjectStore>> {
        use object_store::aws::AmazonS3Builder;
        let endpoint = ["AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT"].map(std::env::var);
        // Whoever names a server of their own by `http://` means that.
        let plain = endpoint.into_iter().flatten().any(|endpoint| endpoint.starts_with("http://"));
        let builder = AmazonS3Builder::from_env().with_url(url).with_retry(retries());
        let builder = builder.with_client_options(client().with_allow_http(plain));
        Ok(Arc::new(builder.build()?))
    }

    #[cfg(feature = "gcs")]
    pub(super) fn gcs(url: &str) -> object_store::Result<Arc<dyn ObjectStore>> {
        use object_store::gcp::GoogleCloudStorageBuilder;
        let builder = GoogleCloudStorageBuilder::from_env().with_url(url).with_retry(retries());
        Ok(Arc::new(builder.with_client_options(client()).build()?))
    }

    #[cfg(feature = "azure")]
    pub(super) fn azure(url: &str) -> object_store::Result<Arc<dyn ObjectStore>> {
        use object_store::azure::MicrosoftAzureBuilder;
        let builder = MicrosoftAzureBuilder::from_env().with_url(url).with_retry(retries());
        Ok(Arc::new(builder.with_client_options(client()).build()?))
    }
}
