//! The identity of a cluster: one certificate authority per wall and one membership certificate under it.
//! In: a directory, or nothing for a throw-away identity. Out: the certificates and the key for TLS.
//! Private keys are written for their owner alone.
//!
//! The directory holds `ca.pem` (who is trusted), `ca.key` (stays with the operator; needed to issue, never to
//! run), `member.pem` and `member.key` (what a host proves itself with). Every host of a wall has the same
//! `ca.pem`, `member.pem` and `member.key`. Certificates do not expire: walls run for years on hosts with
//! wrong clocks, and a stolen key is answered by making a new identity.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rcgen::{
    BasicConstraints, CertificateParams, CertifiedIssuer, DnType, ExtendedKeyUsagePurpose, IsCa,
    KeyPair, KeyUsagePurpose,
};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use sha2::{Digest, Sha256};

use crate::transport::{self, CLUSTER_NAME};

const AUTHORITY: &str = "ca.pem";
const AUTHORITY_KEY: &str = "ca.key";
const MEMBER: &str = "member.pem";
const MEMBER_KEY: &str = "member.key";

/// Why an identity could not be made, stored or loaded.
#[derive(Debug, thiserror::Error)]
pub enum IdentityError {
    /// A file of the identity cannot be read or written.
    #[error(
        "identity file {path}: {source}; an identity directory holds ca.pem, member.pem and member.key, \
         readable by the user who runs terrawall"
    )]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The directory already holds an identity; making a new one would lock out every host of the wall.
    #[error(
        "{path} already holds the identity of a cluster; keep it, or choose an empty directory and \
         copy the new one to every host"
    )]
    Exists {
        /// The directory.
        path: PathBuf,
    },
    /// A file of the identity is not what its name says.
    #[error("identity file {path} is not a PEM {what}: {detail}; copy it from the master again")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// "certificate" or "private key".
        what: &'static str,
        /// What the parser said.
        detail: String,
    },
    /// The certificates and the key do not fit together.
    #[error(
        "the certificates and keys of the identity do not fit together: {0}; copy the whole directory \
         from the master again"
    )]
    Unusable(String),
    /// The keys could not be generated.
    #[error("cannot generate keys: {0}")]
    Generate(#[from] rcgen::Error),
}

impl IdentityError {
    pub(crate) fn unusable(error: impl std::fmt::Display) -> Self {
        Self::Unusable(error.to_string())
    }
}

/// What a process needs to be a member of a cluster. Cheap to clone is not needed: one per process.
pub struct Identity {
    authority: CertificateDer<'static>,
    certificate: CertificateDer<'static>,
    key: PrivateKeyDer<'static>,
}

/// The PEM texts of a new cluster.
struct Generated {
    authority: String,
    authority_key: String,
    member: String,
    member_key: String,
}

impl Identity {
    /// A new cluster that lives in this process only.
    ///
    /// # Errors
    /// [`IdentityError::Generate`] if the system has no randomness.
    pub fn throw_away() -> Result<Self, IdentityError> {
        let generated = generate()?;
        let here = Path::new("(memory)");
        Self::from_pem(
            here,
            generated.authority.as_bytes(),
            generated.member.as_bytes(),
            generated.member_key.as_bytes(),
        )
    }

    /// Makes a new cluster in `directory` (created with mode 0700 if missing; keys have mode 0600) and
    /// loads it.
    ///
    /// # Errors
    /// [`IdentityError::Exists`] if the directory holds one already, [`IdentityError::File`] if it cannot
    /// be written. A failure leaves no part of an identity behind.
    pub fn create(directory: &Path) -> Result<Self, IdentityError> {
        let file_error = |path: &Path| {
            let path = path.to_owned();
            move |source| IdentityError::File { path, source }
        };
        fs::DirBuilder::new()
            .recursive(true)
            .mode(0o700)
            .create(directory)
            .map_err(file_error(directory))?;
        let generated = generate()?;
        // The certificate that hosts look for first is written last: a half-written identity is no identity.
        let files = [
            (AUTHORITY_KEY, &generated.authority_key, 0o600),
            (MEMBER_KEY, &generated.member_key, 0o600),
            (MEMBER, &generated.member, 0o644),
            (AUTHORITY, &generated.authority, 0o644),
        ];
        if files.iter().any(|(name, ..)| directory.join(name).exists()) {
            return Err(IdentityError::Exists {
                path: directory.to_owned(),
            });
        }
        let mut written = Vec::new();
        for (name, text, mode) in files {
            let path = directory.join(name);
            let result = OpenOptions::new()
                .write(true)
                .create_new(true)
                .mode(mode)
                .open(&path)
                .and_then(|mut file| {
                    written.push(path.clone());
                    file.write_all(text.as_bytes())?;
                    file.sync_all()
                });
            if let Err(source) = result {
                for path in &written {
                    let _gone = fs::remove_file(path);
                }
                return Err(IdentityError::File { path, source });
            }
        }
        Self::load(directory)
    }

    /// Loads the identity in `directory`. The authority's key is not read: a host does not need it.
    ///
    /// # Errors
    /// [`IdentityError::File`], [`IdentityError::Malformed`], or [`IdentityError::Unusable`] if the
    /// certificate is not of this authority or the key not of the certificate.
    pub fn load(directory: &Path) -> Result<Self, IdentityError> {
        let read = |name: &str| {
            let path = directory.join(name);
            fs::read(&path).map_err(|source| IdentityError::File { path, source })
        };
        Self::from_pem(
            directory,
            &read(AUTHORITY)?,
            &read(MEMBER)?,
            &read(MEMBER_KEY)?,
        )
    }

    /// Whether `directory` holds an identity.
    #[must_use]
    pub fn is_in(directory: &Path) -> bool {
        directory.join(AUTHORITY).exists()
    }

    /// The first 16 hexadecimal digits of the SHA-256 of the authority's certificate: two hosts with the
    /// same digits are of one cluster.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let digest = Sha256::digest(&self.authority);
        digest
            .iter()
            .take(8)
            .map(|byte| format!("{byte:02x}"))
            .collect()
    }

    fn from_pem(
        origin: &Path,
        authority: &[u8],
        member: &[u8],
        member_key: &[u8],
    ) -> Result<Self, IdentityError> {
        let malformed = |name: &str, what| {
            let path = origin.join(name);
            move |error: rustls::pki_types::pem::Error| IdentityError::Malformed {
                path,
                what,
                detail: error.to_string(),
            }
        };
        let identity = Self {
            authority: CertificateDer::from_pem_slice(authority)
                .map_err(malformed(AUTHORITY, "certificate"))?,
            certificate: CertificateDer::from_pem_slice(member)
                .map_err(malformed(MEMBER, "certificate"))?,
            key: PrivateKeyDer::from_pem_slice(member_key)
                .map_err(malformed(MEMBER_KEY, "private key"))?,
        };
        // What does not fit together is told now, not at the first handshake.
        transport::server_config(&identity)?;
        Ok(identity)
    }

    pub(crate) fn authority(&self) -> CertificateDer<'static> {
        self.authority.clone()
    }

    pub(crate) fn certificate(&self) -> CertificateDer<'static> {
        self.certificate.clone()
    }

    pub(crate) fn key(&self) -> PrivateKeyDer<'static> {
        self.key.clone_key()
    }
}

fn generate() -> Result<Generated, rcgen::Error> {
    let mut authority = CertificateParams::new(Vec::new())?;
    authority.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    authority
        .distinguished_name
        .push(DnType::CommonName, "Terrawall cluster authority");
    authority.key_usages = vec![
        KeyUsagePurpose::KeyCertSign,
        KeyUsagePurpose::DigitalSignature,
    ];
    let authority = CertifiedIssuer::self_signed(authority, KeyPair::generate()?)?;

    let member_key = KeyPair::generate()?;
    let mut member = CertificateParams::new(vec![CLUSTER_NAME.to_owned()])?;
    member
        .distinguished_name
        .push(DnType::CommonName, "Terrawall member");
    member.use_authority_key_identifier_extension = true;
    member.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    member.extended_key_usages = vec![
        ExtendedKeyUsagePurpose::ServerAuth,
        ExtendedKeyUsagePurpose::ClientAuth,
    ];
    let member = member.signed_by(&member_key, &authority)?;

    Ok(Generated {
        authority: authority.pem(),
        authority_key: authority.key().serialize_pem(),
        member: member.pem(),
        member_key: member_key.serialize_pem(),
    })
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::expect_used,
        reason = "a test that panics has failed"
    )]

    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn a_created_identity_loads_and_its_keys_are_private() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("new/cluster");
        let created = Identity::create(&path).unwrap();
        assert!(Identity::is_in(&path));
        for (name, mode) in [(AUTHORITY_KEY, 0o600), (MEMBER_KEY, 0o600)] {
            let permissions = fs::metadata(path.join(name)).unwrap().permissions();
            assert_eq!(permissions.mode() & 0o777, mode, "{name}");
        }
        // A host needs no key of the authority.
        fs::remove_file(path.join(AUTHORITY_KEY)).unwrap();
        assert_eq!(
            Identity::load(&path).unwrap().fingerprint(),
            created.fingerprint()
        );
    }

    #[test]
    fn an_identity_is_never_overwritten() {
        let directory = tempfile::tempdir().unwrap();
        let first = Identity::create(directory.path()).unwrap().fingerprint();
        let error = Identity::create(directory.path()).err().unwrap();
        assert!(matches!(error, IdentityError::Exists { .. }), "{error}");
        assert_eq!(
            Identity::load(directory.path()).unwrap().fingerprint(),
            first
        );
    }

    #[test]
    fn what_does_not_fit_together_is_told_at_once() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path();
        assert!(matches!(
            Identity::load(path).err().unwrap(),
            IdentityError::File { .. }
        ));
        Identity::create(path).unwrap();
        fs::write(path.join(MEMBER), "not a certificate").unwrap();
        assert!(matches!(
            Identity::load(path).err().unwrap(),
            IdentityError::Malformed { .. }
        ));
        let other = generate().unwrap();
        fs::write(path.join(MEMBER), &other.member).unwrap();
        let error = Identity::load(path).err().unwrap();
        assert!(matches!(error, IdentityError::Unusable(_)), "{error}");
    }
}
