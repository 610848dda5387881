//! Reports to the cycle of how its requests ended.

use graph::Stamp;
use probecell_msgs::OperationReport;

use crate::{
    ports::{Out, Output},
    state::State,
};

/// Ends the operation that is under way as failed.
pub(crate) fn fail(state: &mut State, now: Stamp, text: &str, out: &mut Out) {
    if let Some(operation) = state.operation.take() {
        let id = operation.request_id;
        report(state, now, id, OperationReport::FAILED, text, out);
    }
}

/// Answers a request; the answer is kept for the case that the request is repeated.
pub(crate) fn report(
    state: &mut State,
    now: Stamp,
    request_id: u64,
    outcome: u8,
    text: &str,
    out: &mut Out,
) {
    let report = OperationReport {
        header: now.header(""),
        request_id,
        outcome,
        text: text.to_owned(),
    };
    if let Some((taken, answer)) = &mut state.taken
        && *taken == request_id
    {
        *answer = Some(report.clone());
    }
    out.send(Output::Report(report));
}
