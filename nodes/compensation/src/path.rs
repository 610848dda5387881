//! Correction of the tool path that cut a profile.
//!
//! The path is offset along the outward normal at each measured point (`docs/source_systems.md, B.1`: x_kor = x_nom −
//! T n_x). By default only the deterministic part of T is taken off (B.4): what is random in it would be imprinted on
//! the next part. Offsets are absolute and add up over the corrections of one session of the driver. m.

use std::collections::BTreeMap;

use metrology::{
    conformance::GuardBands,
    decision::{Action, Verdict},
    profile,
};
use probecell_msgs::FeatureResult;
use serde::{Deserialize, Serialize};

use crate::{
    config::{Characteristic, Config, PathCorrection},
    correction::{Change, MeasurementSource, Proposal, largest},
};

/// Offsets proposed so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Paths {
    /// The session of the driver that they hold in.
    pub session: String,
    /// m, along the outward normal at each point of a feature, in plan order.
    pub offsets: BTreeMap<String, Vec<f64>>,
}

/// Error of a result, m: of a profile its largest deviation, with its sign; else size less nominal size.
pub(crate) fn error(result: &FeatureResult) -> f64 {
    let largest = result
        .deviations
        .iter()
        .copied()
        .max_by(|a, b| a.abs().total_cmp(&b.abs()));
    largest.unwrap_or(result.size - result.nominal_size)
}

/// The verdict on a characteristic that no tool offset corrects: in or out of tolerance, and a profile's path can be
/// corrected.
pub(crate) fn decide(
    config: &Config,
    characteristic: &Characteristic,
    guard: &GuardBands,
    result: &FeatureResult,
    corrections: u32,
) -> (Verdict, Action) {
    let error = error(result);
    let accepted = characteristic.tolerance - guard.acceptance;
    let rejected = characteristic.tolerance + guard.rejection;
    if result.decision == FeatureResult::INVALID || !error.is_finite() {
        (Verdict::MeasurementInvalid, Action::Stop)
    } else if error.abs() <= accepted {
        (Verdict::Qualified, Action::NextPass)
    } else if result.deviations.is_empty() || config.path == PathCorrection::None {
        if error.abs() > rejected {
            (Verdict::OvercutNotCompensable, Action::Reject)
        } else {
            (Verdict::Indeterminate, Action::Stop)
        }
    } else if corrections >= config.max_corrections || part_to_correct(config, result).is_none() {
        (Verdict::NotConverged, Action::Stop)
    } else {
        (Verdict::Compensable, Action::Recut)
    }
}

/// The part of the deviations that is taken off; `None` where they are random.
fn part_to_correct(config: &Config, result: &FeatureResult) -> Option<Vec<f64>> {
    match config.path {
        PathCorrection::Raw => Some(result.deviations.clone()),
        PathCorrection::None => None,
        PathCorrection::Deterministic => {
            let split = profile::split(&result.deviations).ok()?;
            (split.control_points > 0).then_some(split.deterministic)
        }
    }
}

impl Paths {
    /// Drops the offsets of another session of the driver: its paths are gone with it.
    pub(crate) fn begin_session(&mut self, session: &str) {
        if self.session != session {
            session.clone_into(&mut self.session);
            self.offsets.clear();
        }
    }

    /// The correction of a profile's path; the new offsets are kept.
    pub(crate) fn correct(&mut self, config: &Config, result: &FeatureResult) -> Proposal {
        let part = part_to_correct(config, result).unwrap_or_default();
        let held = self.offsets.get(&result.feature_id);
        let before = |point: usize| held.and_then(|held| held.get(point)).copied();
        let offsets: Vec<f64> = part
            .iter()
            .enumerate()
            .map(|(point, deviation)| before(point).unwrap_or(0.0) - deviation)
            .collect();
        let change = Change::ToolPath {
            feature: result.feature_id.clone(),
            held: held.map_or(0.0, |held| largest(held)),
            offsets: offsets.clone(),
            limit: config.path_limit,
        };
        self.offsets.insert(result.feature_id.clone(), offsets);
        Proposal {
            change,
            evidence: MeasurementSource {
                feature_ids: vec![result.feature_id.clone()],
                sequences: result.sequences.clone(),
                error: error(result),
                uncertainty: result.standard_uncertainty,
            },
        }
    }
}
