//! The features of a part as an outside instrument has measured it: the same fits on the instrument's points.
//!
//! m, part frame. A deviation of the reference is along the nominal normal, so that the ball would have touched at
//! p + (r + d)·n. How much of the instrument's uncertainty its points share is not known: it is taken as shared and as
//! independent at once, which bounds either.

use metrology::uncertainty::{Budget, Input};
use nalgebra::{Point3, Vector3};
use probecell_msgs::{FeatureResult, InspectionPlan, ReferenceMeasurement};

use crate::{
    config::Config,
    feature::vector_of,
    state::{State, Touch},
    step::features_of,
};

/// A reference without use for its plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReferenceError {
    /// It measures another plan.
    #[error(
        "the reference of {instrument:?} is of plan {plan_id:?}, which was not measured here lately"
    )]
    Plan {
        /// Who measured.
        instrument: String,
        /// The plan named.
        plan_id: String,
    },
    /// Points and deviations do not correspond.
    #[error("the reference of {instrument:?} has {points} points and {deviations} deviations")]
    Length {
        /// Who measured.
        instrument: String,
        /// Points named.
        points: usize,
        /// Deviations given.
        deviations: usize,
    },
    /// A point that the plan lacks, or a number that is not finite.
    #[error("the reference of {instrument:?}: {what}")]
    Value {
        /// Who measured.
        instrument: String,
        /// What is wrong.
        what: String,
    },
}

impl Config {
    /// Features, widths and steps of `plan` by a reference measurement, fitted by the rules of this cell; those of whose
    /// points the reference knows all. Their coverage factor is that of the cell.
    ///
    /// # Errors
    /// See [`ReferenceError`].
    pub fn by_reference(
        &self,
        plan: &InspectionPlan,
        reference: &ReferenceMeasurement,
    ) -> Result<Vec<FeatureResult>, ReferenceError> {
        check(plan, reference)?;
        let standard = reference.standard_uncertainty;
        let config = Self {
            touch_uncertainty: standard,
            touch_degrees_of_freedom: f64::INFINITY,
            common: Budget::default().with("reference", Input::exact(standard), 1.0),
            common_uncertainty: standard,
            ..self.clone()
        };
        let mut state = State::default();
        for (&index, &deviation) in reference.point_index.iter().zip(&reference.deviation) {
            let point = &plan.points[index as usize];
            let normal = Vector3::new(point.normal.x, point.normal.y, point.normal.z).normalize();
            let reach = plan.stylus.ball_radius + deviation;
            let centre = Point3::from(vector_of(&point.position) + normal * reach);
            let found = Some(([centre.x, centre.y, centre.z], deviation));
            let touches = state.touches.entry(index).or_default();
            touches.push(Touch {
                sequence: u64::from(index),
                found,
            });
        }
        let mut results = features_of(&config, &mut state, plan, &reference.header);
        for result in &mut results {
            // Numbers of touches of the cell, of which there are none here.
            result.sequences.clear();
            result.text = format!("by {}", reference.instrument);
        }
        Ok(results)
    }
}

fn check(plan: &InspectionPlan, reference: &ReferenceMeasurement) -> Result<(), ReferenceError> {
    let instrument = reference.instrument.clone();
    let (points, deviations) = (reference.point_index.len(), reference.deviation.len());
    if reference.plan_id != plan.plan_id {
        let plan_id = reference.plan_id.clone();
        return Err(ReferenceError::Plan {
            instrument,
            plan_id,
        });
    }
    if points != deviations {
        return Err(ReferenceError::Length {
            instrument,
            points,
            deviations,
        });
    }
    let refused = |what: String| Err(ReferenceError::Value { instrument, what });
    let standard = reference.standard_uncertainty;
    if !(standard.is_finite() && standard > 0.0) {
        return refused(format!("its standard uncertainty is {standard} m"));
    }
    for (index, deviation) in reference.point_index.iter().zip(&reference.deviation) {
        if *index as usize >= plan.points.len() {
            return refused(format!("point {index} is not in plan {:?}", plan.plan_id));
        }
        if !deviation.is_finite() {
            return refused(format!("the deviation of point {index} is {deviation}"));
        }
    }
    Ok(())
}
