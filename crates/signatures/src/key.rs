//! ed25519 keys (RFC 8032) and their text form: 64 hexadecimal digits.

use std::{fmt, str::FromStr};

use ed25519_dalek::{Signature, SigningKey, VerifyingKey};

/// Why a text is no key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KeyError {
    /// Not 32 bytes in hexadecimal digits.
    #[error("a key has 64 hexadecimal digits")]
    Digits,
    /// Not a point of the curve.
    #[error("these digits are not an ed25519 public key")]
    Point,
}

/// A private key. It is shown by its public half only.
#[derive(Clone)]
pub struct SecretKey(SigningKey);

/// A public key.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct PublicKey(VerifyingKey);

impl SecretKey {
    /// The key of a seed of 32 random bytes.
    pub fn from_seed(seed: [u8; 32]) -> Self {
        Self(SigningKey::from_bytes(&seed))
    }

    /// The key of every cell on virtual time. Its seed is published here, so that recordings of simulations can be made
    /// again byte for byte: it proves nothing, and no process of a running cell takes it.
    pub fn of_simulations() -> Self {
        Self::from_seed(*b"probecell simulation: not secret")
    }

    /// Its public half.
    pub fn public(&self) -> PublicKey {
        PublicKey(self.0.verifying_key())
    }

    /// The signature on these bytes.
    pub(crate) fn signature(&self, statement: &[u8]) -> Vec<u8> {
        use ed25519_dalek::Signer as _;
        self.0.sign(statement).to_bytes().to_vec()
    }

    /// Its seed as text, for the file that it is kept in.
    pub fn to_text(&self) -> String {
        hexadecimal(self.0.as_bytes())
    }
}

impl FromStr for SecretKey {
    type Err = KeyError;

    fn from_str(text: &str) -> Result<Self, KeyError> {
        bytes(text).map(Self::from_seed)
    }
}

impl fmt::Debug for SecretKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SecretKey(of {})", self.public())
    }
}

impl PublicKey {
    /// True where the signature is this key's on these bytes.
    pub(crate) fn has_signed(&self, statement: &[u8], signature: &[u8]) -> bool {
        Signature::from_slice(signature)
            .is_ok_and(|signature| self.0.verify_strict(statement, &signature).is_ok())
    }

    /// Its 32 bytes.
    pub(crate) fn as_bytes(&self) -> &[u8; 32] {
        self.0.as_bytes()
    }
}

impl FromStr for PublicKey {
    type Err = KeyError;

    fn from_str(text: &str) -> Result<Self, KeyError> {
        let key = VerifyingKey::from_bytes(&bytes(text)?).map_err(|_| KeyError::Point)?;
        Ok(Self(key))
    }
}

impl fmt::Display for PublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&hexadecimal(self.as_bytes()))
    }
}

impl fmt::Debug for PublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PublicKey({self})")
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    let digit = |value: u8| char::from_digit(value.into(), 16).unwrap_or_default();
    (bytes.iter())
        .flat_map(|byte| [digit(byte >> 4), digit(byte & 15)])
        .collect()
}

fn bytes(text: &str) -> Result<[u8; 32], KeyError> {
    let digits: Option<Vec<u8>> = (text.trim().chars())
        .map(|digit| digit.to_digit(16).and_then(|value| value.try_into().ok()))
        .collect();
    let digits = digits.ok_or(KeyError::Digits)?;
    let (pairs, rest) = digits.as_chunks::<2>();
    let bytes: Vec<u8> = pairs.iter().map(|[high, low]| high * 16 + low).collect();
    match bytes.try_into() {
        Ok(bytes) if rest.is_empty() => Ok(bytes),
        _ => Err(KeyError::Digits),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 8032, 7.1, test 1: the public key of a secret one.
    #[test]
    fn a_key_is_that_of_the_published_test_vector() {
        let secret = "9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60";
        let public = "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a";
        let key: SecretKey = secret.parse().expect("a key");
        assert_eq!(key.public().to_string(), public);
        assert_eq!(key.to_text(), secret);
        assert_eq!(public.parse(), Ok(key.public()));
        assert!(!format!("{key:?}").contains(secret));
    }

    #[test]
    fn what_is_no_key_is_refused() {
        for text in ["", "12", &"g".repeat(64), &"0".repeat(63), &"0".repeat(66)] {
            assert_eq!(text.parse::<PublicKey>(), Err(KeyError::Digits), "{text}");
        }
        // y = 2 is on no point of the curve.
        let off = format!("02{}", "00".repeat(31));
        assert_eq!(off.parse::<PublicKey>(), Err(KeyError::Point));
    }
}
