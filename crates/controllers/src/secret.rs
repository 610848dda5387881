//! Passwords, which a cell file names and never holds: the file stands in every recording.

use std::{fmt, path::PathBuf};

use serde::Deserialize;

/// Where a password is: `{ env = "NAME" }`, `{ file = "PATH" }`, or in plain text, which only recordings of earlier
/// versions and published default passwords have.
#[derive(Clone, PartialEq, Eq, Deserialize)]
#[serde(untagged)]
pub enum Secret {
    /// In an environment variable.
    Environment {
        /// Its name.
        env: String,
    },
    /// The first line of a file.
    File {
        /// The file.
        file: PathBuf,
    },
    /// As it is.
    Plain(String),
}

/// A password that is not where it is said to be.
#[derive(Debug, thiserror::Error)]
pub enum SecretError {
    /// No such variable.
    #[error(
        "the environment variable {0}, which should hold a password, is not set or is not text"
    )]
    Environment(String),
    /// The file cannot be read.
    #[error("the password file {file} cannot be read: {source}")]
    File {
        /// The file.
        file: String,
        /// Why not.
        source: std::io::Error,
    },
}

impl Secret {
    /// The file that holds it, where one does.
    pub(crate) fn file(&self) -> Option<PathBuf> {
        match self {
            Self::File { file } => Some(file.clone()),
            Self::Environment { .. } | Self::Plain(_) => None,
        }
    }

    /// The password.
    ///
    /// # Errors
    /// It is not where it is said to be.
    pub fn resolve(&self) -> Result<String, SecretError> {
        match self {
            Self::Plain(text) => Ok(text.clone()),
            Self::Environment { env } => {
                std::env::var(env).map_err(|_| SecretError::Environment(env.clone()))
            }
            Self::File { file } => {
                let read = std::fs::read_to_string(file).map_err(|source| SecretError::File {
                    file: file.display().to_string(),
                    source,
                })?;
                Ok(read.lines().next().unwrap_or_default().to_owned())
            }
        }
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Environment { env } => write!(f, "Secret(env {env})"),
            Self::File { file } => write!(f, "Secret(file {})", file.display()),
            Self::Plain(_) => f.write_str("Secret(not shown)"),
        }
    }
}
