//! The ledger of corrections: proposed, approved, applied, read back, promised, achieved.

use std::collections::VecDeque;

use graph::Stamp;
use probecell_msgs::{Correction, CorrectionAcknowledgement, PlanId, Verdict};

/// Corrections kept for each cell.
const KEPT: usize = 64;

/// Error of a feature in the measurement that verifies a correction.
#[derive(Clone, Debug, PartialEq)]
pub struct Achieved {
    /// The feature.
    pub feature_id: String,
    /// The measurement.
    pub plan_id: String,
    /// m.
    pub error: f64,
    /// A reference has contradicted a reading of this feature on the same part since.
    pub contradicted: bool,
}

/// One correction from its proposal to what it achieved.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The correction as published last: with its approval, once there is one.
    pub correction: Correction,
    /// When it was first received.
    pub proposed: Stamp,
    /// What the machine answered.
    pub acknowledgement: Option<CorrectionAcknowledgement>,
    /// Errors of the features it was computed from in the next measurement, one for each feature judged.
    pub achieved: Vec<Achieved>,
}

impl Entry {
    /// Mean error (m) in the next measurement of the features that it was computed from; none before they were judged.
    pub fn achieved_error(&self) -> Option<f64> {
        let count = self.achieved.len();
        let sum: f64 = self.achieved.iter().map(|one| one.error).sum();
        (count > 0).then(|| sum / count as f64)
    }

    /// What it achieved was measured by readings that a reference contradicts.
    pub fn is_refuted(&self) -> bool {
        self.achieved.iter().any(|one| one.contradicted)
    }

    /// It waits for the approval of a person at the instant `now`.
    pub fn is_waiting(&self, now: Stamp) -> bool {
        let expires = self.correction.expires.nanos();
        self.acknowledgement.is_none()
            && self.correction.approval == Correction::APPROVAL_NONE
            && !self.correction.replayed
            && (expires == 0 || now.0 < expires)
    }

    /// The machine has taken it.
    pub fn is_applied(&self) -> bool {
        self.acknowledgement.as_ref().is_some_and(|one| {
            matches!(
                one.outcome,
                CorrectionAcknowledgement::APPLIED | CorrectionAcknowledgement::ALREADY_APPLIED
            )
        })
    }
}

/// The newest corrections of a cell.
#[derive(Clone, Debug, Default)]
pub(super) struct Ledger {
    pub(super) entries: VecDeque<Entry>,
}

impl Ledger {
    /// Takes a correction; true when it is new or changed.
    pub(super) fn correction(&mut self, at: Stamp, correction: Correction) -> bool {
        let known = (self.entries.iter_mut())
            .find(|one| one.correction.correction_id == correction.correction_id);
        if let Some(known) = known {
            let changed = known.correction != correction;
            known.correction = correction;
            return changed;
        }
        if self.entries.len() == KEPT {
            self.entries.pop_front();
        }
        self.entries.push_back(Entry {
            correction,
            proposed: at,
            acknowledgement: None,
            achieved: Vec::new(),
        });
        true
    }

    /// Takes the answer of the machine; true when it changes something.
    pub(super) fn acknowledgement(&mut self, answer: CorrectionAcknowledgement) -> bool {
        let known = (self.entries.iter_mut())
            .find(|one| one.correction.correction_id == answer.correction_id);
        known.is_some_and(|known| {
            let changed = known.acknowledgement.as_ref() != Some(&answer);
            known.acknowledgement = Some(answer);
            changed
        })
    }

    /// Takes a verdict: the first one of a later measurement says what an applied correction of that feature achieved.
    pub(super) fn verdict(&mut self, verdict: &Verdict) -> bool {
        let mut changed = false;
        for entry in &mut self.entries {
            let of_it = entry.correction.feature_ids.contains(&verdict.feature_id);
            let told = (entry.achieved.iter()).any(|one| one.feature_id == verdict.feature_id);
            let later = verdict.plan_id != entry.correction.plan_id
                && verdict.header.stamp.nanos() > entry.correction.header.stamp.nanos();
            if entry.is_applied() && of_it && later && !told {
                entry.achieved.push(Achieved {
                    feature_id: verdict.feature_id.clone(),
                    plan_id: verdict.plan_id.clone(),
                    error: verdict.error,
                    contradicted: false,
                });
                changed = true;
            }
        }
        changed
    }

    /// A reference contradicts the reading of a feature: nothing is achieved by readings of it on that part, in whichever pass.
    pub(super) fn contradicted(&mut self, plan_id: &str, feature_id: &str) -> bool {
        let part = part_of(plan_id);
        let mut changed = false;
        for one in self.entries.iter_mut().flat_map(|one| &mut one.achieved) {
            let of_it = one.feature_id == feature_id && part_of(&one.plan_id) == part;
            changed |= of_it && !one.contradicted;
            one.contradicted |= of_it;
        }
        changed
    }
}

/// The part that a plan measures: its run without the pass.
pub(super) fn part_of(plan_id: &str) -> String {
    let run = PlanId::from(plan_id).run().to_string();
    part_of_run(&run).to_owned()
}

/// The part of a run and pass.
pub(super) fn part_of_run(run: &str) -> &str {
    run.rsplit_once('/').map_or(run, |(part, _)| part)
}
