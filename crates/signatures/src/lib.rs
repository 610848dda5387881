//! Who has approved what? Signed acts of operators and of a cell's policy, and their verification.
//!
//! | module | content |
//! |---|---|
//! | [`key`] | ed25519 keys (RFC 8032) and their text form |
//! | [`act`] | what exactly is signed: an act of somebody, at an instant, on a subject, with what was shown |
//! | [`approval`] | acts on corrections, and whether one entitles a correction to be written |
//! | [`operators`] | the operators' keys in force, signed by the cell's key |
//!
//! ```text
//!  correction ──> statement (bytes) ──> sign, with the key of an operator or of the cell ──> signature
//!                     └──────────────> check: is the signer registered now, is the signature of these bytes, is it fresh?
//! ```
//!
//! Everything here is a function of its arguments: no file, no clock, no randomness. The gate of `machine_state` verifies in
//! its step, so that a replay verifies again. Where keys are kept is a matter of `cell::keys`.
//!
//! ```
//! use probecell_msgs::{Correction, builtin_interfaces::Time};
//! use signatures::{SecretKey, Trust, approval};
//!
//! let cell = SecretKey::from_seed([1; 32]);
//! let mut correction = Correction {
//!     correction_id: "punch/rough/1/T2/4".to_owned(),
//!     new_value: -20e-6,
//!     approval: Correction::APPROVAL_POLICY,
//!     approved_by: "policy".to_owned(),
//!     approved_at: Time { sec: 5, nanosec: 0 },
//!     ..Correction::default()
//! };
//! correction.signature = approval::sign(&cell, &cell.public(), &correction);
//! let trust = Trust { cell: Some(cell.public()), automatic: true, unsigned_operators: false };
//! assert!(trust.check(None, &correction).is_ok());
//! correction.new_value = -21e-6;
//! let refused = trust.check(None, &correction).unwrap_err();
//! assert_eq!(refused.to_string(), "the signature of the cell's policy does not match this correction");
//! ```

pub mod act;
pub mod approval;
pub mod key;
pub mod operators;

pub use act::{Act, Kind};
pub use approval::{Approval, NotApproved, Signer, Trust};
pub use key::{KeyError, PublicKey, SecretKey};
