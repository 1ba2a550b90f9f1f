//! Streams to viewers: an HTTP server for one stream folder, and the places a stream can be written to. No football in it.
//!
//! [`server`] is for machines of one's own and for trying things out; behind it, or instead of it, any static server, object
//! storage or CDN serves the same files. [`destination`] writes them: to a folder or to object storage.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod destination;
mod paths;
pub mod server;
