//! Features that are cut point by point: where the true machine leads the true tool.

use machine::{JointKind, Nominal, PositionError, Surface, Target};
use nalgebra::{Point3, Unit, UnitQuaternion, Vector3};
use probecell_msgs::InspectionPlan;

use crate::{
    config::{Config, ConfigError},
    joint::Joint,
    points::{Cut, CutPoint, points_of},
    raw::RawOperation,
    truth::Truth,
};

impl Config {
    /// The volumetric table with those values of its entries.
    pub(crate) fn table_of(&self, values: &[f64]) -> Truth {
        self.table.with_entries(values)
    }

    /// Positions of the axes (m, rad) for programme positions with these work offsets (m); the programme's own where an arm
    /// does not get to the displaced place.
    pub(crate) fn offset(
        &self,
        positions: &[f64],
        work_offsets: &[f64],
        part: &Nominal,
    ) -> Vec<f64> {
        let offsets = self.work_offset_axes.iter().copied();
        let offsets = offsets.zip(work_offsets.iter().copied());
        (self.chain)
            .with_work_offsets(positions, offsets, &part.part_pose, &part.ball)
            .unwrap_or_else(|_| positions.to_vec())
    }

    /// True errors at axis positions (m, rad), on a move along `direction`: those of the axes and joints, and of the clamping
    /// of the part.
    pub(crate) fn errors(&self, positions: &[f64], direction: &[f64]) -> machine::ChainErrors {
        let mut errors = self.truth.at(&self.chain, positions);
        for (error, clamping) in errors.part.iter_mut().zip(self.clamping) {
            *error += clamping;
        }
        let off = Joint::errors(&self.joints, &self.chain, positions, direction);
        for (axis, off) in off.into_iter().enumerate() {
            let joint = self.chain.axis(axis);
            let first = if joint.kind == JointKind::Revolute {
                3
            } else {
                0
            };
            let motion = &mut errors.motion[self.chain.axes()[axis]];
            for (component, share) in joint.axis.iter().enumerate() {
                motion[first + component] += off * share;
            }
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
            let commanded = self.offset(&point.positions, work_offsets, &cut.part);
            let positions = if cut.volumetric {
                table.corrected(&self.chain, &commanded, part_pose, ball)?
            } else {
                commanded
            };
            // A tool is led over the surface from all sides: lost motion is not in what it leaves.
            let errors = self.errors(&positions, &vec![0.0; positions.len()]);
            let tip = self
                .chain
                .ball_in_part_with(&positions, part_pose, ball, &errors);
            let (position, normal) = point.place;
            Ok(normal.dot(&(tip - position)) - point.runout)
        });
        deviations.collect()
    }

    /// Programme positions of the axes (m, rad) that hold the tool of an operation at a point; an arm takes the posture nearest
    /// to `start`.
    fn cutting_positions(
        &self,
        operation: &RawOperation,
        part: &Nominal,
        point: Point3<f64>,
        prescribed: &[Option<f64>],
        start: &[f64],
    ) -> Result<Vec<f64>, String> {
        let (pose, ball) = (&part.part_pose, &part.ball);
        let Some(direction) = operation.tool_direction else {
            let target = Target {
                ball: point,
                orientation: None,
            };
            let reached = self.chain.reach(&target, prescribed, start, pose, ball);
            return reached.map_err(|error| error.to_string());
        };
        let attitude = attitude(part, direction, operation.tool_turn_deg)
            .ok_or("tool_direction is no direction, or the ball is in the origin of the mount")?;
        let at = (&point, &attitude);
        let postures = self.chain.postures(at, prescribed, start, pose, ball);
        let apart = |posture: &Vec<f64>| self.chain.motion().time(start, posture);
        let nearest = postures
            .into_iter()
            .min_by(|a, b| apart(a).total_cmp(&apart(b)));
        nearest.ok_or_else(|| "no posture of the arm holds the tool there".to_owned())
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
            let positions = self
                .cutting_positions(operation, &part, position, &prescribed, &start)
                .map_err(|reason| refused(point, reason))?;
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
        let surfaces = points_of(plan, feature).map(|point| part.surfaces[point]);
        let cut = Cut {
            inner: surfaces
                .into_iter()
                .any(|one| matches!(one, Surface::Bore(..))),
            part,
            volumetric: operation.volumetric,
            points,
        };
        self.machined_deviations(&cut, &self.table, &[])
            .map_err(|error| refused(0, error.to_string()))?;
        Ok(cut)
    }
}

/// Part from probe mount where the tool's shank points along `direction` (part frame), turned about it.
fn attitude(part: &Nominal, direction: [f64; 3], turn_deg: f64) -> Option<UnitQuaternion<f64>> {
    let shank = Unit::try_new(Vector3::from(direction), 1e-9)?;
    let own = Unit::try_new(-part.ball.coords, 1e-9)?;
    // Half a turn about any axis across it, where the directions are opposite.
    let upright = UnitQuaternion::rotation_between_axis(&own, &shank).unwrap_or_else(|| {
        let across = Unit::new_normalize(own.cross(&Vector3::ith(own.iamin(), 1.0)));
        UnitQuaternion::from_axis_angle(&across, std::f64::consts::PI)
    });
    Some(UnitQuaternion::from_axis_angle(&shank, turn_deg.to_radians()) * upright)
}
