//! Who may take part: certificates, and one revision of this program.

use std::fs;
use std::path::Path;
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use anyhow::{Context, anyhow};
use ballista_core::extension::EndpointOverrideFn;
use tonic::metadata::MetadataMap;
use tonic::service::Interceptor;
use tonic::transport::{Certificate, ClientTlsConfig, Endpoint, Identity, Server, ServerTlsConfig};
use tonic::{Request, Status};

use super::{Place, line};
use crate::lake::hash_files;

/// Name of this program before its revision, in the header `user-agent`.
const AGENT: &str = "probecell-fleet/";
/// To open a connection, and for the answer to a sign of life.
const PATIENCE: Duration = Duration::from_secs(20);
/// Between two signs of life of a connection.
const ALIVE: Duration = Duration::from_secs(10);

/// Revision of the running program: the first half of the SHA-256 of its file, hexadecimal. A diagnosis is the same byte for byte in one build only.
pub fn revision() -> &'static str {
    static REVISION: LazyLock<String> = LazyLock::new(|| {
        // What runs, also where the file was replaced since.
        let file = Path::new("/proc/self/exe");
        match hash_files([file]) {
            Ok((hash, _)) => hash[..32].to_owned(),
            // Equal to no other.
            Err(error) => format!("unknown {} ({error})", std::process::id()),
        }
    });
    &REVISION
}

/// Certificate and key of a process, and the authority whose certificates it trusts.
#[derive(Clone)]
pub struct Credentials {
    authority: Certificate,
    own: Identity,
}

impl Credentials {
    /// Reads PEM files.
    ///
    /// # Errors
    /// A file cannot be read, or holds no certificate or key.
    pub fn read(authority: &Path, certificate: &Path, key: &Path) -> anyhow::Result<Self> {
        let read = |path: &Path, what: &str| -> anyhow::Result<String> {
            let text = fs::read_to_string(path)
                .with_context(|| format!("cannot read {}", path.display()))?;
            let begins = |line: &str| line.starts_with("-----BEGIN ") && line.contains(what);
            anyhow::ensure!(
                text.lines().any(begins),
                "{} holds no {what} in PEM",
                path.display()
            );
            Ok(text)
        };
        let authority = read(authority, "CERTIFICATE")?;
        let (certificate, key) = (read(certificate, "CERTIFICATE")?, read(key, "PRIVATE KEY")?);
        Ok(Self {
            authority: Certificate::from_pem(authority),
            own: Identity::from_pem(certificate, key),
        })
    }

    /// A server that takes no caller without a certificate of the authority.
    pub(super) fn server(&self) -> anyhow::Result<Server> {
        let tls = ServerTlsConfig::new()
            .identity(self.own.clone())
            .client_ca_root(self.authority.clone());
        Server::builder()
            .tls_config(tls)
            .map_err(|error| anyhow!("cannot use the certificate: {}", line(&error)))
            .map(|server| {
                server
                    .tcp_nodelay(true)
                    .http2_keepalive_interval(Some(ALIVE))
                    .http2_keepalive_timeout(Some(PATIENCE))
            })
    }

    /// How to reach a place: by TLS, showing certificate and revision.
    pub(super) fn endpoint(&self, to: &Place) -> anyhow::Result<Endpoint> {
        self.secured(&to.to_string())
            .map_err(|error| anyhow!("cannot reach {to}: {}", line(&*error)))
    }

    fn secured(&self, to: &str) -> Result<Endpoint, Box<dyn std::error::Error + Send + Sync>> {
        let tls = ClientTlsConfig::new()
            .ca_certificate(self.authority.clone())
            .identity(self.own.clone());
        let endpoint = Endpoint::from_shared(format!("https://{to}"))?
            .tls_config(tls)?
            .user_agent(format!("{AGENT}{}", revision()))?
            .connect_timeout(PATIENCE)
            .tcp_nodelay(true)
            .http2_keep_alive_interval(ALIVE)
            .keep_alive_timeout(PATIENCE)
            .keep_alive_while_idle(true);
        Ok(endpoint)
    }

    /// Makes every connection of Ballista one of [`Credentials::endpoint`].
    pub(super) fn overriding(&self) -> EndpointOverrideFn {
        let own = self.clone();
        Arc::new(move |endpoint: Endpoint| {
            let authority = endpoint
                .uri()
                .authority()
                .ok_or("a connection to nowhere")?;
            own.secured(authority.as_str())
        })
    }
}

/// Refuses callers of another revision.
#[derive(Clone)]
pub(super) struct SameRevision;

impl Interceptor for SameRevision {
    fn call(&mut self, request: Request<()>) -> Result<Request<()>, Status> {
        let theirs = revision_of(request.metadata());
        if theirs == Some(revision()) {
            return Ok(request);
        }
        Err(Status::failed_precondition(format!(
            "the scheduler or executor is probecell-fleet of revision {} and the caller of revision {}: all of a cluster must be one build",
            revision(),
            theirs.unwrap_or("none")
        )))
    }
}

/// Revision of a caller; none of another program.
fn revision_of(metadata: &MetadataMap) -> Option<&str> {
    let agent = metadata.get("user-agent")?.to_str().ok()?;
    agent.strip_prefix(AGENT)?.split(' ').next()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_program_or_build_is_refused() {
        let refused = |agent: Option<&str>| {
            let mut request = Request::new(());
            if let Some(agent) = agent {
                request
                    .metadata_mut()
                    .insert("user-agent", agent.parse().unwrap());
            }
            SameRevision
                .call(request)
                .err()
                .map(|status| status.message().to_owned())
        };
        let own = format!("{AGENT}{} tonic/0.14.9", revision());
        assert_eq!(refused(Some(&own)), None);
        let other = format!("{AGENT}{} tonic/0.14.9", "0".repeat(32));
        let told = refused(Some(&other)).unwrap();
        assert!(
            told.contains(revision()) && told.contains(&"0".repeat(32)),
            "{told}"
        );
        assert!(
            refused(Some("tonic/0.14.9"))
                .unwrap()
                .contains("revision none")
        );
        assert!(refused(None).is_some());
    }
}
