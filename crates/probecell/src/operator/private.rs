//! What a cell answers its own user past the bus ([`host::private`]): its state, and what an operator cannot wait for.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex},
};

use host::private::Answering;
use probecell_msgs::{Message, to_cdr};

use super::{
    services::Offered,
    state::{OperatorState, lock},
};

/// Services of the bus that are answered here too.
const SHARED: [&str; 4] = ["status", "stop", "approve_correction", "manage_orders"];
/// Corrections that wait for an operator, the last part, and the orders on disk: of each a list of messages, see [`list`].
pub(crate) const PROPOSALS: &str = "proposals";
pub(crate) const LAST_PART: &str = "last_part";
pub(crate) const ORDERS: &str = "orders";

/// All that is answered.
pub(super) fn all(
    services: &[Offered],
    state: &Arc<Mutex<OperatorState>>,
) -> BTreeMap<&'static str, Answering> {
    let shared = services.iter().filter(|one| SHARED.contains(&one.name));
    let mut all: BTreeMap<&'static str, Answering> = shared
        .map(|one| (one.name, Arc::clone(&one.answering)))
        .collect();
    let (of_proposals, of_part) = (Arc::clone(state), Arc::clone(state));
    let of_orders = Arc::clone(state);
    all.insert(
        PROPOSALS,
        Arc::new(move |_| list(lock(&of_proposals).health.waiting.values())),
    );
    all.insert(
        LAST_PART,
        Arc::new(move |_| list(lock(&of_part).last.iter())),
    );
    all.insert(
        ORDERS,
        Arc::new(move |_| list(std::iter::once(&lock(&of_orders).orders))),
    );
    all
}

/// Messages one after the other, each behind the length of its CDR (`u32`, little endian).
fn list<'a, M: Message>(messages: impl Iterator<Item = &'a M>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for message in messages {
        let cdr = to_cdr(message);
        bytes.extend((cdr.len() as u32).to_le_bytes());
        bytes.extend(cdr);
    }
    bytes
}
