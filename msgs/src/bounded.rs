//! Bounds of texts and sequences (`string<=255`, `[<=1]`), which hold for what is read.

use serde::{Deserialize, Deserializer, de::Error};

/// A sequence of at most `BOUND` elements.
pub(crate) fn sequence<'de, T, D, const BOUND: usize>(from: D) -> Result<Vec<T>, D::Error>
where
    T: Deserialize<'de>,
    D: Deserializer<'de>,
{
    let read = Vec::deserialize(from)?;
    within(read.len(), BOUND, "elements").map(|()| read)
}

/// A text of at most `BOUND` bytes.
pub(crate) fn string<'de, D, const BOUND: usize>(from: D) -> Result<String, D::Error>
where
    D: Deserializer<'de>,
{
    let read = String::deserialize(from)?;
    within(read.len(), BOUND, "bytes").map(|()| read)
}

fn within<E: Error>(length: usize, bound: usize, what: &str) -> Result<(), E> {
    if length > bound {
        return Err(E::custom(format!(
            "{length} {what}, at most {bound} are allowed"
        )));
    }
    Ok(())
}
