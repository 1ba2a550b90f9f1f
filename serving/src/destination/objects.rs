//! A stream in object storage.

use std::{fmt, future::Future, sync::Arc, time::Duration};

use object_store::{
    Attribute, Attributes, BackoffConfig, ClientConfigKey, ObjectStore, ObjectStoreExt, PutOptions,
    RetryConfig,
    aws::{AmazonS3Builder, AmazonS3ConfigKey},
    azure::{AzureConfigKey, MicrosoftAzureBuilder},
    gcp::{GoogleCloudStorageBuilder, GoogleConfigKey},
    memory::InMemory,
    path::Path,
};
use tokio::runtime::Runtime;
use tokio_rustls::rustls::crypto::ring;

use super::{DestinationError, FileKind, error::summary};

/// A chunk of several megabytes over a slow line takes longer than the 30 s that are usual.
const REQUEST_TIMEOUT: &str = "2 minutes";

/// Storage that restarts or throttles is waited for this long per file.
const PATIENCE: Duration = Duration::from_secs(60);

fn retries() -> RetryConfig {
    let backoff = BackoffConfig {
        init_backoff: Duration::from_millis(200),
        max_backoff: Duration::from_secs(5),
        base: 2.0,
    };
    // The waits are drawn at random, some are short: the time is what counts, the number only a bound.
    RetryConfig { backoff, max_retries: 1000, retry_timeout: PATIENCE }
}

pub(super) struct Objects {
    store: Arc<dyn ObjectStore>,
    /// How people write the place, without a slash at the end.
    url: String,
    prefix: Path,
    runtime: Runtime,
}

impl fmt::Debug for Objects {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The store knows credentials.
        formatter.debug_struct("Objects").field("url", &self.url).finish_non_exhaustive()
    }
}

impl Objects {
    /// Reads `s3://BUCKET/PREFIX` and its like; nothing when `text` is a folder.
    pub(super) fn parse(
        text: &str,
        settings: impl IntoIterator<Item = (String, String)>,
    ) -> Result<Option<Self>, DestinationError> {
        let wrong = |reason: String| DestinationError::Address { text: text.to_owned(), reason };
        let (scheme, bucket, prefix) = match text.split_once("://") {
            None if text == "memory:" => ("memory", "", ""),
            None => return Ok(None),
            Some((scheme, rest)) => {
                let (bucket, prefix) = rest.split_once('/').unwrap_or((rest, ""));
                (scheme, bucket, prefix.trim_end_matches('/'))
            }
        };
        if !prefix.is_empty() && !crate::paths::is_plain(prefix) {
            return Err(wrong("what follows the bucket must be plain names with / between them".to_owned()));
        }
        if bucket.is_empty() && scheme != "memory" {
            return Err(wrong("it names no bucket".to_owned()));
        }
        // reqwest is built without a provider of its own and takes the process's. One that is there already is as good.
        let _ = ring::default_provider().install_default();
        let store = store(scheme, bucket, settings)
            .ok_or_else(|| wrong(format!("`{scheme}://` is not known")))?
            .map_err(|error| wrong(summary(&error)))?;
        let prefix = Path::parse(prefix).map_err(|error| wrong(error.to_string()))?;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .thread_name("holopitch-upload")
            .enable_all()
            .build()
            .map_err(DestinationError::Start)?;
        let url = text.trim_end_matches('/').to_owned();
        Ok(Some(Self { store, url, prefix, runtime }))
    }

    pub(super) fn name(&self, path: &str) -> String {
        if path.is_empty() { self.url.clone() } else { format!("{}/{path}", self.url) }
    }

    pub(super) fn put(&self, path: &str, bytes: &[u8], kind: FileKind) -> Result<(), DestinationError> {
        let attributes = Attributes::from_iter([
            (Attribute::ContentType, kind.content_type()),
            (Attribute::CacheControl, kind.cache_control()),
        ]);
        let options = PutOptions { attributes, ..PutOptions::default() };
        self.run("write", path, async {
            self.store.put_opts(&self.at(path), bytes.to_vec().into(), options).await.map(drop)
        })
    }

    pub(super) fn delete(&self, path: &str) -> Result<(), DestinationError> {
        self.run("remove", path, async {
            match self.store.delete(&self.at(path)).await {
                Err(object_store::Error::NotFound { .. }) => Ok(()),
                result => result,
            }
        })
    }

    pub(super) fn read(&self, path: &str) -> Result<Vec<u8>, DestinationError> {
        self.run("read", path, async { Ok(self.store.get(&self.at(path)).await?.bytes().await?.to_vec()) })
    }

    pub(super) fn list(&self) -> Result<Vec<String>, DestinationError> {
        self.run("list", "", async {
            let mut paths = Vec::new();
            let mut folders = vec![self.prefix.clone()];
            while let Some(folder) = folders.pop() {
                let found = self.store.list_with_delimiter(Some(&folder)).await?;
                folders.extend(found.common_prefixes);
                for object in found.objects {
                    let rest = object.location.prefix_match(&self.prefix);
                    paths.extend(rest.map(|parts| {
                        parts.map(|part| part.as_ref().to_owned()).collect::<Vec<_>>().join("/")
                    }));
                }
            }
            Ok(paths)
        })
    }

    fn at(&self, path: &str) -> Path {
        self.prefix.parts().chain(Path::from(path).parts()).collect()
    }

    fn run<T>(
        &self,
        action: &'static str,
        path: &str,
        work: impl Future<Output = object_store::Result<T>>,
    ) -> Result<T, DestinationError> {
        self.runtime.block_on(work).map_err(|source| DestinationError::Object {
            action,
            object: self.name(path),
            source,
        })
    }
}

/// The storage of `scheme`, if that is one.
fn store(
    scheme: &str,
    bucket: &str,
    settings: impl IntoIterator<Item = (String, String)>,
) -> Option<object_store::Result<Arc<dyn ObjectStore>>> {
    // As the builders' own `from_env` do it: of the variables with the right beginning, those that mean something.
    let named = |prefix: &'static str| {
        settings
            .into_iter()
            .filter(move |(key, _)| key.starts_with(prefix))
            .map(|(key, value)| (key.to_ascii_lowercase(), value))
    };
    let timeout = ClientConfigKey::Timeout;
    let store = match scheme {
        "memory" => Ok(Arc::new(InMemory::new()) as Arc<dyn ObjectStore>),
        "s3" => named("AWS_")
            .filter_map(|(key, value)| Some((key.parse().ok()?, value)))
            .fold(AmazonS3Builder::new(), |builder, (key, value)| builder.with_config(key, value))
            .with_config(AmazonS3ConfigKey::Client(timeout), REQUEST_TIMEOUT)
            .with_bucket_name(bucket)
            .with_retry(retries())
            .build()
            .map(|store| Arc::new(store) as _),
        "gs" => named("GOOGLE_")
            .filter_map(|(key, value)| Some((key.parse().ok()?, value)))
            .fold(GoogleCloudStorageBuilder::new(), |builder, (key, value)| builder.with_config(key, value))
            .with_config(GoogleConfigKey::Client(timeout), REQUEST_TIMEOUT)
            .with_bucket_name(bucket)
            .with_retry(retries())
            .build()
            .map(|store| Arc::new(store) as _),
        "az" => named("AZURE_")
            .filter_map(|(key, value)| Some((key.parse().ok()?, value)))
            .fold(MicrosoftAzureBuilder::new(), |builder, (key, value)| builder.with_config(key, value))
            .with_config(AzureConfigKey::Client(timeout), REQUEST_TIMEOUT)
            .with_container_name(bucket)
            .with_retry(retries())
            .build()
            .map(|store| Arc::new(store) as _),
        _ => return None,
    };
    Some(store)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_three_kinds_of_storage_are_built_from_their_variables() {
        let settings = [
            ("AWS_ACCESS_KEY_ID", "a"),
            ("AWS_SECRET_ACCESS_KEY", "b"),
            ("AWS_NONSENSE", "c"),
            // A machine without any certificates will do.
            ("AWS_DISABLE_SYSTEM_CERTIFICATES", "true"),
            ("AZURE_DISABLE_SYSTEM_CERTIFICATES", "true"),
            ("GOOGLE_DISABLE_SYSTEM_CERTIFICATES", "true"),
            ("AZURE_STORAGE_ACCOUNT_NAME", "account"),
            ("AZURE_STORAGE_ACCOUNT_KEY", "c2VjcmV0"),
            ("GOOGLE_SKIP_SIGNATURE", "true"),
        ];
        for url in ["s3://bucket/a/b/", "gs://bucket", "az://container/a"] {
            let settings = settings.map(|(key, value)| (key.to_owned(), value.to_owned()));
            let objects = Objects::parse(url, settings).unwrap().unwrap();
            assert_eq!(
                objects.name("high/00000.glb"),
                format!("{}/high/00000.glb", url.trim_end_matches('/'))
            );
            assert!(!format!("{objects:?}").contains("c2VjcmV0"));
        }
    }

    #[test]
    fn wrong_settings_are_told() {
        let settings = [("AZURE_STORAGE_ACCOUNT_KEY".to_owned(), "c2VjcmV0".to_owned())];
        let error = Objects::parse("az://container", settings).unwrap_err().to_string();
        assert!(error.contains("az://container") && error.to_lowercase().contains("account"), "{error}");
    }
}
