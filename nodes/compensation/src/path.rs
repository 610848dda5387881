//! What a profile's deviations ask of the tool path that cut it.
//!
//! The path is offset along the outward normal at each measured point (source systems B.1: x_kor = x_nom − T n_x). By
//! default only the deterministic part of T is taken off (B.4): what is random in it would be imprinted on the next
//! part. Offsets are absolute and add up over the corrections of one session of the driver. m.

use std::collections::BTreeMap;

use graph::Stamp;
use metrology::{
    decision::{Action, Verdict},
    profile,
};
use probecell_msgs::{Correction, FeatureResult, std_msgs};
use serde::{Deserialize, Serialize};

use crate::config::{Characteristic, Config, PathCorrection};

/// Offsets asked for so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Paths {
    /// The session of the driver that they hold in.
    pub session: String,
    /// m, along the outward normal at each point of a feature, in plan order.
    pub offsets: BTreeMap<String, Vec<f64>>,
}

/// What a result is off by, m: of a profile its largest deviation, with its sign; else size less nominal size.
pub(crate) fn error(result: &FeatureResult) -> f64 {
    let largest = result
        .deviations
        .iter()
        .copied()
        .max_by(|one, other| one.abs().total_cmp(&other.abs()));
    largest.unwrap_or(result.size - result.nominal_size)
}

/// The verdict on a characteristic that no tool offset corrects: in or out of tolerance, and a profile's path can be
/// corrected.
pub(crate) fn decide(
    config: &Config,
    characteristic: &Characteristic,
    result: &FeatureResult,
    corrections: u32,
) -> (Verdict, Action) {
    let error = error(result);
    if result.decision == FeatureResult::INVALID || !error.is_finite() {
        (Verdict::MeasurementInvalid, Action::Stop)
    } else if error.abs() <= characteristic.tolerance {
        (Verdict::Qualified, Action::NextPass)
    } else if result.deviations.is_empty() || config.path == PathCorrection::None {
        (Verdict::OvercutNotCompensable, Action::Reject)
    } else if corrections >= config.max_corrections || part_to_correct(config, result).is_none() {
        (Verdict::NotConverged, Action::Stop)
    } else {
        (Verdict::Compensable, Action::Recut)
    }
}

/// The part of the deviations that is taken off; `None` where nothing but randomness is left.
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
    /// Forgets what another session of the driver was asked: its paths are gone with it.
    pub(crate) fn of_session(&mut self, session: &str) {
        if self.session != session {
            session.clone_into(&mut self.session);
            self.offsets.clear();
        }
    }

    /// The correction that a profile asks for; the new offsets are remembered.
    pub(crate) fn correct(
        &mut self,
        config: &Config,
        now: Stamp,
        plan_id: &str,
        result: &FeatureResult,
    ) -> Correction {
        let part = part_to_correct(config, result).unwrap_or_default();
        let held = self.offsets.get(&result.feature_id);
        let before = |point: usize| held.and_then(|held| held.get(point)).copied();
        let path: Vec<f64> = part
            .iter()
            .enumerate()
            .map(|(point, deviation)| before(point).unwrap_or(0.0) - deviation)
            .collect();
        let largest = |path: &[f64]| path.iter().fold(0.0, |most: f64, o| most.max(o.abs()));
        let previous_value = held.map_or(0.0, |held| largest(held));
        let new_value = largest(&path);
        self.offsets.insert(result.feature_id.clone(), path.clone());
        Correction {
            header: std_msgs::Header {
                stamp: now.time(),
                frame_id: String::new(),
            },
            correction_id: format!("{plan_id}/path/{}", result.feature_id),
            session: self.session.clone(),
            replayed: config.replayed,
            kind: Correction::TOOL_PATH,
            path,
            previous_value,
            new_value,
            lower_bound: -config.path_limit,
            upper_bound: config.path_limit,
            plan_id: plan_id.to_owned(),
            feature_ids: vec![result.feature_id.clone()],
            sequences: result.sequences.clone(),
            measured_error: error(result),
            standard_uncertainty: result.standard_uncertainty,
            approval: config.approval(),
            approved_by: config.approved_by(),
            expires: now.after_s(config.validity).time(),
            ..Correction::default()
        }
    }
}
