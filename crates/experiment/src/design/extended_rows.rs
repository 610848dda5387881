//! The rows of a session extended by candidate touches.
//!
//! A candidate touch has its ball where a perfect cell would have it; its axes stand where the inverse kinematics of the
//! chain puts them. Candidates outside the travels are left out. Metres, radians, seconds of the session.

use machine::{Nominal, Target};
use probecell_msgs::{InspectionPlan, InspectionPoint};

use effects::observation::{Observations, Pose, Row, cut_pose, free_speeds};

/// A touch that could be taken.
#[derive(Debug, Clone)]
pub(crate) struct CandidateTouch {
    /// What a plan would say of it.
    pub(crate) point: InspectionPoint,
    /// Row whose axis positions begin the search for its own, and whose covariates it shares.
    pub(crate) near: usize,
    /// When it would be taken, s from the start of the session.
    pub(crate) time: f64,
    /// What it does that the plan did not, for a person.
    pub(crate) why: &'static str,
}

/// Rows of the touches taken and of candidate touches.
pub(crate) struct ExtendedRows {
    /// Touches taken, then candidates, then references.
    pub(crate) observations: Observations,
    /// First row of a candidate.
    pub(crate) first: usize,
    /// The candidates that are within reach, row by row.
    pub(crate) wanted: Vec<CandidateTouch>,
}

impl ExtendedRows {
    /// Adds the reachable ones of the candidates `wanted`; `plan` is the plan that was measured.
    pub(crate) fn new(
        known: &Observations,
        plan: &InspectionPlan,
        wanted: Vec<CandidateTouch>,
    ) -> Self {
        let first = known.touches();
        let mut observations = known.clone();
        let rows = &mut observations.rows;
        let references = rows.split_off(first);
        rows.reserve_exact(wanted.len() + references.len());
        let mut kept = Vec::new();
        let extended = InspectionPlan {
            points: wanted.iter().map(|wanted| wanted.point.clone()).collect(),
            ..plan.clone()
        };
        if let Ok(nominal) = Nominal::from_plan(&extended) {
            for (index, wanted) in wanted.into_iter().enumerate() {
                if let Some(row) = row(known, plan, &nominal, index, &wanted) {
                    rows.push(row);
                    kept.push(wanted);
                }
            }
        }
        rows.extend(references);
        observations.deviations = vec![0.0; rows.len()];
        Self {
            observations,
            first,
            wanted: kept,
        }
    }

    /// Rows of the candidates.
    pub(crate) fn rows(&self) -> &[Row] {
        &self.observations.rows[self.first..self.first + self.wanted.len()]
    }

    /// Values of the rows taken, with `fill` for the candidates.
    pub(crate) fn fill<T: Copy>(&self, taken: &[T], fill: T) -> Vec<T> {
        let mut values = taken[..self.first].to_vec();
        values.resize(self.first + self.wanted.len(), fill);
        values.extend(&taken[self.first..]);
        values
    }
}

fn row(
    observations: &Observations,
    plan: &InspectionPlan,
    nominal: &Nominal,
    index: usize,
    wanted: &CandidateTouch,
) -> Option<Row> {
    let (chain, prescribed) = (&observations.chain, &observations.prescribed);
    let near = observations.rows.get(wanted.near)?;
    let start = &near.pose.as_ref()?.positions;
    let (position, normal) = nominal.points[index];
    let mut fixed = vec![None; chain.axes().len()];
    for (&axis, &at) in prescribed.iter().zip(&wanted.point.rotary_positions) {
        fixed[axis] = Some(at);
    }
    let (part, ball) = (&nominal.part_pose, &nominal.ball);
    let orientation = prescribed
        .is_empty()
        .then(|| chain.part_from_mount(start, part).rotation);
    let target = Target {
        ball: position + normal.into_inner() * nominal.ball_radius,
        orientation,
    };
    let positions = chain.reach(&target, &fixed, start, part, ball).ok()?;
    let sensitivity = chain.sensitivity(&positions, part, ball);
    let velocity = normal.into_inner() * -wanted.point.feed;
    let speeds = free_speeds(chain, prescribed, &sensitivity, &velocity);
    let operation = usize::try_from(wanted.point.operation)
        .ok()
        .and_then(|index| plan.operations.get(index));
    let cut = operation
        .filter(|_| plan.machined_on_this_machine)
        .and_then(|operation| {
            let rotary = &operation.rotary_positions;
            cut_pose(chain, nominal, prescribed, &position, rotary)
        });
    let last = &observations.rows[observations.touches() - 1];
    Some(Row {
        point: wanted.near,
        feature: wanted.point.feature as usize,
        sequence: None,
        index: index_of(observations, &positions),
        time: wanted.time,
        feed: wanted.point.feed,
        position,
        normal: normal.into_inner(),
        surface: nominal.surfaces[index],
        pose: Some(Pose {
            latched: positions.clone(),
            // Nobody knows yet where the axes come from.
            arrived: vec![0.0; positions.len()],
            positions,
            sensitivity,
            speeds,
        }),
        cut,
        kelvin_above_20_celsius: last.kelvin_above_20_celsius,
        responses: last.responses.clone(),
        tool: operation.map(|operation| operation.tool_number),
        cut_length: wanted.point.cut_length,
        tool_height: wanted.point.tool_height,
        overhang: wanted.point.overhang,
        weight: 1.0,
    })
}

/// The combination of prescribed positions, a new one when it was not met.
fn index_of(observations: &Observations, positions: &[f64]) -> usize {
    let same = |row: &&Row| {
        row.pose.as_ref().is_some_and(|pose| {
            let close = |&axis: &usize| (pose.positions[axis] - positions[axis]).abs() < 1e-4;
            observations.prescribed.iter().all(close)
        })
    };
    let most = observations.rows.iter().map(|row| row.index + 1).max();
    observations
        .rows
        .iter()
        .find(same)
        .map_or(most.unwrap_or(0), |row| row.index)
}
