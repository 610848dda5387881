//! What a running cell measures, as its messages come.

use std::collections::BTreeMap;

use exchange::export::Size;
use probecell_msgs::{FeatureResult, GapReport, InspectionPlan, Verdict, geometrical};

/// Plans kept, whose limits apply where no verdict states others.
const PLANS: usize = 16;

/// The sizes of the last measurement, so far.
#[derive(Debug, Default)]
pub struct Sizes {
    plans: BTreeMap<String, InspectionPlan>,
    results: Vec<FeatureResult>,
    verdicts: Vec<Verdict>,
}

impl Sizes {
    /// Takes a plan.
    pub fn plan(&mut self, plan: InspectionPlan) {
        self.plans.insert(plan.plan_id.clone(), plan);
        while self.plans.len() > PLANS {
            self.plans.pop_first();
        }
    }

    /// Takes a size; one of another plan begins another measurement.
    pub fn result(&mut self, result: FeatureResult) {
        let is_other = |first: &FeatureResult| first.plan_id != result.plan_id;
        if self.results.first().is_some_and(is_other) {
            self.results.clear();
            self.verdicts.clear();
        }
        self.results
            .retain(|one| one.feature_id != result.feature_id);
        self.results.push(result);
    }

    /// Takes what was decided of a size; false where that size is not of this measurement.
    pub fn verdict(&mut self, verdict: Verdict) -> bool {
        let is_known = self
            .results
            .iter()
            .any(|one| one.plan_id == verdict.plan_id && one.feature_id == verdict.feature_id);
        if is_known {
            self.verdicts
                .retain(|one| one.feature_id != verdict.feature_id);
            self.verdicts.push(verdict);
        }
        is_known
    }

    /// The sizes, each with its limits and what was decided of it, in the order in which they came.
    pub fn sizes(&self) -> Vec<Size> {
        let sizes = self.results.iter().map(|result| {
            let verdict = self
                .verdicts
                .iter()
                .find(|one| one.feature_id == result.feature_id);
            let zone = geometrical::named(result.kind).is_some();
            let stated = verdict.map(|one| {
                let lower = if zone {
                    f64::NEG_INFINITY
                } else {
                    -one.tolerance
                };
                [lower, one.tolerance]
            });
            let planned = || {
                let features = &self.plans.get(&result.plan_id)?.features;
                let own = features.iter().find(|one| one.id == result.feature_id)?;
                let limits = [own.lower_tolerance, own.upper_tolerance];
                limits
                    .iter()
                    .any(|limit| limit.is_finite())
                    .then_some(limits)
            };
            Size {
                limits: stated.or_else(planned),
                text: String::new(),
                contradicted: verdict.is_some_and(|one| one.verdict == Verdict::CONTRADICTED),
                verdict: verdict.cloned(),
                result: result.clone(),
            }
        });
        sizes.collect()
    }
}

/// Name of the verdict of a gap report.
pub fn gap_verdict(verdict: u8) -> &'static str {
    match verdict {
        GapReport::NO_GAP => "NO_GAP",
        GapReport::EXPLAINED => "EXPLAINED",
        GapReport::PARTLY_EXPLAINED => "PARTLY_EXPLAINED",
        _ => "UNEXPLAINED",
    }
}
