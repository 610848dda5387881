//! Approvals of corrections: what is signed of a correction, and whether a signature entitles it to be written.

use std::collections::BTreeMap;

use probecell_msgs::{
    Correction, OperatorKeys, builtin_interfaces::Time, std_msgs::Header, to_cdr,
};

use crate::{
    act::{Act, Kind},
    key::{PublicKey, SecretKey},
    operators,
};

/// ns; an approval that reaches a node later than this after it was signed is none.
const AGE_LIMIT: i64 = 60_000_000_000;
/// ns by which the clock of who signs may be ahead.
const AHEAD_LIMIT: i64 = 5_000_000_000;

/// Why a correction counts as not approved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NotApproved {
    /// Nobody says so.
    #[error("no approval is on record")]
    Nobody,
    /// The cell has no key.
    #[error("this cell has no key, so that no approval can be verified")]
    NoCellKey,
    /// The cell file lets nobody but operators approve.
    #[error("the cell file does not approve corrections by policy")]
    NoPolicy,
    /// No signature.
    #[error("the approval of {0} is not signed")]
    Unsigned(String),
    /// The list of operators has not arrived.
    #[error("the keys of the operators are not known yet")]
    NoKeys,
    /// The name is not on the list.
    #[error("{0} is not an operator of this cell: probecell key list prints them")]
    Unknown(String),
    /// The key was withdrawn.
    #[error("the key of {0} was withdrawn")]
    Withdrawn(String),
    /// Signature and correction do not belong together.
    #[error("the signature of {0} does not match this correction")]
    Forged(String),
    /// Signed long ago.
    #[error("the approval of {by} was signed {age:.0} s ago: it is valid for {} s", AGE_LIMIT / 1_000_000_000)]
    Old {
        /// Who signed.
        by: String,
        /// s.
        age: f64,
    },
    /// Signed at an instant to come.
    #[error("the approval of {0} carries a time stamp in the future")]
    Early(String),
}

/// What entitles a correction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Approval {
    /// A signature that was verified.
    Signed,
    /// A name without a signature, which the cell file allows.
    Unsigned,
}

/// Whose approvals count in a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Trust {
    /// Public key of the cell: its policy's, and that of who lists the operators.
    pub cell: Option<PublicKey>,
    /// The policy of the cell file approves.
    pub automatic: bool,
    /// Operators approve without a signature.
    pub unsigned_operators: bool,
}

impl Trust {
    /// Whether a correction bears the approval, or the rejection, that it claims. `keys`: the operators' keys in force.
    ///
    /// # Errors
    /// [`NotApproved`] says why.
    pub fn check(
        &self,
        keys: Option<&OperatorKeys>,
        correction: &Correction,
    ) -> Result<Approval, NotApproved> {
        let by = || correction.approved_by.clone();
        if correction.approved_by.is_empty() {
            return Err(NotApproved::Nobody);
        }
        let Some(kind) = kind(correction) else {
            return Err(NotApproved::Nobody);
        };
        let signed = !correction.signature.is_empty();
        if kind != Kind::Policy && !signed && self.unsigned_operators {
            return Ok(Approval::Unsigned);
        }
        let cell = self.cell.ok_or(NotApproved::NoCellKey)?;
        let act = act(cell, kind, correction);
        let signature = &correction.signature;
        if kind == Kind::Policy {
            return match (self.automatic, signed) {
                (false, _) => Err(NotApproved::NoPolicy),
                (true, false) => Err(NotApproved::Unsigned(by())),
                (true, true) if cell.verifies(&act, signature) => Ok(Approval::Signed),
                (true, true) => Err(NotApproved::Forged("the cell's policy".to_owned())),
            };
        }
        if !signed {
            return Err(NotApproved::Unsigned(by()));
        }
        let keys = keys.ok_or(NotApproved::NoKeys)?;
        check(keys, &act, signature).map(|()| Approval::Signed)
    }
}

/// Whether the operator in whose name an act is has signed it with a key in force.
///
/// # Errors
/// [`NotApproved`] says why.
pub fn check(keys: &OperatorKeys, act: &Act<'_>, signature: &[u8]) -> Result<(), NotApproved> {
    let by = || act.by.to_owned();
    if signature.is_empty() {
        return Err(NotApproved::Unsigned(by()));
    }
    let mut known = operators::of_name(keys, act.by).peekable();
    if known.peek().is_none() {
        return Err(NotApproved::Unknown(by()));
    }
    match known.find(|(key, _)| key.verifies(act, signature)) {
        Some((_, false)) => Ok(()),
        Some((_, true)) => Err(NotApproved::Withdrawn(by())),
        None => Err(NotApproved::Forged(by())),
    }
}

/// Whether an approval that arrives at an instant (ns since 1970) was signed lately.
///
/// # Errors
/// [`NotApproved`] says why.
pub fn is_fresh(now: i64, correction: &Correction) -> Result<(), NotApproved> {
    let age = now - correction.approved_at.nanos();
    let by = || correction.approved_by.clone();
    if age > AGE_LIMIT {
        let age = age as f64 * 1e-9;
        return Err(NotApproved::Old { by: by(), age });
    }
    if age < -AHEAD_LIMIT {
        return Err(NotApproved::Early(by()));
    }
    Ok(())
}

/// What of a correction is signed: all of it but its header and what says of its approval, in CDR. The identifier, the
/// target, every value and bound, the source measurement, the session and the expiry are among it.
pub fn content(correction: &Correction) -> Vec<u8> {
    to_cdr(&Correction {
        header: Header::default(),
        approval: Correction::APPROVAL_NONE,
        approved_by: String::new(),
        approved_at: Time::default(),
        shown: String::new(),
        signature: Vec::new(),
        ..correction.clone()
    })
}

/// The signature on the approval or rejection that the correction claims: by `approved_by`, at `approved_at`, with what was
/// `shown`. Empty where it claims none.
pub fn sign(key: &SecretKey, cell: &PublicKey, correction: &Correction) -> Vec<u8> {
    kind(correction).map_or(Vec::new(), |kind| key.sign(&act(*cell, kind, correction)))
}

/// The act that the correction claims.
fn act(cell: PublicKey, kind: Kind, correction: &Correction) -> Act<'_> {
    Act {
        cell,
        kind,
        by: &correction.approved_by,
        at: correction.approved_at,
        shown: &correction.shown,
        subject: content(correction),
    }
}

fn kind(correction: &Correction) -> Option<Kind> {
    match correction.approval {
        Correction::APPROVAL_POLICY => Some(Kind::Policy),
        Correction::APPROVAL_OPERATOR => Some(Kind::Approve),
        Correction::APPROVAL_REJECTED => Some(Kind::Reject),
        _ => None,
    }
}

/// What signs for the policy of a cell.
#[derive(Clone, Debug, Default)]
pub enum Signer {
    /// Nothing: the gate refuses what the policy approves.
    #[default]
    Nobody,
    /// The cell's key.
    Key(SecretKey),
    /// A replay, which has no private key: the recorded signature of each correction. The gate verifies it on the
    /// correction that was computed again.
    Recorded(BTreeMap<String, Vec<u8>>),
}

impl Signer {
    /// The signature of the policy on a correction that claims its approval.
    pub fn sign(&self, correction: &Correction) -> Vec<u8> {
        match self {
            Self::Nobody => Vec::new(),
            Self::Key(key) => sign(key, &key.public(), correction),
            Self::Recorded(signatures) => {
                let recorded = signatures.get(&correction.correction_id);
                recorded.cloned().unwrap_or_default()
            }
        }
    }
}
