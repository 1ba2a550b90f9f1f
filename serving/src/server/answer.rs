//! Requests to answers: methods, conditions, ranges, compression and what every web page may read.

use std::{
    convert::Infallible,
    io,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use headers::{ETag, HeaderMapExt, IfMatch, IfModifiedSince, IfNoneMatch, IfRange, LastModified};
use hyper::{
    HeaderMap, Method, Request, Response, StatusCode,
    header::{
        ACCEPT_ENCODING, ACCEPT_RANGES, ACCESS_CONTROL_ALLOW_HEADERS, ACCESS_CONTROL_ALLOW_METHODS,
        ACCESS_CONTROL_ALLOW_ORIGIN, ACCESS_CONTROL_EXPOSE_HEADERS, ACCESS_CONTROL_MAX_AGE, ALLOW,
        CACHE_CONTROL, CONTENT_ENCODING, CONTENT_LENGTH, CONTENT_RANGE, CONTENT_TYPE, ETAG, HeaderValue,
        IF_RANGE, RANGE, RETRY_AFTER, VARY, X_CONTENT_TYPE_OPTIONS,
    },
};
use tokio::sync::Notify;

use super::{
    body::Body,
    compressed::{Compressed, accepts_gzip, pays},
    files::{self, JSON, Refusal, Served},
    metrics::Metrics,
    range::{Asked, asked},
};

/// Where the figures are. A file of that name in the folder is not served.
const METRICS: &str = "/metrics";
const METHODS: HeaderValue = HeaderValue::from_static("GET, HEAD, OPTIONS");

/// One stream folder, as answers need it.
#[derive(Debug)]
pub(super) struct Site {
    folder: PathBuf,
    patience: Duration,
    compressed: Arc<Compressed>,
    pub(super) metrics: Arc<Metrics>,
}

impl Site {
    /// `patience` is how long a viewer may leave a piece of an answer untaken.
    pub(super) fn new(folder: PathBuf, patience: Duration) -> Arc<Self> {
        let metrics = Arc::new(Metrics::new());
        Arc::new(Self { folder, patience, compressed: Arc::default(), metrics })
    }

    /// Answers any request. `cut` is notified when the viewer does not take the answer.
    pub(super) async fn answer<B>(
        self: Arc<Self>,
        request: Request<B>,
        cut: Arc<Notify>,
    ) -> Result<Response<Body>, Infallible> {
        let under_way = self.metrics.request();
        let mut response = match *request.method() {
            Method::GET | Method::HEAD if request.uri().path() == METRICS => self.figures(),
            Method::GET | Method::HEAD => self.file(&request, cut).await,
            Method::OPTIONS => options(),
            _ => {
                let mut response = status(StatusCode::METHOD_NOT_ALLOWED);
                response.headers_mut().insert(ALLOW, METHODS);
                response
            }
        };
        let code = response.status();
        self.metrics.answered(code);
        tracing::debug!(method = %request.method(), path = request.uri().path(), status = code.as_u16(), "request");
        for_everybody(response.headers_mut());
        let head = request.method() == Method::HEAD;
        Ok(response.map(|body| if head { Body::empty() } else { body }.during(under_way)))
    }

    fn figures(&self) -> Response<Body> {
        let text = self.metrics.text();
        let mut response = Response::new(Body::empty());
        let headers = response.headers_mut();
        headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
        headers.insert(
            CONTENT_TYPE,
            HeaderValue::from_static("application/openmetrics-text; version=1.0.0; charset=utf-8"),
        );
        headers.insert(CONTENT_LENGTH, HeaderValue::from(text.len()));
        *response.body_mut() = Body::bytes(text);
        response
    }

    async fn file<B>(&self, request: &Request<B>, cut: Arc<Notify>) -> Response<Body> {
        let Some(path) = files::relative(request.uri().path()) else { return status(StatusCode::NOT_FOUND) };
        let folder = self.folder.clone();
        let opened = tokio::task::spawn_blocking({
            let path = path.clone();
            move || files::open(&folder, &path)
        });
        let served = match opened.await {
            Ok(Ok(served)) => served,
            Ok(Err(Refusal::NotFound)) => return status(StatusCode::NOT_FOUND),
            Ok(Err(Refusal::Unavailable(error))) => return unavailable(&path, &error),
            Err(error) => return unavailable(&path, &io::Error::other(error)),
        };
        let (asking, range) = (request.headers(), range(request, &served));
        let squeeze = served.content_type == JSON
            && pays(served.length)
            && !asking.contains_key(RANGE)
            && listed(asking, ACCEPT_ENCODING).is_some_and(|offers| accepts_gzip(&offers));
        // The compressed form is another representation and needs a tag of its own.
        let tag = format!("\"{}{}\"", served.tag, if squeeze { "-gz" } else { "" });
        let Ok(etag) = tag.parse::<ETag>() else { return status(StatusCode::INTERNAL_SERVER_ERROR) };

        let mut response = Response::new(Body::empty());
        let headers = response.headers_mut();
        if let Ok(value) = HeaderValue::from_str(&tag) {
            headers.insert(ETAG, value);
        }
        headers.typed_insert(LastModified::from(served.modified));
        // A stream rebuilt in the same folder keeps its names, a live one has a growing manifest: caches may keep
        // everything but must ask. An unchanged file costs them a 304.
        headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
        headers.insert(ACCEPT_RANGES, HeaderValue::from_static("bytes"));
        if served.content_type == JSON {
            headers.insert(VARY, HeaderValue::from_static("accept-encoding"));
        }
        if let Some(code) = condition(asking, &etag, served.modified) {
            *response.status_mut() = code;
            return response;
        }
        headers.insert(CONTENT_TYPE, HeaderValue::from_static(served.content_type));
        if squeeze {
            return match self.compressed.gzip(served).await {
                Ok(bytes) => {
                    headers.insert(CONTENT_ENCODING, HeaderValue::from_static("gzip"));
                    headers.insert(CONTENT_LENGTH, HeaderValue::from(bytes.len()));
                    *response.body_mut() = Body::bytes(bytes);
                    response
                }
                Err(error) => unavailable(&path, &error),
            };
        }
        let part = match range {
            Asked::All => 0..served.length,
            Asked::Part(part) => {
                let last = part.end.saturating_sub(1);
                insert(headers, CONTENT_RANGE, &format!("bytes {}-{last}/{}", part.start, served.length));
                *response.status_mut() = StatusCode::PARTIAL_CONTENT;
                part
            }
            Asked::Nothing => {
                let mut response = status(StatusCode::RANGE_NOT_SATISFIABLE);
                insert(response.headers_mut(), CONTENT_RANGE, &format!("bytes */{}", served.length));
                return response;
            }
        };
        response.headers_mut().insert(CONTENT_LENGTH, HeaderValue::from(part.end - part.start));
        if request.method() == Method::GET {
            *response.body_mut() = Body::file(served.file, part, self.patience, cut, self.metrics.clone());
        }
        response
    }
}

/// The range asked for, unless it was meant for an older file.
fn range<B>(request: &Request<B>, served: &Served) -> Asked {
    let headers = request.headers();
    let Some(range) = headers.get(RANGE).and_then(|range| range.to_str().ok()) else { return Asked::All };
    if request.method() != Method::GET {
        return Asked::All;
    }
    if headers.contains_key(IF_RANGE) {
        let etag = format!("\"{}\"", served.tag).parse::<ETag>().ok();
        let modified = LastModified::from(served.modified);
        let condition = headers.typed_get::<IfRange>();
        // A condition that cannot be read does not hold.
        if condition.is_none_or(|condition| condition.is_modified(etag.as_ref(), Some(&modified))) {
            return Asked::All;
        }
    }
    asked(range, served.length)
}

/// The status that the request's conditions call for, in the order of RFC 9110; none when the file is to be sent.
fn condition(headers: &HeaderMap, etag: &ETag, modified: std::time::SystemTime) -> Option<StatusCode> {
    if headers.typed_get::<IfMatch>().is_some_and(|condition| !condition.precondition_passes(etag)) {
        return Some(StatusCode::PRECONDITION_FAILED);
    }
    let unchanged = match headers.typed_get::<IfNoneMatch>() {
        Some(condition) => !condition.precondition_passes(etag),
        None => {
            headers.typed_get::<IfModifiedSince>().is_some_and(|condition| !condition.is_modified(modified))
        }
    };
    unchanged.then_some(StatusCode::NOT_MODIFIED)
}

/// A header that may be given several times, as one list.
fn listed(headers: &HeaderMap, name: hyper::header::HeaderName) -> Option<String> {
    let values: Vec<&str> = headers.get_all(name).iter().filter_map(|value| value.to_str().ok()).collect();
    (!values.is_empty()).then(|| values.join(","))
}

fn insert(headers: &mut HeaderMap, name: hyper::header::HeaderName, text: &str) {
    if let Ok(value) = HeaderValue::from_str(text) {
        headers.insert(name, value);
    }
}

/// An answer without a file. Nobody may keep it: a chunk that is missing now may be there in a second.
fn status(code: StatusCode) -> Response<Body> {
    let text = format!("{code}\n");
    let mut response = Response::new(Body::empty());
    *response.status_mut() = code;
    let headers = response.headers_mut();
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(CONTENT_TYPE, HeaderValue::from_static("text/plain; charset=utf-8"));
    headers.insert(CONTENT_LENGTH, HeaderValue::from(text.len()));
    *response.body_mut() = Body::bytes(text);
    response
}

fn unavailable(path: &Path, error: &io::Error) -> Response<Body> {
    tracing::warn!("{} cannot be read: {error}; viewers are told to come back", path.display());
    let mut response = status(StatusCode::SERVICE_UNAVAILABLE);
    response.headers_mut().insert(RETRY_AFTER, HeaderValue::from_static("1"));
    response
}

/// What a browser asks before it lets a page of another origin send a range or a condition.
fn options() -> Response<Body> {
    let mut response = Response::new(Body::empty());
    *response.status_mut() = StatusCode::NO_CONTENT;
    let headers = response.headers_mut();
    headers.insert(ALLOW, METHODS);
    headers.insert(ACCESS_CONTROL_ALLOW_METHODS, METHODS);
    headers.insert(ACCESS_CONTROL_ALLOW_HEADERS, HeaderValue::from_static("*"));
    headers.insert(ACCESS_CONTROL_MAX_AGE, HeaderValue::from_static("86400"));
    response
}

/// Streams are public by nature: a player in a web page of any origin may read them and what is said about them.
fn for_everybody(headers: &mut HeaderMap) {
    headers.insert(ACCESS_CONTROL_ALLOW_ORIGIN, HeaderValue::from_static("*"));
    headers.insert(
        ACCESS_CONTROL_EXPOSE_HEADERS,
        HeaderValue::from_static(
            "accept-ranges, content-encoding, content-length, content-range, date, etag, last-modified",
        ),
    );
    headers.insert("cross-origin-resource-policy", HeaderValue::from_static("cross-origin"));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
}
