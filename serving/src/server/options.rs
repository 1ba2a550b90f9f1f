//! How a stream is served: address, TLS and limits.

use std::{
    net::{Ipv4Addr, SocketAddr},
    path::PathBuf,
    time::Duration,
};

/// Where a server listens unless told otherwise: this machine only.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8420";

/// Whether and with which certificate connections are encrypted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Tls {
    /// Plain HTTP.
    #[default]
    Off,
    /// A certificate chain and its private key, both PEM files.
    Files {
        /// The chain, the server's own certificate first.
        certificate: PathBuf,
        /// The key: PKCS#8, PKCS#1 or SEC1.
        key: PathBuf,
    },
    /// A certificate made at start, for the address listened on and for localhost. It is another one at every start.
    SelfMade,
}

/// What a server is told. The limits are meant for viewers that nobody vetted; the defaults suit a few hundred.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServeOptions {
    /// Address and port; port 0 takes any free one.
    pub address: SocketAddr,
    /// Encryption.
    pub tls: Tls,
    /// Connections open at a time; further ones are closed at once and counted. Each may need two file descriptors.
    pub max_connections: usize,
    /// For the TLS handshake and the first request, and for every further HTTP/1 request from the end of the one before.
    pub header_timeout: Duration,
    /// A connection on which no byte moves in either direction for this long is closed.
    pub idle_timeout: Duration,
    /// A viewer that takes no part of an answer for this long is cut off.
    pub stall_timeout: Duration,
    /// How long requests under way may take to finish when the server stops.
    pub stop_deadline: Duration,
}

impl Default for ServeOptions {
    fn default() -> Self {
        Self {
            address: SocketAddr::from((Ipv4Addr::LOCALHOST, 8420)),
            tls: Tls::Off,
            // Two descriptors each stay below the 1024 that most systems give a process.
            max_connections: 400,
            header_timeout: Duration::from_secs(15),
            idle_timeout: Duration::from_secs(60),
            stall_timeout: Duration::from_secs(30),
            stop_deadline: Duration::from_secs(10),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_address_is_the_one_that_is_told() {
        assert_eq!(ServeOptions::default().address.to_string(), DEFAULT_ADDRESS);
    }
}
