//! What is recorded and read back, against the mcap crate, damage made here and disks that refuse.
//!
//! - `conformance`: the conformance suite of MCAP is read whole
//! - `contract_bags`: recordings of other programs are read whole, and every message of a known type decodes
//! - `crash`: whatever a power failure leaves of a recording, what was stated durable is there
//! - `damage`: cut-off and damaged files give every whole chunk; nothing panics
//! - `earlier`: a recording of an earlier version is read by the names of its fields
//! - `folders`: folders that are no recording of MCAP splits are named, with what makes them readable
//! - `gaps`: what a recording lacks is named by topic and number
//! - `hanging_disk`: a disk that does not answer is told, and costs nothing once it does
//! - `kill`: a recorder that is killed loses nothing that it stated to be durable
//! - `moved`: a recording whose files are moved or removed while they are written ends, and keeps what it holds
//! - `refusing_disk`: a disk that refuses any one act ends the recording, and what was stated durable is there
//! - `round_trip`: what is recorded is read back: whole, in order, split or not
//! - `seals`: a sealed recording tells every later change
//! - `sessions`: bad sessions are refused by name
//! - `specification`: what the specification of MCAP allows is read whole, and what its checksums show is found

#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use bags::{Channel, Qos};

mod conformance;
mod contract_bags;
mod crash;
mod damage;
mod earlier;
mod folders;
mod gaps;
mod hanging_disk;
mod kill;
mod moved;
mod refusing_disk;
mod round_trip;
mod seals;
mod sessions;
mod specification;

/// A topic of texts.
fn topic() -> Channel {
    Channel::new(
        "/cell/a",
        "std_msgs/msg/String",
        "string data\n",
        "",
        Qos::default(),
    )
}
