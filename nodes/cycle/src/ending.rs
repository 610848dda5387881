//! The end of a part.

use graph::Stamp;
use probecell_msgs::PartReport;

use crate::{
    ports::{Out, Output},
    state::{Stage, State},
};

/// Ends the part with a report.
pub(crate) fn end(state: &mut State, now: Stamp, verdict: u8, text: &str, out: &mut Out) {
    if let Some(run) = state.run.take() {
        let plan_id = match &run.stage {
            Stage::OnlyMeasuring { plan_id, .. } => plan_id.to_string(),
            _ => String::new(),
        };
        out.send(Output::Part(PartReport {
            header: now.header(""),
            part_id: run.part_id.clone(),
            verdict,
            passes: run.cuts,
            text: text.to_owned(),
            plan_id,
            run_id: run.run_id.clone(),
        }));
        state.book.ended(&run, verdict, text);
        // A decision that asked for corrections is carried out or void.
        let void = run.stopping.as_ref().is_some_and(|stopping| stopping.void);
        state.last = (run.stage.plan_id().is_some() && !void).then_some(run);
    }
    state.acknowledged.clear();
}
