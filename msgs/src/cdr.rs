//! Messages as bytes: plain CDR behind its four-byte header, as ROS 2 puts them on every wire and in every bag.
//!
//! Source: OMG DDSI-RTPS 2.3, clause 10. Alignment counts from the end of the header. Written little endian, read in
//! either order. XCDR2 and parameter lists are refused. Bytes inside padding are not looked at.

use byteorder::{BigEndian, LittleEndian};
use serde::de::DeserializeOwned;
use thiserror::Error;

use crate::Message;

const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// A sender may fill up the last four bytes.
const MOST_PADDING: usize = 3;

/// Why bytes are not the message that they should be.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum CdrError {
    /// Not even a header.
    #[error("{0} bytes are too few for a CDR header of 4 bytes")]
    Short(usize),
    /// The header names an encoding other than plain CDR.
    #[error("representation {0:#06x} is not plain CDR")]
    Representation(u16),
    /// The body ends early, or holds no readable text or boolean where one belongs.
    #[error("not a {name}: {reason}")]
    Body {
        /// ROS name of the expected type.
        name: &'static str,
        /// What the decoder met.
        reason: String,
    },
    /// The body goes on after its end.
    #[error("{count} bytes left over after a {name}")]
    Excess {
        /// ROS name of the expected type.
        name: &'static str,
        /// Bytes not read.
        count: usize,
    },
}

/// The message as little-endian CDR with its header.
///
/// Texts and sequences must be shorter than 2³² elements, which is what CDR can count.
pub fn to_cdr(message: &impl Message) -> Vec<u8> {
    let mut bytes = LITTLE_ENDIAN.to_vec();
    // Alignment counts from the first byte the encoder writes, so the header in front does not shift it.
    cdr_encoding::to_writer::<_, LittleEndian, _>(&mut bytes, message)
        .expect("structs of numbers, texts and sequences written to memory always encode");
    bytes
}

/// The message in `bytes`, which begin with a CDR header.
///
/// Memory taken is bounded by a small multiple of the input, whatever lengths the input claims.
pub fn from_cdr<M: Message>(bytes: &[u8]) -> Result<M, CdrError> {
    record_from_cdr(M::TYPE.name, bytes)
}

/// As [`from_cdr`], of a struct that is no message of this package: fields in the order of the definition of the type `name`.
pub fn record_from_cdr<T: DeserializeOwned>(
    name: &'static str,
    bytes: &[u8],
) -> Result<T, CdrError> {
    let Some(([first, second, _, _], body)) = bytes.split_first_chunk::<4>() else {
        return Err(CdrError::Short(bytes.len()));
    };
    let decoded = match u16::from_be_bytes([*first, *second]) {
        0 => cdr_encoding::from_bytes::<T, BigEndian>(body),
        1 => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        other => return Err(CdrError::Representation(other)),
    };
    let (message, read) = decoded.map_err(|error| CdrError::Body {
        name,
        reason: error.to_string(),
    })?;
    match body.len().saturating_sub(read) {
        0..=MOST_PADDING => Ok(message),
        count => Err(CdrError::Excess { name, count }),
    }
}

/// The bytes of a message of type `M` as this crate would have written them.
pub(crate) fn canonical<M: Message>(bytes: &[u8]) -> Result<Vec<u8>, CdrError> {
    from_cdr::<M>(bytes).map(|message| to_cdr(&message))
}
