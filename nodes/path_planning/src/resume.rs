//! The remaining points of a measurement: those that no scan of it has touched yet, and those that an operator wants
//! measured again.
//!
//! An interrupted scan is resumed with the remaining points, from where the axes stand. A probing move without contact, or
//! with a probe that was tripped before it began, does not count. All scans belong to one plan, so a subscriber of the
//! touches needs to join nothing. A measurement ends for good when something is cut or another plan is published.

use std::collections::BTreeSet;

use probecell_msgs::{InspectionPlan, InspectionPoint, ProbeEvent};
use serde::{Deserialize, Serialize};

use crate::{
    error::PlanningError,
    rules::MotionRules,
    task::{OrderRequest, Task},
};

/// Why a measurement is not resumed.
#[derive(Debug, thiserror::Error)]
pub enum ResumeError {
    /// The measurement has ended.
    #[error(
        "plan {0:?} has been measured and cannot be resumed: since then something was cut or corrected, another plan was published, or a node was restarted"
    )]
    Over(String),
    /// Every point was touched.
    #[error("no point of plan {0:?} remains: all were touched")]
    Complete(String),
    /// A point of another plan.
    #[error(
        "point {point} is not a point of plan {plan:?}: further touches need a plan_id of their own"
    )]
    OtherPoint {
        /// Index of the point.
        point: usize,
        /// The plan.
        plan: String,
    },
    /// The remaining points cannot be ordered.
    #[error(transparent)]
    Planning(#[from] PlanningError),
}

/// The measurement that was requested last.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Its plan.
    pub plan: InspectionPlan,
    /// The stage of each point; empty: all are the same.
    pub stages: Vec<u32>,
    /// Nothing is decided from it.
    pub only_measure: bool,
    /// Indices of the points that remain.
    pub remaining: BTreeSet<u32>,
}

impl Measurement {
    /// A measurement of all points of a plan.
    pub fn new(plan: InspectionPlan, stages: &[u32], only_measure: bool) -> Self {
        Self {
            remaining: (0..plan.points.len() as u32).collect(),
            stages: stages.to_vec(),
            only_measure,
            plan,
        }
    }

    /// Removes the point of a touch from those that remain.
    pub fn record(&mut self, event: &ProbeEvent) {
        if event.plan_id == self.plan.plan_id && event.outcome == ProbeEvent::OUTCOME_TOUCHED {
            self.remaining.remove(&event.point_index);
        }
    }

    /// Adds points of the plan that are to be measured again.
    ///
    /// # Errors
    /// [`ResumeError::OtherPoint`] for the first that is not of this plan; then none is added.
    pub fn repeat(&mut self, points: &[InspectionPoint]) -> Result<(), ResumeError> {
        let mut repeated = BTreeSet::new();
        for (point, requested) in points.iter().enumerate() {
            let known = self.plan.points.iter();
            let index = known.enumerate().find(|(_, known)| *known == requested);
            let other = || ResumeError::OtherPoint {
                point,
                plan: self.plan.plan_id.clone(),
            };
            repeated.insert(index.ok_or_else(other)?.0 as u32);
        }
        self.remaining.append(&mut repeated);
        Ok(())
    }

    /// Starts to order the remaining points, from where the axes stand (m, rad), where that is known; the poses are those of
    /// the plan.
    ///
    /// # Errors
    /// [`ResumeError::Complete`], and those of [`Task::new`].
    pub fn start_order(
        &self,
        rules: &MotionRules<'_>,
        here: Option<&[f64]>,
    ) -> Result<Task, ResumeError> {
        if self.remaining.is_empty() {
            return Err(ResumeError::Complete(self.plan.plan_id.clone()));
        }
        let remaining: Vec<u32> = self.remaining.iter().copied().collect();
        let request = OrderRequest {
            plan: &self.plan,
            points: &remaining,
            stages: &self.stages,
            poses: &[],
            seeds: &[],
            here,
        };
        Ok(Task::new(rules, &request)?)
    }
}
