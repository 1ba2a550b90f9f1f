//! JSON as gzip, for clients that ask for it. A manifest is asked for by every viewer and changes rarely, so the last one is kept.

use std::{
    io::{self, Read},
    sync::Arc,
};

use flate2::{Compression, read::GzEncoder};
use hyper::body::Bytes;
use tokio::sync::Mutex;

use super::files::Served;

/// Smaller files gain nothing.
const SMALLEST: u64 = 1024;
/// Larger files are sent as they are: this much is read into memory at once.
const LARGEST: u64 = 16 * 1024 * 1024;

/// Whether compressing a file of `length` bytes is worth it.
pub(super) fn pays(length: u64) -> bool {
    (SMALLEST..=LARGEST).contains(&length)
}

/// Whether an `Accept-Encoding` header allows gzip.
pub(super) fn accepts_gzip(header: &str) -> bool {
    let mut any = false;
    for offer in header.split(',') {
        let mut parts = offer.split(';').map(str::trim);
        let name = parts.next().unwrap_or_default();
        let quality = parts.find_map(|part| part.strip_prefix("q=").or_else(|| part.strip_prefix("Q=")));
        let wanted = quality.is_none_or(|quality| quality.trim().parse::<f32>().is_ok_and(|q| q > 0.0));
        if name.eq_ignore_ascii_case("gzip") || name.eq_ignore_ascii_case("x-gzip") {
            return wanted;
        }
        any |= name == "*" && wanted;
    }
    any
}

/// The last compressed file.
#[derive(Debug, Default)]
pub(super) struct Compressed {
    // Held while compressing: of many viewers that ask at once, one pays and the others wait for its result.
    last: Mutex<Option<(String, Bytes)>>,
}

impl Compressed {
    /// `served` as gzip.
    ///
    /// # Errors
    /// When the file cannot be read or is not as long as it was.
    pub(super) async fn gzip(self: &Arc<Self>, served: Served) -> io::Result<Bytes> {
        let mut last = self.last.lock().await;
        if let Some((tag, bytes)) = &*last
            && *tag == served.tag
        {
            return Ok(bytes.clone());
        }
        let tag = served.tag.clone();
        let bytes =
            tokio::task::spawn_blocking(move || compress(served)).await.map_err(io::Error::other)??;
        *last = Some((tag, bytes.clone()));
        Ok(bytes)
    }
}

fn compress(served: Served) -> io::Result<Bytes> {
    let mut encoder = GzEncoder::new(served.file.take(served.length), Compression::default());
    let mut bytes = Vec::new();
    encoder.read_to_end(&mut bytes)?;
    if encoder.get_ref().limit() > 0 {
        return Err(io::Error::new(
            io::ErrorKind::UnexpectedEof,
            "the file became shorter while it was read",
        ));
    }
    Ok(bytes.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gzip_is_used_only_where_it_is_wanted() {
        for yes in ["gzip", "br, gzip", "gzip, deflate, br, zstd", "GZIP;q=0.5", "*", "br;q=1, *;q=0.1"] {
            assert!(accepts_gzip(yes), "{yes}");
        }
        for no in
            ["", "br", "identity", "gzip;q=0", "gzip; q=0.0, *", "*;q=0", "gzip;q=x", "gzipped", "gzip;q=NaN"]
        {
            assert!(!accepts_gzip(no), "{no}");
        }
    }
}
