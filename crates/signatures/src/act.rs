//! What is signed.
//!
//! The statement of an act is the sequence of these fields, each after its length in bytes (unsigned, 32 bits, little
//! endian): `probecell act 1`, the 32 bytes of the cell's public key, the word of the act's kind, the name of who acts, the
//! instant (nanoseconds since 1970, signed, 64 bits, little endian), what was shown, and the subject. It can be made
//! without this crate, by a tablet for example, and no act of one cell or kind passes for one of another.

use probecell_msgs::{OperatorRequest, builtin_interfaces::Time, to_cdr};

use crate::key::{PublicKey, SecretKey};

/// The kind of an act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// An operator approves a correction.
    Approve,
    /// An operator rejects a correction.
    Reject,
    /// The policy of the cell file approves a correction.
    Policy,
    /// An operator stops the machine.
    Stop,
    /// An operator has a part made or measured.
    Run,
    /// The cell lists the keys of its operators.
    Operators,
    /// The cell closes a recording.
    Recording,
}

impl Kind {
    /// Its keyword in a statement.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Approve => "approve",
            Self::Reject => "reject",
            Self::Policy => "policy",
            Self::Stop => "stop",
            Self::Run => "run",
            Self::Operators => "operators",
            Self::Recording => "recording",
        }
    }
}

/// An act that is signed.
#[derive(Clone, Debug, PartialEq)]
pub struct Act<'a> {
    /// Public key of the cell that it is for.
    pub cell: PublicKey,
    /// What is done.
    pub kind: Kind,
    /// Name of who does it.
    pub by: &'a str,
    /// When, by the clock of the cell.
    pub at: Time,
    /// What was shown to who does it: text, or `sha256:` and the digest of what does not fit on a line.
    pub shown: &'a str,
    /// What it is done to, in CDR; of a correction [`crate::approval::content`].
    pub subject: Vec<u8>,
}

impl<'a> Act<'a> {
    /// The act that a request of an operator is: [`Kind::Run`] or [`Kind::Stop`].
    pub fn of_request(cell: PublicKey, kind: Kind, request: &'a OperatorRequest) -> Self {
        let subject = OperatorRequest {
            subject: request.subject.clone(),
            plan_id: request.plan_id.clone(),
            points: request.points.clone(),
            ..OperatorRequest::default()
        };
        Self {
            cell,
            kind,
            by: &request.operator_name,
            at: request.signed_at,
            shown: &request.shown,
            subject: to_cdr(&subject),
        }
    }

    /// The bytes that are signed.
    pub fn statement(&self) -> Vec<u8> {
        let instant = self.at.nanos();
        let fields: [&[u8]; 7] = [
            b"probecell act 1",
            self.cell.as_bytes(),
            self.kind.word().as_bytes(),
            self.by.as_bytes(),
            &instant.to_le_bytes(),
            self.shown.as_bytes(),
            &self.subject,
        ];
        let mut statement = Vec::new();
        for field in fields {
            // A message on the bus is far below 4 GiB.
            statement.extend_from_slice(&(field.len() as u32).to_le_bytes());
            statement.extend_from_slice(field);
        }
        statement
    }
}

impl SecretKey {
    /// Signs an act: 64 bytes, the same ones each time (RFC 8032, 5.1.6).
    pub fn sign(&self, act: &Act<'_>) -> Vec<u8> {
        self.signature(&act.statement())
    }
}

impl PublicKey {
    /// True where the signature is this key's on exactly this act.
    pub fn verifies(&self, act: &Act<'_>, signature: &[u8]) -> bool {
        self.has_signed(&act.statement(), signature)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signature_is_of_one_act_and_of_no_other() {
        let key = SecretKey::from_seed([3; 32]);
        let act = Act {
            cell: SecretKey::from_seed([4; 32]).public(),
            kind: Kind::Approve,
            by: "Ada",
            at: Time { sec: 7, nanosec: 5 },
            shown: "tool 2",
            subject: b"c".to_vec(),
        };
        let signature = key.sign(&act);
        assert!(key.public().verifies(&act, &signature));
        let at = Time { sec: 7, nanosec: 6 };
        let others = [
            Act {
                cell: key.public(),
                ..act.clone()
            },
            Act {
                kind: Kind::Reject,
                ..act.clone()
            },
            Act {
                by: "Adat",
                shown: "ool 2",
                ..act.clone()
            },
            Act { at, ..act.clone() },
            Act {
                shown: "tool 2c",
                subject: Vec::new(),
                ..act.clone()
            },
        ];
        for other in others {
            assert!(!key.public().verifies(&other, &signature), "{other:?}");
        }
        for byte in 0..signature.len() {
            let mut changed = signature.clone();
            changed[byte] ^= 1;
            assert!(!key.public().verifies(&act, &changed), "byte {byte}");
        }
        assert!(!key.public().verifies(&act, &signature[..63]));
        assert!(
            !SecretKey::from_seed([5; 32])
                .public()
                .verifies(&act, &signature)
        );
    }

    /// Field by field, as a foreign program makes it.
    #[test]
    fn the_statement_is_the_documented_sequence_of_bytes() {
        let cell = SecretKey::from_seed([4; 32]).public();
        let request = OperatorRequest {
            operator_name: "Ada".to_owned(),
            signed_at: Time { sec: 1, nanosec: 2 },
            ..OperatorRequest::default()
        };
        let mut act = Act::of_request(cell, Kind::Stop, &request);
        act.subject = vec![9];
        let mut expected = b"\x0f\0\0\0probecell act 1\x20\0\0\0".to_vec();
        expected.extend_from_slice(cell.as_bytes());
        expected.extend_from_slice(b"\x04\0\0\0stop\x03\0\0\0Ada\x08\0\0\0");
        expected.extend_from_slice(&1_000_000_002_i64.to_le_bytes());
        expected.extend_from_slice(b"\0\0\0\0\x01\0\0\0\x09");
        assert_eq!(act.statement(), expected);
    }
}
