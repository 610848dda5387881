//! Where keys are kept: outside the cell file, which goes into every recording.
//!
//! ```text
//! ~/.config/probecell/cells/NAME/cell.key        private key of the cell NAME, made on first use
//!                               /cell.pub        its public half, which every recording holds
//!                               /bus/users.txt   users of the bus and their passwords (`probecell secure`)
//!                               /operators.toml  public keys of the operators, and which of them were withdrawn
//! ~/.config/probecell/operators/ADA.key          private key of the operator ADA, of this user
//! ```
//!
//! `$XDG_CONFIG_HOME` takes the place of `~/.config`, and `[approvals] key_folder` that of the folder of the cell. Private
//! keys are readable by their owner only; others are refused.

mod bus;
mod files;
mod operators;

use probecell_msgs::Correction;
use signatures::{KeyError as NotAKey, PublicKey, SecretKey, Signer};

use crate::Cell;

pub use bus::{BusUsers, SecureError};
pub use files::{KeyError, KeyFolder, new_operator_key, operator_key};
pub use operators::{Operators, RegisteredKey};

/// The key of a cell, as its nodes take it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trusted {
    pub(crate) key: Option<PublicKey>,
    pub(crate) signer: Signer,
}

/// A recorded key that is none.
#[derive(Debug, thiserror::Error)]
#[error("the key of the cell, {text:?}, is invalid: {source}")]
pub(crate) struct RecordedKeyError {
    text: String,
    source: NotAKey,
}

impl Trusted {
    /// Of the public key in [`crate::CellText`].
    pub(crate) fn of_text(text: &str) -> Result<Self, RecordedKeyError> {
        let key = (!text.is_empty()).then(|| text.parse()).transpose();
        let key = key.map_err(|source| RecordedKeyError {
            text: text.to_owned(),
            source,
        })?;
        Ok(Self {
            key,
            signer: Signer::Nobody,
        })
    }
}

impl Cell {
    /// The cell with its public key, by which its nodes verify.
    #[must_use]
    pub fn with_key(mut self, key: PublicKey) -> Self {
        self.text.key = key.to_string();
        self.trusted.key = Some(key);
        self
    }

    /// The cell with its private key, with which `compensation` signs for the policy.
    #[must_use]
    pub fn with_private_key(mut self, key: SecretKey) -> Self {
        self = self.with_key(key.public());
        self.trusted.signer = Signer::Key(key);
        self
    }

    /// The cell on virtual time, with the key of simulations, which is no secret.
    #[must_use]
    pub fn simulated(self) -> Self {
        self.with_private_key(SecretKey::of_simulations())
    }

    /// The cell for a replay: in place of the private key stand the signatures of these recorded corrections. The gate
    /// verifies them on what is computed again.
    #[must_use]
    pub fn with_recorded_approvals(
        mut self,
        corrections: impl IntoIterator<Item = Correction>,
    ) -> Self {
        let by_policy = (corrections.into_iter())
            .filter(|one| one.approval == Correction::APPROVAL_POLICY)
            .map(|one| (one.correction_id, one.signature));
        self.trusted.signer = Signer::Recorded(by_policy.collect());
        self
    }

    /// Public key of the cell, where it has one.
    pub fn key(&self) -> Option<PublicKey> {
        self.trusted.key
    }
}
