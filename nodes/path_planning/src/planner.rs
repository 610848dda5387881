//! Shortest measuring orders, in one call.

use probecell_msgs::{InspectionPlan, MeasurementOrder};

use crate::{
    error::PlanningError,
    rules::MotionRules,
    solver::Seed,
    task::{OrderRequest, Planned, Task},
};

impl MotionRules<'_> {
    /// The shortest order found of all points of a plan, and its moves. `seeds` has one entry for each point, or is empty
    /// (the axes then start in the middle of their travel).
    ///
    /// # Errors
    /// [`PlanningError`]: what cannot be reached, or passed.
    pub fn order(
        &self,
        plan: &InspectionPlan,
        seeds: &[Seed],
    ) -> Result<MeasurementOrder, PlanningError> {
        let all: Vec<u32> = (0..plan.points.len() as u32).collect();
        self.order_of(plan, &all, &[], seeds)
    }

    /// The shortest order found of some points of a plan and its moves, at the plan's own rotary positions: as
    /// [`MotionRules::plan`] with these fields of [`OrderRequest`].
    ///
    /// # Errors
    /// [`PlanningError`]: what cannot be reached, or passed.
    pub fn order_of(
        &self,
        plan: &InspectionPlan,
        points: &[u32],
        stages: &[u32],
        seeds: &[Seed],
    ) -> Result<MeasurementOrder, PlanningError> {
        let request = OrderRequest {
            plan,
            points,
            stages,
            poses: &[],
            seeds,
            here: None,
        };
        Ok(self.plan(&request, &mut |_| {})?.order)
    }

    /// The shortest order found, its moves, and the plan with the poses chosen; never longer than the order given at the
    /// first poses, and every target is within the travel of its axis. `on_progress` is called between two slices of the
    /// work.
    ///
    /// # Errors
    /// [`PlanningError`]: what cannot be reached, or passed.
    pub fn plan(
        &self,
        request: &OrderRequest<'_>,
        on_progress: &mut dyn FnMut(&Task),
    ) -> Result<Planned, PlanningError> {
        let mut task = Task::new(self, request)?;
        loop {
            if let Some(planned) = task.advance(self)? {
                return Ok(planned);
            }
            on_progress(&task);
        }
    }
}
