//! The touches that would tell which of several effects has changed.
//!
//! The change is taken for a session of its own: the rows of the plan with the mean change of each point as its deviation. Its
//! posterior and the group of its cause are the explanations among which the experiment design ([`experiment::next`]) chooses.

use effects::{Observations, Variant};
use experiment::next::{Context, ProposalOptions, propose};
use experiment::proposal::Named;
use probecell_msgs::{InspectionPlan, InspectionPoint};

use crate::attribution::attribute_with;
use crate::attribution::candidate_pool::Shapes;
use crate::report::Effect;

/// A change of the deviations of a plan's points.
pub(super) struct Change<'a> {
    /// The rows of a part.
    pub(super) observations: &'a Observations,
    /// Points of the plan, ascending.
    pub(super) points: &'a [usize],
    /// Their mean change, m.
    pub(super) difference: &'a [f64],
}

impl Change<'_> {
    /// Touches that discriminate the group of a cause, the most informative first; none where no touch within reach does.
    pub(super) fn discriminated(
        &self,
        plan: &InspectionPlan,
        variants: &[Variant],
        cause: &Effect,
        options: ProposalOptions,
    ) -> Vec<InspectionPoint> {
        let changed = |point: usize| {
            let known = self.points.binary_search(&point);
            known.map_or(0.0, |index| self.difference[index])
        };
        let rows = &self.observations.rows;
        let deviations: Vec<f64> = rows.iter().map(|row| changed(row.point)).collect();
        let y: Vec<f64> = (deviations.iter().zip(rows))
            .map(|(deviation, row)| deviation * row.weight)
            .collect();
        // References do not change with the parts.
        let active: Vec<bool> = rows.iter().map(|row| row.pose.is_some()).collect();
        let observations = Observations {
            deviations,
            ..self.observations.clone()
        };
        let shapes = Shapes::new(&observations, variants);
        let attribution = attribute_with(&shapes, &y, &active, None);
        let acts = |&member: &usize| {
            variants[attribution.candidates[member].variant].effect == cause.effect
        };
        let models = attribution.models.iter();
        let set: Vec<usize> = (models.flat_map(|model| model.set.iter().copied()))
            .find(acts)
            .into_iter()
            .collect();
        let group = Named {
            effect: &cause.effect,
            indistinguishable_from: &cause.indistinguishable_from,
        };
        let known = Context {
            plan: Some(plan),
            observations: &observations,
            variants,
            attribution: &attribution,
        };
        let proposed = propose(&known, &set, &[group], options);
        let plans = proposed.into_iter().filter_map(|proposal| proposal.plan);
        plans.flat_map(|plan| plan.points).collect()
    }
}
