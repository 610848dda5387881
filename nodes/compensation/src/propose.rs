//! The corrections of a measurement: the volumetric table alone, else the work offsets alone, else wear offsets and tool
//! paths.

use graph::Stamp;
use metrology::decision::Action;
use probecell_msgs::Correction;

use crate::{
    config::Config,
    judgement::Judgement,
    measurement::{Measurement, SizeJudgement},
    state::State,
    wear,
};

/// The corrections that put right what was judged.
pub(crate) fn corrections(
    config: &Config,
    state: &mut State,
    now: Stamp,
    measurement: &Measurement,
    sizes: &[SizeJudgement<'_>],
    judgements: Vec<Judgement>,
) -> Vec<Correction> {
    let session = state.session().to_owned();
    let proposals = (judgements.into_iter()).find_map(|judgement| judgement.proposals);
    let proposals = proposals.unwrap_or_else(|| {
        let mut proposals = wear::proposals(config, state, measurement, sizes);
        if state.offsets.is_some() {
            state.paths.begin_session(&session);
            let by_path = |size: &&SizeJudgement<'_>| {
                size.action == Action::Recut && size.characteristic.tool_number.is_none()
            };
            for size in sizes.iter().filter(by_path) {
                let result = &measurement.results[&size.characteristic.id];
                proposals.push(state.paths.correct(config, result));
            }
        }
        proposals
    });
    let message = |proposal: crate::correction::Proposal| {
        proposal.message(config, now, &measurement.plan_id, &session)
    };
    proposals.into_iter().map(message).collect()
}
