//! Wear offsets of the tools that cut the sizes (`docs/source_systems.md`, A.4).
//!
//! Characteristics cut by one tool share its offset: the correction is made for their mean error. m.

use std::collections::BTreeMap;

use metrology::{
    conformance::GuardBands,
    decision::{self, Action, Case},
    uncertainty::Components,
};
use probecell_msgs::{FeatureResult, offset::to_resolution};

use crate::{
    config::{Characteristic, Config},
    correction::{Change, MeasurementSource, Proposal},
    measurement::{Measurement, SizeJudgement},
    state::State,
};

/// The verdict on a size whose tool has the wear offset `wear` (m; `None`: not reported) after this number of `corrections`.
pub(crate) fn decide(
    config: &Config,
    characteristic: &Characteristic,
    guard: &GuardBands,
    result: &FeatureResult,
    wear: Option<f64>,
    corrections: u32,
) -> (decision::Verdict, Action) {
    let is_valid = wear.is_some() && result.decision != FeatureResult::INVALID;
    let case = Case {
        size: is_valid.then_some(result.size),
        nominal: result.nominal_size,
        side: characteristic.side,
        // The table counts wear on the size.
        wear: wear.unwrap_or(0.0) / config.wear_per_size,
        corrections,
    };
    let limits = config.limits(characteristic, guard);
    decision::decide(&case, &limits, config.policy).map_or(
        (decision::Verdict::MeasurementInvalid, Action::Stop),
        |decision| (decision.verdict, decision.action),
    )
}

/// One proposal for each tool with a size that can be corrected.
pub(crate) fn proposals(
    config: &Config,
    state: &State,
    measurement: &Measurement,
    sizes: &[SizeJudgement<'_>],
) -> Vec<Proposal> {
    let mut by_tool: BTreeMap<u32, Vec<&SizeJudgement<'_>>> = BTreeMap::new();
    for size in sizes {
        if let Some(tool) = size.characteristic.tool_number {
            by_tool.entry(tool).or_default().push(size);
        }
    }
    by_tool.retain(|_, sizes| sizes.iter().any(|size| size.action == Action::Recut));
    let proposal = |(tool, sizes): (u32, Vec<&SizeJudgement<'_>>)| {
        let held = state.wear_of(tool)?;
        let evidence = mean_error(config, measurement, &sizes);
        let side = sizes[0].characteristic.side;
        // Excess of material, which a more negative offset (outer) or a more positive one (inner) takes off.
        let change = -side.sign() * evidence.error * config.wear_per_size;
        let change = Change::ToolWear {
            tool,
            held,
            wanted: to_resolution(held + change),
            limit: config.wear_limit,
        };
        Some(Proposal { change, evidence })
    };
    by_tool.into_iter().filter_map(proposal).collect()
}

/// Mean excess of material on the sizes of one tool. Its uncertainty keeps what all touches share (GUM 5.2.2).
fn mean_error(
    config: &Config,
    measurement: &Measurement,
    sizes: &[&SizeJudgement<'_>],
) -> MeasurementSource {
    let weight = (sizes.len() as f64).recip();
    let mut evidence = MeasurementSource::default();
    let mut components = Vec::with_capacity(sizes.len());
    for size in sizes {
        let characteristic = size.characteristic;
        let result = &measurement.results[&characteristic.id];
        let weight = characteristic.side.sign() * weight;
        let common = config.common_components.get(&characteristic.id).copied();
        let split = Components::split(result.standard_uncertainty, common.unwrap_or(0.0));
        components.push((weight, split));
        evidence.error += weight * result.size_deviation;
        evidence.feature_ids.push(result.feature_id.clone());
        evidence.sequences.extend(&result.sequences);
    }
    evidence.uncertainty = Components::linear_combination(components).standard();
    evidence
}
