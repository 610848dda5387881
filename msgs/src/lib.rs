//! The messages of the cell: plain structs, their CDR bytes, their schemas and type hashes.
//!
//! ```text
//!  msg/ srv/ action/ ────cargo xtask codegen──> generated.rs ──to_cdr──> bytes on the bus and in a recording
//!        │                                            ^                         │
//!        └──ament: the ROS 2 package probecell_msgs   └────────from_cdr─────────┘
//! ```
//!
//! The `.msg`, `.srv` and `.action` files beside this crate are the truth. Messages of the package are at the root, those of services
//! in [`srv`], those of actions in [`action`], standard ones in a module named as their ROS package. Units are SI and stand in the comment of each field;
//! stamps count from 1970.
//!
//! Strings and bytes that carry a grammar have a type beside the message: [`PlanId`] and [`RunId`] for identifiers of
//! plans, an enumeration such as [`CorrectionKind`] for each `uint8` field with constants. The wire knows neither.
//!
//! # Example
//!
//! A message to bytes and back; the enumeration of one of its fields:
//!
//! ```
//! use probecell_msgs::{Correction, CorrectionKind, Message, from_cdr, to_cdr};
//!
//! let correction = Correction {
//!     kind: CorrectionKind::ToolWear.into(),
//!     tool_number: 7,
//!     new_value: -12e-6, // m
//!     ..Correction::default()
//! };
//! let bytes = to_cdr(&correction);
//! let read: Correction = from_cdr(&bytes).unwrap();
//! assert_eq!(read, correction);
//! assert_eq!(CorrectionKind::try_from(read.kind), Ok(CorrectionKind::ToolWear));
//! assert_eq!(Correction::TYPE.name, "probecell_msgs/msg/Correction");
//! ```

mod bounded;
mod cdr;
mod code;
mod convert;
pub mod definition;
mod describe;
mod feature_result;
#[allow(
    missing_docs,
    reason = "a field with a self-explanatory name has no comment in its .msg file"
)]
mod generated;
pub mod geometrical;
pub mod migration;
pub mod offset;
mod plan_id;
mod schema;
mod type_description;
mod words;

pub use cdr::{CdrError, from_cdr, record_from_cdr, to_cdr};
pub use code::UnknownCode;
pub use describe::Value;
pub use generated::*;
pub use plan_id::{PlanId, RunId, is_unprintable};
pub use schema::{Action, Message, MessageType, Service, ServiceType, all, by_name, services};
pub use type_description::{definition_of, type_description};
pub use words::Reasons;
