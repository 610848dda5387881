//! The operators of a cell and their public keys, as `operators.toml` lists them.

use probecell_msgs::{OperatorKeys, std_msgs::Header};
use serde::{Deserialize, Serialize};
use signatures::{KeyError as NotAKey, PublicKey};

/// Why the list of operators is wrong, or cannot be changed so.
#[derive(Debug, thiserror::Error)]
pub enum OperatorsError {
    /// Not a list.
    #[error("{0}")]
    Syntax(#[from] toml::de::Error),
    /// An entry without a key.
    #[error("the key of {name:?} is invalid: {source}")]
    NotAKey {
        /// Of the operator.
        name: String,
        /// Why not.
        source: NotAKey,
    },
    /// Nobody of that name has a key in force.
    #[error("no key of {0:?} is registered")]
    Unknown(String),
    /// Somebody has this key.
    #[error("this key is registered for {0:?} already")]
    Registered(String),
}

/// A key on the list.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RegisteredKey {
    /// Of the operator.
    pub name: String,
    /// 64 hexadecimal digits.
    pub key: String,
    /// It was withdrawn: its approvals are refused.
    #[serde(default)]
    pub withdrawn: bool,
}

/// The operators of a cell.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Operators {
    /// Of changes so far.
    pub number: u64,
    /// In the order of their registration.
    #[serde(default, rename = "operator")]
    pub keys: Vec<RegisteredKey>,
}

impl Operators {
    pub(super) fn from_toml(text: &str) -> Result<Self, OperatorsError> {
        let operators: Self = toml::from_str(text)?;
        for one in &operators.keys {
            one.key
                .parse::<PublicKey>()
                .map_err(|source| OperatorsError::NotAKey {
                    name: one.name.clone(),
                    source,
                })?;
        }
        Ok(operators)
    }

    pub(super) fn to_toml(&self) -> String {
        // Names, digits and flags: there is nothing in it that TOML cannot hold.
        toml::to_string(self).unwrap_or_default()
    }

    pub(super) fn register(&mut self, name: &str, key: PublicKey) -> Result<(), OperatorsError> {
        let key = key.to_string();
        if let Some(known) = self.keys.iter().find(|one| one.key == key) {
            return Err(OperatorsError::Registered(known.name.clone()));
        }
        self.number += 1;
        let name = name.to_owned();
        self.keys.push(RegisteredKey {
            name,
            key,
            withdrawn: false,
        });
        Ok(())
    }

    pub(super) fn withdraw(&mut self, name: &str) -> Result<(), OperatorsError> {
        let mut known = (self.keys.iter_mut())
            .filter(|one| one.name == name && !one.withdrawn)
            .peekable();
        if known.peek().is_none() {
            return Err(OperatorsError::Unknown(name.to_owned()));
        }
        known.for_each(|one| one.withdrawn = true);
        self.number += 1;
        Ok(())
    }

    /// The list as a message, not signed yet.
    pub fn message(&self, header: Header) -> OperatorKeys {
        OperatorKeys {
            header,
            // 0 is what a node without any list has.
            number: self.number + 1,
            names: self.keys.iter().map(|one| one.name.clone()).collect(),
            keys: self.keys.iter().map(|one| one.key.clone()).collect(),
            withdrawn: self.keys.iter().map(|one| one.withdrawn).collect(),
            signature: Vec::new(),
        }
    }
}
