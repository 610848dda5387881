//! Faults that stand: each is reported once, until its condition has gone.

use graph::{FaultCode, Stamp};

use crate::{
    ports::{MachineFault, Out},
    state::State,
};

/// Reports a fault once, until it is cleared.
pub(crate) fn raise(state: &mut State, now: Stamp, fault: MachineFault, text: &str, out: &mut Out) {
    if state.standing.insert(fault.code().to_owned()) {
        out.fault(now, fault, text);
    }
}

/// The condition of a fault has gone: it is reported again when it returns.
pub(crate) fn clear(state: &mut State, fault: MachineFault) {
    state.standing.remove(fault.code());
}
