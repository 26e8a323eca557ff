//! A study in an object store: S3, Google Cloud Storage or Azure Blob Storage, by the crate `object_store`.

use std::fmt;
use std::io::{self, Read, Seek};
use std::sync::Arc;
use std::time::SystemTime;

use bytes::Bytes;
use object_store::path::Path;
use object_store::{Error, ObjectStore, ObjectStoreExt, PutMode, PutOptions, PutPayload};
use tempfile::NamedTempFile;
use tokio::runtime::{Builder, Runtime};

use super::store::Entry;
use crate::input::Refusal;

/// Bytes of a piece of a large upload.
const PIECE_BYTES: u64 = 16 << 20;

/// Schemes of URLs, and the beginning of the environment variables that each is configured by.
const SCHEMES: [(&str, &str); 6] = [
    ("s3://", "AWS_"),
    ("gs://", "GOOGLE_"),
    ("az://", "AZURE_"),
    ("azure://", "AZURE_"),
    ("abfs://", "AZURE_"),
    ("abfss://", "AZURE_"),
];

/// A prefix in a bucket or container.
#[derive(Clone)]
pub struct Objects {
    url: String,
    prefix: Path,
    store: Arc<dyn ObjectStore>,
    runtime: Arc<Runtime>,
}

impl fmt::Debug for Objects {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Objects").field(&self.url).finish()
    }
}

impl Objects {
    /// The objects under a URL. Credentials, region and endpoint come from the environment variables of the provider's own tools.
    ///
    /// # Errors
    /// A URL or an environment variable that is wrong.
    pub fn at(url: &str) -> Result<Self, Refusal> {
        let refused = |what: &dyn fmt::Display| {
            let help = "give s3://bucket/prefix, gs://bucket/prefix or az://container/prefix, or a folder";
            Refusal(format!("--out {url}: {what}\n  {help}"))
        };
        let scheme = SCHEMES.iter().find(|(scheme, _)| url.starts_with(scheme));
        let (_, variables) = scheme.ok_or_else(|| refused(&"this is not the URL of an object store"))?;
        // A second provider, set by another library of the process, is as good.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let options =
            std::env::vars_os().filter_map(|(key, value)| Some((key.into_string().ok()?, value.into_string().ok()?)));
        let options = options.filter(|(key, _)| key.starts_with(variables));
        let parsed = url::Url::parse(url).map_err(|error| refused(&error))?;
        let (store, prefix) = object_store::parse_url_opts(&parsed, options).map_err(|error| refused(&error))?;
        let runtime = Builder::new_current_thread().enable_all().build().map_err(|error| refused(&error))?;
        Ok(Self { url: url.trim_end_matches('/').into(), prefix, store: store.into(), runtime: Arc::new(runtime) })
    }

    /// URL of an object, or of the prefix for an empty name.
    #[must_use]
    pub fn address(&self, name: &str) -> String {
        if name.is_empty() { self.url.clone() } else { format!("{}/{name}", self.url) }
    }

    pub(super) fn get(&self, name: &str) -> io::Result<Option<Bytes>> {
        let read = self.runtime.block_on(async { self.store.get(&self.path(name)).await?.bytes().await });
        if_there(read)
    }

    pub(super) fn has(&self, name: &str) -> io::Result<bool> {
        let found = self.runtime.block_on(self.store.head(&self.path(name)));
        Ok(if_there(found)?.is_some())
    }

    pub(super) fn put_new(&self, name: &str, bytes: &[u8]) -> io::Result<bool> {
        let create = PutOptions::from(PutMode::Create);
        match self.runtime.block_on(self.store.put_opts(&self.path(name), payload(bytes), create)) {
            Ok(_) => Ok(true),
            Err(Error::AlreadyExists { .. } | Error::Precondition { .. }) => Ok(false),
            Err(error) => Err(failed(error)),
        }
    }

    pub(super) fn replace(&self, name: &str, bytes: &[u8]) -> io::Result<()> {
        self.runtime.block_on(self.store.put(&self.path(name), payload(bytes))).map(drop).map_err(failed)
    }

    pub(super) fn remove(&self, name: &str) -> io::Result<()> {
        if_there(self.runtime.block_on(self.store.delete(&self.path(name)))).map(drop)
    }

    pub(super) fn list(&self, under: &str) -> io::Result<Vec<Entry>> {
        let folder = self.path(under);
        let listed = self.runtime.block_on(self.store.list_with_delimiter(Some(&folder))).map_err(failed)?;
        let last = |path: &Path| path.filename().unwrap_or_default().to_string();
        let folders =
            listed.common_prefixes.iter().map(|path| Entry { name: last(path), modified: SystemTime::UNIX_EPOCH });
        let objects = listed
            .objects
            .iter()
            .map(|object| Entry { name: last(&object.location), modified: object.last_modified.into() });
        Ok(folders.chain(objects).collect())
    }

    /// Uploads a file piece by piece; the object appears when all of it is there.
    pub(super) fn put_file(&self, name: &str, file: &NamedTempFile) -> io::Result<()> {
        let mut file = file.as_file();
        file.rewind()?;
        self.runtime.block_on(async {
            let mut upload = self.store.put_multipart(&self.path(name)).await.map_err(failed)?;
            loop {
                let mut piece = Vec::new();
                file.take(PIECE_BYTES).read_to_end(&mut piece)?;
                if piece.is_empty() {
                    break;
                }
                if let Err(error) = upload.put_part(piece.into()).await {
                    let _ = upload.abort().await;
                    return Err(failed(error));
                }
            }
            upload.complete().await.map(drop).map_err(failed)
        })
    }

    fn path(&self, name: &str) -> Path {
        name.split('/').filter(|part| !part.is_empty()).fold(self.prefix.clone(), |path, part| path.join(part))
    }
}

fn payload(bytes: &[u8]) -> PutPayload {
    Bytes::copy_from_slice(bytes).into()
}

fn if_there<T>(result: Result<T, Error>) -> io::Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(Error::NotFound { .. }) => Ok(None),
        Err(error) => Err(failed(error)),
    }
}

/// The whole chain of causes: the outer one says little.
fn failed(error: Error) -> io::Error {
    io::Error::other(error)
}
