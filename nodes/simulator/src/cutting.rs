//! Features that are cut point by point: where the true machine leads the true tool.

use machine::{Nominal, PositionError, Target};
use probecell_msgs::InspectionPlan;

use crate::{
    config::{Config, ConfigError},
    points::{Cut, CutPoint, points_of},
    raw::RawOperation,
    truth::Truth,
};

impl Config {
    /// The volumetric table with those values of its entries.
    pub(crate) fn table_of(&self, values: &[f64]) -> Truth {
        self.table.with_entries(values)
    }

    /// Positions of the axes (m, rad) for programme positions with these work offsets (m).
    pub(crate) fn offset(&self, positions: &[f64], work_offsets: &[f64]) -> Vec<f64> {
        let mut offset = positions.to_vec();
        for (&axis, value) in self.work_offset_axes.iter().zip(work_offsets) {
            offset[axis] += value;
        }
        offset
    }

    /// True errors at axis positions (m, rad): those of the axes, and of the clamping of the part.
    pub(crate) fn errors(&self, positions: &[f64]) -> machine::ChainErrors {
        let mut errors = self.truth.at(&self.chain, positions);
        for (error, clamping) in errors.part.iter_mut().zip(self.clamping) {
            *error += clamping;
        }
        errors
    }

    /// Deviation (m, outward) that machining leaves at each point: the tool stands where the errors of the machine lead it in
    /// the pose of the operation that cuts the point, and run-out changes its effective radius. The programme runs with
    /// these work offsets (m).
    pub(crate) fn machined_deviations(
        &self,
        cut: &Cut,
        table: &Truth,
        work_offsets: &[f64],
    ) -> Result<Vec<f64>, PositionError> {
        let (part_pose, ball) = (&cut.part.part_pose, &cut.part.ball);
        let deviations = cut.points.iter().map(|point| {
            let commanded = self.offset(&point.positions, work_offsets);
            let positions = if cut.volumetric {
                table.corrected(&self.chain, &commanded, part_pose, ball)?
            } else {
                commanded
            };
            let errors = self.errors(&positions);
            let tip = self
                .chain
                .ball_in_part_with(&positions, part_pose, ball, &errors);
            let (position, normal) = point.place;
            Ok(normal.dot(&(tip - position)) - point.runout)
        });
        deviations.collect()
    }

    /// The poses in which an operation cuts the points of a feature.
    pub(crate) fn cut_by_machine(
        &self,
        operation: &RawOperation,
        feature: &str,
        plan: &InspectionPlan,
    ) -> Result<Cut, ConfigError> {
        let refused = |point: usize, reason: String| ConfigError::Cut {
            operation: operation.id.clone(),
            feature: feature.to_owned(),
            point,
            reason,
        };
        let part = Nominal::from_plan(plan).map_err(|error| refused(0, error.to_string()))?;
        let mut start: Vec<f64> = self.home.clone();
        let mut points = Vec::new();
        for point in points_of(plan, feature) {
            let nominal = &plan.points[point];
            let turned = usize::try_from(nominal.operation)
                .ok()
                .and_then(|index| plan.operations.get(index))
                .map_or(&nominal.rotary_positions, |cut| &cut.rotary_positions);
            let mut prescribed = vec![None; self.chain.axes().len()];
            for (name, &position) in plan.rotary_names.iter().zip(turned) {
                if let Some(axis) = self.chain.axis_index(name) {
                    prescribed[axis] = Some(position);
                }
            }
            let (position, normal) = part.points[point];
            let target = Target {
                ball: position,
                orientation: None,
            };
            let positions = self
                .chain
                .reach(&target, &prescribed, &start, &part.part_pose, &part.ball)
                .map_err(|error| refused(point, error.to_string()))?;
            let runout = self
                .runout
                .get(&operation.tool_number)
                .map_or(0.0, |tool| tool.radius_change(nominal.tool_height));
            start.clone_from(&positions);
            points.push(CutPoint {
                place: (position, normal.into_inner()),
                positions,
                runout,
            });
        }
        let cut = Cut {
            part,
            volumetric: operation.volumetric,
            points,
        };
        self.machined_deviations(&cut, &self.table, &[])
            .map_err(|error| refused(0, error.to_string()))?;
        Ok(cut)
    }
}
