//! New diagnoses on many computers: Apache Ballista, with the functions of this program.
//!
//! ```text
//!   client (diagnose --cluster) --- list of sessions ---> scheduler <--- asks for parts --- executor, executor ...
//!         ^                                                                                    |
//!         +---------------------------- answers (Arrow Flight) --------------------------------+
//! ```
//!
//! All of them are this program in one revision, which [`identity`] makes sure of, and speak TLS in which both sides have a certificate.
//! Executors ask the scheduler for work (pull), so that it opens no connection. A part is the smallest that is lost with an executor.

mod client;
mod executor;
mod identity;
mod scheduler;

use ballista_core::extension::SessionConfigExt;
use ballista_core::utils::default_session_builder;
use datafusion::common::Result;
use datafusion::execution::SessionState;
use datafusion::prelude::{SessionConfig, SessionContext};

pub use client::{Cluster, Tasks};
pub use executor::execute;
pub use identity::{Credentials, revision};
pub use scheduler::schedule;

/// Largest message, bytes: the list of a million sessions.
const MESSAGE: usize = 256 << 20;
/// Groups in which the answers are brought together.
const GROUPS: usize = 8;
/// Stack of a thread, bytes: plans are walked recursively.
const STACK: usize = 32 << 20;

/// Where a process listens or is reached: `HOST:PORT`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// Name or address, as the certificate has it.
    pub host: String,
    /// Port of TCP.
    pub port: u16,
}

impl std::str::FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text.rsplit_once(':');
        match parts.map(|(host, port)| (host, port.parse::<u16>())) {
            Some((host, Ok(port))) if !host.is_empty() && port > 0 => Ok(Self {
                host: host.to_owned(),
                port,
            }),
            _ => Err("must be HOST:PORT".to_owned()),
        }
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}:{}", self.host, self.port)
    }
}

/// Configuration of every session.
fn config(credentials: &Credentials) -> SessionConfig {
    SessionConfig::new_with_ballista()
        .with_target_partitions(GROUPS)
        .with_ballista_use_tls(true)
        .with_ballista_override_create_grpc_client_endpoint(credentials.overriding())
        // A task for each group, so that tasks can be counted.
        .with_ballista_coalesce_enabled(false)
        .with_ballista_grpc_client_max_message_size(MESSAGE)
        // Unbounded by default: a lost executor would cost all that it had in hand.
        .set_usize("ballista.scheduler.max_partitions_per_task", 1)
}

/// A session with the built-in functions and those of this program.
fn state(config: SessionConfig) -> Result<SessionState> {
    let context = SessionContext::new_with_state(default_session_builder(config)?);
    crate::sql::register(&context);
    Ok(context.state())
}

fn runtime() -> anyhow::Result<tokio::runtime::Runtime> {
    use anyhow::Context;
    tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .thread_stack_size(STACK)
        .build()
        .context("cannot start the threads of the cluster")
}

/// An error of the network in one line, with its causes.
fn line(error: &dyn std::error::Error) -> String {
    let mut text = vec![error.to_string()];
    let mut cause = error.source();
    while let Some(error) = cause {
        let own = error.to_string();
        if text.last().is_none_or(|last| !last.contains(&own)) {
            text.push(own);
        }
        cause = error.source();
    }
    text.join(": ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}
