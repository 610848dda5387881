//! `axis.<A>.positioning`: the positioning error of a linear axis as a table over its position (ISO 230-2).
//!
//! δq is interpolated linearly between evenly spaced targets over the travel used; each inner target has its mean
//! bidirectional positioning error, and both ends have none: what is left at them, a constant and a slope, is the
//! axis's place and its `scale`. What repeats with a pitch is `cyclic`. Typical 1–10 µm.

use machine::{Chain, JointKind};

use super::cyclic::{FEWEST, distinct_positions};
use crate::effect::{ActsOn, Constants, Coordinate, Effect, Instance, Subject};
use crate::library::{Parameter, Variant, linear_axes};
use crate::observation::Observations;

/// Inner targets of the tables that are offered, with their prior weights. None is the usual way of an axis to err: a table
/// follows any few touches, so that it must not tell which of them are outliers.
const TARGETS: [(usize, f64); 4] = [(3, 0.5), (7, 0.25), (15, 0.12), (31, 0.06)];
/// Positions that the touches must visit for each target.
const POSITIONS: usize = 5;
/// The same where each position is visited so often that its own mean is known (ISO 230-2: five times from either side).
const REPEATED: (usize, usize) = (2, 4);
/// Travel below which a table says nothing that a few other errors would not, m.
const SHORTEST: f64 = 0.02;
/// Largest number of inner targets that a declared table may have.
const MOST: usize = 64;
/// The constant that tells how many inner targets a table has; without it they are those whose errors are given.
const TARGETS_TOLD: &str = "targets";

pub(super) struct Positioning;

impl Effect for Positioning {
    fn id(&self) -> &'static str {
        "axis.<A>.positioning"
    }

    fn describe(&self, of: &Instance<'_>) -> String {
        format!(
            "positioning error of axis {}, a table over its position",
            of.axis
        )
    }

    fn remedy(&self) -> &'static str {
        "calibrate the axis at targets over its travel and correct it by a table in the control"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters(TARGETS[0].0)
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn {
            smooth_in: &[Coordinate::AxisPosition],
            ..ActsOn::of(Subject::Machine)
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let moving = linear_axes(rows, SHORTEST);
        moving
            .flat_map(|(axis, travel)| {
                let positions = distinct_positions(rows, axis);
                let repeated = rows.touches() >= REPEATED.1 * positions;
                let for_each = if repeated { REPEATED.0 } else { POSITIONS };
                let targets = TARGETS
                    .into_iter()
                    .filter(move |&(targets, _)| positions >= FEWEST.max(for_each * targets));
                targets.filter_map(move |(targets, weight)| {
                    let of = Instance::on(&rows.chain.axis(axis).name);
                    let way = self.way(&rows.chain, &of, travel, targets)?;
                    let way = way.with_constants(&all_constants(travel, targets));
                    // Who reads each target repeatedly looks for such a table.
                    Some(way.with_prior_weight(if repeated { 1.0 } else { weight }))
                })
            })
            .collect()
    }

    fn declared(
        &self,
        chain: &Chain,
        of: &Instance<'_>,
        constants: &Constants<'_>,
    ) -> Vec<Variant> {
        let travel = (constants.get("from", 0.0), constants.get("to", 1.0));
        let is_told = |target: &usize| constants.find(&name(*target)).is_some();
        let number = constants.find(TARGETS_TOLD);
        let targets = number.map_or_else(
            || (1..=MOST).take_while(is_told).count().max(1),
            |number| (number as usize).clamp(1, MOST),
        );
        let Some(way) = self.way(chain, of, travel, targets) else {
            return Vec::new();
        };
        if number.is_none() {
            return vec![way];
        }
        // A target near which nothing was touched has no error in a report.
        let told: Vec<usize> = (1..=targets).filter(is_told).map(|one| one - 1).collect();
        vec![
            way.with_only(&told)
                .with_constants(&all_constants(travel, targets)),
        ]
    }
}

/// Name of the error at an inner target, counted from 1.
fn name(target: usize) -> String {
    format!("e{target}")
}

/// The travel and the number of inner targets.
fn all_constants((from, to): (f64, f64), targets: usize) -> [(&'static str, f64, &'static str); 3] {
    [
        ("from", from, "m"),
        ("to", to, "m"),
        (TARGETS_TOLD, targets as f64, "1"),
    ]
}

fn parameters(targets: usize) -> Vec<Parameter> {
    let of = |target| Parameter::new(name(target), "m", 1e-4);
    (1..=targets).map(of).collect()
}

impl Positioning {
    /// A table with this many inner targets between the ends of the travel.
    fn way(
        &self,
        chain: &Chain,
        of: &Instance<'_>,
        (from, to): (f64, f64),
        targets: usize,
    ) -> Option<Variant> {
        let (axis, joint) = of.joint(chain)?;
        if joint.kind != JointKind::Prismatic {
            return None;
        }
        let spacing = (to - from) / (targets as f64 + 1.0);
        let build = move |rows: &Observations| {
            let hat = |target: usize| {
                let at = from + spacing * target as f64;
                rows.machine_column(true, |pose, _| {
                    let share = 1.0 - ((pose.positions[axis] - at) / spacing).abs();
                    pose.sensitivity.axes[axis] * share.max(0.0)
                })
            };
            (1..=targets).map(hat).collect()
        };
        let variant = Variant::linear(of.id(self.id()), parameters(targets), build);
        Some(variant.with_constants(&[("from", from, "m"), ("to", to, "m")]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::{predicts, session};

    #[test]
    fn the_error_is_interpolated_between_targets() {
        let table = [
            ("e1", 4e-6, "m"),
            ("e2", -2e-6, "m"),
            ("e3", 1e-6, "m"),
            ("from", -0.04, "m"),
            ("to", 0.04, "m"),
        ];
        let targets = [-0.04, -0.02, 0.0, 0.02, 0.04];
        let errors = [0.0, 4e-6, -2e-6, 1e-6, 0.0];
        predicts("axis.X.positioning", &table, |seen| {
            let q = seen.position("X");
            let error = (0..4).find_map(|k| {
                let share = (q - targets[k]) / (targets[k + 1] - targets[k]);
                let between = errors[k] + share * (errors[k + 1] - errors[k]);
                (0.0..=1.0).contains(&share).then_some(between)
            });
            -seen.normal.x * error.unwrap_or(0.0)
        });
    }

    /// A straight line through zero is no table: the ends have no error, and so has what scale and place can say.
    #[test]
    fn tables_are_offered_over_the_travel_used() {
        let rows = crate::observe(&session()).expect("rows");
        let offered = Positioning.offer(&rows);
        assert!(!offered.is_empty());
        for variant in offered {
            let ends = &variant.constants;
            assert!(ends[0].1 < ends[1].1, "{}", variant.effect);
            assert_eq!(variant.parameters.len(), variant.columns(&rows, 0.0).len());
        }
    }
}
