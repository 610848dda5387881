//! What is left of a measurement: points that no scan of it has touched yet, and points that an operator wants touched
//! once more.
//!
//! A scan that broke off goes on with what is left, from where the axes stand. A probing move that met nothing, or began
//! with a tripped probe, leaves its point. All scans belong to one plan, so what hears the touches needs to join nothing.
//! A measurement ends for good when something is cut or another plan is published.

use std::collections::BTreeSet;

use probecell_msgs::{InspectionPlan, InspectionPoint, ProbeEvent};
use serde::{Deserialize, Serialize};

use crate::{
    route::{Route, RouteError},
    task::{Task, Wanted},
};

/// What is not measured again.
#[derive(Debug, thiserror::Error)]
pub enum AgainError {
    /// A measurement of before.
    #[error(
        "plan {0:?} was measured, and nothing of it can be measured again: since then something was cut or corrected, another plan was published, or something was started again"
    )]
    Over(String),
    /// Every point was touched.
    #[error("nothing is left of plan {0:?}: every point of it was touched")]
    NothingLeft(String),
    /// A point of something else.
    #[error(
        "point {point} is no point of plan {plan:?}: further touches need a plan_id of their own"
    )]
    OtherPoint {
        /// Index of the point.
        point: usize,
        /// The plan.
        plan: String,
    },
    /// A way that the machine cannot go.
    #[error(transparent)]
    Route(#[from] RouteError),
}

/// The measurement that was asked for last.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Its plan.
    pub plan: InspectionPlan,
    /// The stage of each point; empty: all are the same.
    pub stages: Vec<u32>,
    /// Nothing is decided from it.
    pub only_measure: bool,
    /// Points that are left.
    pub left: BTreeSet<u32>,
}

impl Measurement {
    /// A measurement of all points of a plan.
    pub fn new(plan: InspectionPlan, stages: &[u32], only_measure: bool) -> Self {
        Self {
            left: (0..plan.points.len() as u32).collect(),
            stages: stages.to_vec(),
            only_measure,
            plan,
        }
    }

    /// Takes note of a probing move.
    pub fn take(&mut self, event: &ProbeEvent) {
        if event.plan_id == self.plan.plan_id && event.outcome == ProbeEvent::OUTCOME_TOUCHED {
            self.left.remove(&event.point_index);
        }
    }

    /// Wants points of the plan touched once more.
    ///
    /// # Errors
    /// [`AgainError::OtherPoint`] for the first that is none of the plan's; then nothing is wanted.
    pub fn want(&mut self, points: &[InspectionPoint]) -> Result<(), AgainError> {
        let mut wanted = BTreeSet::new();
        for (point, one) in points.iter().enumerate() {
            let place = self.plan.points.iter().position(|own| own == one);
            let other = || AgainError::OtherPoint {
                point,
                plan: self.plan.plan_id.clone(),
            };
            wanted.insert(place.ok_or_else(other)? as u32);
        }
        self.left.append(&mut wanted);
        Ok(())
    }

    /// Begins to order what is left, from where the axes stand, where that is known; the poses are those of the plan.
    ///
    /// # Errors
    /// [`AgainError::NothingLeft`], and those of [`Task::new`].
    pub fn begin(&self, route: &Route<'_>, here: Option<&[f64]>) -> Result<Task, AgainError> {
        if self.left.is_empty() {
            return Err(AgainError::NothingLeft(self.plan.plan_id.clone()));
        }
        let left: Vec<u32> = self.left.iter().copied().collect();
        let wanted = Wanted {
            plan: &self.plan,
            points: &left,
            stages: &self.stages,
            poses: &[],
            seeds: &[],
            here,
        };
        Ok(Task::new(route, &wanted)?)
    }
}
