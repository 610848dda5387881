//! Hands CDR through RustDDS untouched: its encoding is passed beside it, its bytes are not inspected.

use rustdds::bytes::Bytes;
use rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter};
use rustdds::{RepresentationIdentifier, Timestamp};

use super::super::BusError;

/// Header of little-endian CDR, the only one that is written.
const CDR_LE: [u8; 4] = [0, 1, 0, 0];

/// Header of big-endian CDR.
const CDR_BE: [u8; 4] = [0, 0, 0, 0];

/// CDR without its header.
#[derive(Clone, Debug)]
pub(super) struct Payload {
    header: [u8; 4],
    body: Bytes,
}

impl Payload {
    /// Takes little-endian CDR with its header, without copying it.
    pub(super) fn from_cdr(cdr: Vec<u8>) -> Result<Self, BusError> {
        match cdr.as_slice() {
            [0, 1, _, _, ..] => Ok(Self {
                header: CDR_LE,
                body: Bytes::from(cdr).slice(4..),
            }),
            _ => Err(BusError::Payload),
        }
    }

    /// Takes little-endian CDR with its header, and puts `front` before its body.
    pub(super) fn from_parts(cdr: &[u8], front: &[u8]) -> Result<Self, BusError> {
        match cdr {
            [0, 1, _, _, body @ ..] => Ok(Self {
                header: CDR_LE,
                body: [front, body].concat().into(),
            }),
            _ => Err(BusError::Payload),
        }
    }

    /// CDR with its header.
    pub(super) fn with_header(&self) -> Vec<u8> {
        [self.header.as_slice(), self.body.as_ref()].concat()
    }

    /// Splits off the first `N` bytes of the body; the rest is CDR with header.
    pub(super) fn split_front<const N: usize>(&self) -> Option<([u8; N], Vec<u8>)> {
        let (front, body) = self.body.split_first_chunk::<N>()?;
        Some((*front, [self.header.as_slice(), body].concat()))
    }
}

/// The adapter that neither encodes nor decodes.
pub(super) struct PassThrough;

/// Plain CDR was promised, and something else was sent.
#[derive(Debug, thiserror::Error)]
#[error("a sample is encoded as {0:?}, not as plain CDR")]
pub(super) struct NotCdr(RepresentationIdentifier);

impl SerializerAdapter<Payload> for PassThrough {
    type Error = NotCdr;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(value: &Payload) -> Result<Bytes, Self::Error> {
        Ok(value.body.clone())
    }
}

impl DeserializerAdapter<Payload> for PassThrough {
    type Error = NotCdr;
    type Decoded = Payload;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[
            RepresentationIdentifier::CDR_LE,
            RepresentationIdentifier::CDR_BE,
        ]
    }

    fn transform_decoded(decoded: Payload) -> Payload {
        decoded
    }
}

impl DefaultDecoder<Payload> for PassThrough {
    type Decoder = Self;
    const DECODER: Self = Self;
}

impl Clone for PassThrough {
    fn clone(&self) -> Self {
        Self
    }
}

impl Decode<'_, Payload> for PassThrough {
    type Error = NotCdr;

    fn decode_bytes(
        self,
        input_bytes: &[u8],
        encoding: RepresentationIdentifier,
    ) -> Result<Payload, NotCdr> {
        let header = if encoding == RepresentationIdentifier::CDR_LE {
            CDR_LE
        } else if encoding == RepresentationIdentifier::CDR_BE {
            CDR_BE
        } else {
            return Err(NotCdr(encoding));
        };
        Ok(Payload {
            header,
            body: Bytes::copy_from_slice(input_bytes),
        })
    }
}

const NS_PER_S: u64 = 1_000_000_000;

/// The DDS time nearest to an instant in ns since 1970; DDS counts s and their 2⁻³² parts.
pub(super) fn timestamp(ns: i64) -> Timestamp {
    let ns = ns.max(0) as u64;
    let fraction = ((ns % NS_PER_S) << 32) / NS_PER_S;
    Timestamp::from_ticks(((ns / NS_PER_S) << 32) | fraction)
}

/// Instant in ns since 1970, rounded to the nearest.
pub(super) fn nanoseconds(time: Timestamp) -> i64 {
    let ticks = time.to_ticks();
    let fraction = ((ticks & 0xffff_ffff) * NS_PER_S + (1 << 31)) >> 32;
    ((ticks >> 32) * NS_PER_S + fraction) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_survive_to_the_nanosecond() {
        for ns in [0, 1, 999_999_999, 1_000_000_000, 1_795_228_800_123_456_789] {
            assert_eq!(nanoseconds(timestamp(ns)), ns);
        }
    }

    #[test]
    fn bytes_pass_untouched_and_other_encodings_are_refused() {
        let cdr = [0, 1, 0, 0, 7, 8, 9];
        assert_eq!(Payload::from_cdr(cdr.to_vec()).unwrap().with_header(), cdr);
        assert!(Payload::from_cdr(vec![0, 0, 0, 0, 7]).is_err());
        assert!(Payload::from_cdr(vec![0, 1]).is_err());
        let framed = Payload::from_parts(&cdr, &[1, 2]).unwrap();
        assert_eq!(framed.split_front::<2>(), Some(([1, 2], cdr.to_vec())));
        assert_eq!(framed.split_front::<9>(), None);
    }
}
