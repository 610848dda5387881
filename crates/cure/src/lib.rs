//! From cause to cure: what a gap report found about a machine becomes what the machine, or its simulation, loads.
//!
//! ```text
//!   gap report ──> cause     certain or refused: probability, groups, intervals, whose fault it is
//!                  list      every cause, by what it can be mended, how much of the gap goes
//!                  after     what became of each, by a report of the machine that has loaded it
//!                  job       what to write: format, causes, the machine's file of today
//!                  request   the causes that a format holds, and its file
//!        cause ──> axis_error   error of one axis over its travel, by the library that fitted it
//!              ──> skew         shear of three slides, by the chain
//!        both  ──> formats      one file for each maker, with `head` as its comments
//!        texts ──> settings     values of the machine's own files, replaced in place
//! ```
//!
//! Every sign follows from the interface contract: the error δ of an axis is its true position less its reading. SI inside; the
//! unit of a written file is that of its format.

mod after;
mod axis_error;
mod cause;
mod error;
mod formats;
mod head;
mod job;
mod list;
mod request;
mod settings;
mod skew;

pub use after::{After, Outcome, after, after_table};
pub use error::CureError;
pub use formats::FORMATS;
pub use job::{File, Format, Request};
pub use list::{Line, lines, table};
pub use request::{digest, write};
