//! TLS with a given certificate or one made at start.

use std::{
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket},
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, SystemTime},
};

use rcgen::{CertificateParams, DistinguishedName, DnType, KeyPair};
use tokio_rustls::{
    TlsAcceptor,
    rustls::{
        self, ServerConfig,
        pki_types::{
            CertificateDer, PrivateKeyDer,
            pem::{self, PemObject},
        },
    },
};

use super::options::Tls;

/// How long a self-made certificate is good for. Browsers take none that lasts longer than 398 days.
const LIFE: Duration = Duration::from_secs(397 * 24 * 3600);
/// Clocks of viewers may be behind.
const SLACK: Duration = Duration::from_secs(24 * 3600);

/// A certificate or key that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// A file is missing or not PEM.
    #[error("cannot read {what} from {}: {reason}; give a PEM file", path.display())]
    Pem {
        /// What it should hold.
        what: &'static str,
        /// The file given.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Certificate and key do not go together, or are of a kind that cannot be used.
    #[error("the certificate in {} and the key in {} cannot be used: {source}; give a chain with its own key", certificate.display(), key.display())]
    Pair {
        /// The chain's file.
        certificate: PathBuf,
        /// The key's file.
        key: PathBuf,
        /// What rustls said.
        source: rustls::Error,
    },
    /// The certificate of one's own could not be made.
    #[error("cannot make a certificate: {0}; give one with --tls-cert and --tls-key")]
    SelfMade(String),
}

/// Which certificate the server shows.
#[derive(Clone, Debug)]
pub(super) struct Identity {
    /// SHA-256 of the certificate, as browsers show it.
    pub(super) fingerprint: String,
    /// The certificate, if the server made it.
    pub(super) self_made_pem: Option<String>,
}

impl Identity {
    /// Where the certificate is from, in words.
    pub(super) fn origin(&self) -> &'static str {
        if self.self_made_pem.is_some() { "made for this run" } else { "as given" }
    }
}

/// What TLS needs; nothing when it is off.
pub(super) fn acceptor(tls: &Tls, address: SocketAddr) -> Result<Option<(TlsAcceptor, Identity)>, TlsError> {
    let (chain, key, self_made_pem) = match tls {
        Tls::Off => return Ok(None),
        Tls::Files { certificate, key } => {
            let (chain, key) = read(certificate, key)?;
            (chain, key, None)
        }
        Tls::SelfMade => {
            let (chain, key, pem) =
                self_made(address.ip()).map_err(|error| TlsError::SelfMade(error.to_string()))?;
            (chain, key, Some(pem))
        }
    };
    let fingerprint = chain.first().map(fingerprint).unwrap_or_default();
    let pair = |source| match tls {
        Tls::Files { certificate, key } => {
            TlsError::Pair { certificate: certificate.clone(), key: key.clone(), source }
        }
        _ => TlsError::SelfMade(source.to_string()),
    };
    // The provider is named here: a program with two of them linked in would otherwise have to choose one first.
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, key))
        .map_err(pair)?;
    config.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
    let identity = Identity { fingerprint, self_made_pem };
    Ok(Some((TlsAcceptor::from(Arc::new(config)), identity)))
}

fn read(
    certificate: &Path,
    key: &Path,
) -> Result<(Vec<CertificateDer<'static>>, PrivateKeyDer<'static>), TlsError> {
    let wrong = |what, path: &Path| {
        let path = path.to_owned();
        move |error: pem::Error| TlsError::Pem { what, path, reason: reason(&error) }
    };
    let chain = CertificateDer::pem_file_iter(certificate)
        .and_then(Iterator::collect::<Result<Vec<_>, _>>)
        .and_then(|chain| if chain.is_empty() { Err(pem::Error::NoItemsFound) } else { Ok(chain) })
        .map_err(wrong("a certificate", certificate))?;
    let key = PrivateKeyDer::from_pem_file(key).map_err(wrong("a private key", key))?;
    Ok((chain, key))
}

/// The library prints some of its errors for programmers only, and those of keys must not quote the file.
fn reason(error: &pem::Error) -> String {
    match error {
        pem::Error::Io(error) => error.to_string(),
        pem::Error::NoItemsFound => "there is none in it".to_owned(),
        _ => "it is damaged".to_owned(),
    }
}

type SelfMade = (Vec<CertificateDer<'static>>, PrivateKeyDer<'static>, String);

fn self_made(address: IpAddr) -> Result<SelfMade, rcgen::Error> {
    let key = KeyPair::generate()?;
    let mut names = vec!["localhost".to_owned()];
    names.extend(addresses(address).iter().map(IpAddr::to_string));
    let mut parameters = CertificateParams::new(names)?;
    parameters.distinguished_name = DistinguishedName::new();
    parameters.distinguished_name.push(DnType::CommonName, "Holopitch stream");
    let now = SystemTime::now();
    parameters.not_before = (now - SLACK).into();
    parameters.not_after = (now - SLACK + LIFE).into();
    let certificate = parameters.self_signed(&key)?;
    let secret =
        PrivateKeyDer::try_from(key.serialize_der()).map_err(|_| rcgen::Error::CouldNotParseKeyPair)?;
    Ok((vec![certificate.der().clone()], secret, certificate.pem()))
}

/// The addresses under which viewers reach a server that listens on `address`.
fn addresses(address: IpAddr) -> Vec<IpAddr> {
    let mut addresses = vec![IpAddr::from(Ipv4Addr::LOCALHOST), IpAddr::from(Ipv6Addr::LOCALHOST)];
    if address.is_unspecified() {
        // On all addresses: the one that the way to other machines starts from. Nothing is sent; the targets are reserved
        // for documentation.
        let target = if address.is_ipv4() { "192.0.2.1:9" } else { "[2001:db8::1]:9" };
        let local = UdpSocket::bind(SocketAddr::new(address, 0))
            .and_then(|socket| socket.connect(target).and_then(|()| socket.local_addr()));
        addresses.extend(local.ok().map(|local| local.ip()).filter(|ip| !ip.is_unspecified()));
    } else if !addresses.contains(&address) {
        addresses.push(address);
    }
    addresses
}

/// SHA-256 of the certificate, in the form `AB:CD:…`.
fn fingerprint(certificate: &CertificateDer<'_>) -> String {
    let digest = ring::digest::digest(&ring::digest::SHA256, certificate);
    digest.as_ref().iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(":")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn local() -> SocketAddr {
        "127.0.0.1:0".parse().unwrap()
    }

    #[test]
    fn files_are_read_and_bad_ones_named() {
        let folder = tempfile::tempdir().unwrap();
        let (certificate, key) = (folder.path().join("cert.pem"), folder.path().join("key.pem"));
        let made = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
            rcgen::generate_simple_self_signed(names).unwrap()
        };
        let (ours, other) = (made(&["localhost"]), made(&["localhost"]));
        std::fs::write(&certificate, ours.cert.pem()).unwrap();
        std::fs::write(&key, ours.signing_key.serialize_pem()).unwrap();
        let tls = Tls::Files { certificate: certificate.clone(), key: key.clone() };
        let (_, identity) = acceptor(&tls, local()).unwrap().unwrap();
        assert_eq!(identity.fingerprint.len(), 32 * 3 - 1);
        assert_eq!(identity.self_made_pem, None);

        let refused = || acceptor(&tls, local()).err().unwrap().to_string();
        std::fs::write(&key, other.signing_key.serialize_pem()).unwrap();
        assert!(refused().contains("cannot be used"), "{}", refused());
        std::fs::write(&key, "-----BEGIN PRIVATE KEY-----\nsecret\n").unwrap();
        assert!(refused().contains("key.pem") && !refused().contains("secret"), "{}", refused());
        std::fs::remove_file(&key).unwrap();
        assert!(refused().contains("No such file"), "{}", refused());
        std::fs::write(&certificate, "nothing").unwrap();
        assert!(refused().contains("cert.pem") && refused().contains("there is none"), "{}", refused());
    }

    #[test]
    fn a_certificate_of_ones_own_names_where_it_listens() {
        let address: IpAddr = "192.0.2.7".parse().unwrap();
        assert!(addresses(address).contains(&address));
        assert_eq!(addresses(local().ip()).len(), 2);
        let (_, first) = acceptor(&Tls::SelfMade, local()).unwrap().unwrap();
        let (_, second) = acceptor(&Tls::SelfMade, local()).unwrap().unwrap();
        assert_ne!(first.fingerprint, second.fingerprint);
        assert!(first.self_made_pem.unwrap().starts_with("-----BEGIN CERTIFICATE-----"));
    }
}
