//! The measuring order of a cell's part, without starting the cell.

use path_planning::{ConfigError, MotionRules, OrderRequest, Planned, PlanningError};
use probecell_msgs::{InspectionPlan, PlanProgress};

use crate::{Cell, CellError};

/// Why the part of a cell has no measuring order.
#[derive(Debug, thiserror::Error)]
pub enum OrderError {
    /// The cell file.
    #[error(transparent)]
    Cell(#[from] CellError),
    /// Its section on planning, or its part.
    #[error(transparent)]
    Setting(#[from] ConfigError),
    /// The part cannot be measured on this machine.
    #[error(transparent)]
    Planning(#[from] PlanningError),
}

impl Cell {
    /// Plan and measuring order of its part with an allowance (m) left on its sizes, at the poses chosen where there are several;
    /// only points that `wanted` wants are touched. `progress` is called between slices of the work.
    ///
    /// # Errors
    /// [`OrderError`] names the setting, or what cannot be reached or passed.
    pub fn measuring_order(
        &self,
        allowance: f64,
        wanted: &dyn Fn(u32) -> bool,
        progress: &mut dyn FnMut(&PlanProgress),
    ) -> Result<Planned, OrderError> {
        let config = (self.path_planning).check(self.chain()?, &self.part, Vec::new())?;
        let plan = config.part.plan(allowance);
        let points: Vec<u32> = (0..plan.points.len() as u32)
            .filter(|&point| wanted(point))
            .collect();
        let rules = config.rules();
        let all: Vec<u32> = (0..plan.points.len() as u32).collect();
        let mut request = OrderRequest {
            plan: &plan,
            points: &all,
            stages: config.part.stages(),
            poses: config.part.poses(),
            seeds: &[],
            here: None,
        };
        let mut ordered = |rules: &MotionRules<'_>, request: &OrderRequest<'_>| {
            rules.plan(request, &mut |task| progress(&task.progress()))
        };
        // Poses are those of the whole plan, whichever points are left of it.
        let mut whole = None;
        if points == all || config.part.poses().iter().any(|poses| poses.len() > 1) {
            whole = Some(ordered(&rules, &request)?);
        }
        match whole {
            Some(whole) if points == all => Ok(whole),
            whole => {
                request.plan = whole.as_ref().map_or(&plan, |whole| &whole.plan);
                request.points = &points;
                request.poses = &[];
                Ok(ordered(&rules, &request)?)
            }
        }
    }

    /// The plan of its part with an allowance (m) left on its sizes, at the poses chosen where there are several.
    ///
    /// # Errors
    /// As [`Cell::measuring_order`].
    pub fn inspection_plan(
        &self,
        allowance: f64,
        progress: &mut dyn FnMut(&PlanProgress),
    ) -> Result<InspectionPlan, OrderError> {
        let config = (self.path_planning).check(self.chain()?, &self.part, Vec::new())?;
        if config.part.poses().iter().all(|poses| poses.len() < 2) {
            return Ok(config.part.plan(allowance));
        }
        Ok(self.measuring_order(allowance, &|_| true, progress)?.plan)
    }
}
