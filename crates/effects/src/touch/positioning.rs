//! `axis.<A>.positioning`: the positioning error of a linear axis as a table over its position (ISO 230-2).
//!
//! δq is interpolated linearly between evenly spaced targets over the travel used; each inner target has its mean
//! bidirectional positioning error, and both ends have none: what is left at them, a constant and a slope, is the
//! axis's place and its `scale`. The errors of an axis whose targets are read repeatedly are a smooth function of its position:
//! a Gaussian process (Rasmussen and Williams 2006, 4.2: squared exponential, several lengths), so that a table with many
//! targets costs no more than the curve that it holds; between targets runs a cubic spline (constant `cubic` 1; de Boor 1978,
//! ch. IV). Such a table may have errors at both ends too (constant `ends` 1), as the standard states it: a curve need not begin
//! and end at nothing. What repeats with a pitch is `cyclic`. Typical 1–10 µm.

use std::ops::RangeInclusive;

use machine::{Chain, JointKind};
use nalgebra::DMatrix;

use super::cyclic::{FEWEST, distinct_positions};
use crate::effect::{ActsOn, Constants, Coordinate, Definition, Effect, Instance, Subject};
use crate::observation::Observations;
use crate::variant::{Parameter, Variant, linear_axes};

/// Inner targets of the tables that are offered, with their prior weights. None is the usual way of an axis to err: a table
/// follows any few touches, so that it must not decide which of them are outliers.
const TARGETS: [(usize, f64); 4] = [(3, 0.5), (7, 0.25), (15, 0.12), (31, 0.06)];
/// Correlation lengths, as shares of the travel, of the smooth tables, which are offered where each position is visited often;
/// and their inner targets: spacings of less than half a length, over which a cubic spline is the curve.
const SMOOTH: [(f64, usize); 3] = [(0.3, 7), (0.1, 21), (0.04, 51)];
/// The constant that says that a table is smooth.
const CUBIC: &str = "cubic";
/// The constant that says that a table has errors at both ends of the travel.
const ENDS: &str = "ends";
/// Positions that the touches must visit for each target.
const POSITIONS: usize = 5;
/// The same where each position is visited so often that its own mean is known (ISO 230-2: five times from either side).
const REPEATED: (usize, usize) = (2, 4);
/// Travel below which a table cannot be distinguished from a few other errors, m.
const SHORTEST: f64 = 0.02;
/// Largest number of inner targets that a declared table may have.
const MOST: usize = 64;
/// The constant that holds how many inner targets a table has; without it they are those whose errors are given.
const TARGET_COUNT: &str = "targets";

pub(super) struct Positioning;

impl Effect for Positioning {
    fn definition(&self) -> Definition {
        Definition {
            id: "axis.<A>.positioning",
            name: "positioning error of axis <A>, a table over its position",
            remedy: "calibrate the axis at targets over its travel and correct it by a table in the control",
            parameters: &[],
            acts_on: ActsOn::of(Subject::Machine).smooth_in(&[Coordinate::AxisPosition]),
        }
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters(Table::straight(TARGETS[0].0))
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let moving = linear_axes(rows, SHORTEST);
        moving
            .flat_map(|(axis, travel)| {
                let positions = distinct_positions(rows, axis);
                let repeated = rows.touches() >= REPEATED.1 * positions;
                let for_each = if repeated { REPEATED.0 } else { POSITIONS };
                let straight = TARGETS
                    .into_iter()
                    .map(|(targets, weight)| (Table::straight(targets), weight));
                // A curve of single readings may as well be the form of the part.
                let smooth = SMOOTH.into_iter().filter(move |_| repeated);
                let smooth = smooth.flat_map(|(length, targets)| {
                    [false, true].map(|ends| {
                        let table = Table {
                            targets,
                            smooth: Some(length),
                            ends,
                        };
                        (table, 1.0)
                    })
                });
                let tables = straight.chain(smooth).filter(move |(table, _)| {
                    // What a smooth table says between positions its prior says.
                    let for_each = table.smooth.map_or(for_each, |_| 1);
                    positions >= FEWEST.max(for_each * table.targets)
                });
                tables.filter_map(move |(table, weight)| {
                    let of = Instance::on(&rows.chain.axis(axis).name);
                    let variant = self.on_joint(&rows.chain, &of, travel, table)?;
                    let variant = variant.with_constants(&all_constants(travel, table));
                    // Who reads each target repeatedly looks for such a table.
                    Some(variant.with_prior_weight(if repeated { 1.0 } else { weight }))
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
        let is_declared = |target: &usize| constants.find(&name(*target)).is_some();
        let number = constants.find(TARGET_COUNT);
        let targets = number.map_or_else(
            || (1..=MOST).take_while(is_declared).count().max(1),
            |number| (number.round() as usize).clamp(1, MOST),
        );
        let table = Table {
            targets,
            smooth: (constants.get(CUBIC, 0.0) > 0.5).then_some(SMOOTH[0].0),
            ends: constants.get(ENDS, 0.0) > 0.5,
        };
        let Some(variant) = self.on_joint(chain, of, travel, table) else {
            return Vec::new();
        };
        if number.is_none() {
            return vec![variant];
        }
        // A target near which nothing was touched has no error in a report.
        let numbers = table.numbers().enumerate();
        let declared: Vec<usize> = numbers
            .filter(|(_, number)| is_declared(number))
            .map(|(index, _)| index)
            .collect();
        vec![
            variant
                .with_only(&declared)
                .with_constants(&all_constants(travel, table)),
        ]
    }
}

/// What kind of table.
#[derive(Debug, Clone, Copy)]
struct Table {
    /// Number of inner targets.
    targets: usize,
    /// A cubic spline runs between the targets, whose errors are correlated over this share of the travel; `None`: straight
    /// lines between independent errors.
    smooth: Option<f64>,
    /// The ends of the travel have errors too.
    ends: bool,
}

impl Table {
    fn straight(targets: usize) -> Self {
        Self {
            targets,
            smooth: None,
            ends: false,
        }
    }

    /// Numbers of the targets that have an error; the ends are 0 and one more than there are inner ones.
    fn numbers(self) -> RangeInclusive<usize> {
        if self.ends {
            0..=self.targets + 1
        } else {
            1..=self.targets
        }
    }
}

/// Name of the error at a target, the inner ones counted from 1.
fn name(target: usize) -> String {
    format!("e{target}")
}

/// The travel and the kind of table.
fn all_constants((from, to): (f64, f64), table: Table) -> Vec<(&'static str, f64, &'static str)> {
    let mut all = vec![
        ("from", from, "m"),
        ("to", to, "m"),
        (TARGET_COUNT, table.targets as f64, "1"),
    ];
    all.extend(table.smooth.map(|_| (CUBIC, 1.0, "1")));
    all.extend(table.ends.then_some((ENDS, 1.0, "1")));
    all
}

fn parameters(table: Table) -> Vec<Parameter> {
    let of = |target| Parameter::new(name(target), "m", 1e-4);
    table.numbers().map(of).collect()
}

impl Positioning {
    /// A table whose targets are evenly spaced over the travel.
    fn on_joint(
        &self,
        chain: &Chain,
        of: &Instance<'_>,
        (from, to): (f64, f64),
        table: Table,
    ) -> Option<Variant> {
        let (axis, joint) = of.joint(chain)?;
        if joint.kind != JointKind::Prismatic {
            return None;
        }
        let last = table.targets as f64 + 1.0;
        let spacing = (to - from) / last;
        let build = move |rows: &Observations| {
            let bends = table.smooth.map(|_| bends(table.targets));
            rows.machine_columns(true, table.numbers().count(), |pose, _, displacements| {
                let along = ((pose.positions[axis] - from) / spacing).clamp(0.0, last);
                for (displacement, target) in displacements.iter_mut().zip(table.numbers()) {
                    let straight = (1.0 - (along - target as f64).abs()).max(0.0);
                    let bent = bends
                        .as_ref()
                        .map_or(0.0, |bends| bend(bends, target, along));
                    *displacement = pose.sensitivity.axes[axis] * (straight + bent);
                }
            })
        };
        let variant = Variant::linear(of.id(self.id()), parameters(table), build);
        let variant = variant.with_constants(&[("from", from, "m"), ("to", to, "m")]);
        Some(match table.smooth {
            Some(length) => variant.with_prior_covariance(covariance(table, length)),
            None => variant,
        })
    }
}

/// Prior covariance of the errors at the targets of a table, correlated over this share of the travel; where the ends have none,
/// given that.
fn covariance(table: Table, length: f64) -> DMatrix<f64> {
    let (count, last) = (table.targets + 2, table.targets + 1);
    let all = DMatrix::from_fn(count, count, |i, j| {
        let apart = i.abs_diff(j) as f64 / (last as f64 * length);
        (-0.5 * apart * apart).exp()
    });
    if table.ends {
        return all;
    }
    let inner = all.view((1, 1), (table.targets, table.targets));
    let across = all.columns(0, count).select_columns(&[0, last]);
    let at_ends = across.select_rows(&[0, last]);
    let across = across.rows(1, table.targets);
    match at_ends.try_inverse() {
        Some(inverse) => inner - across * inverse * across.transpose(),
        None => inner.into_owned(),
    }
}

/// Second derivatives, per spacing², at both ends and the inner targets (rows) of the cubic spline that is 1 at one of them
/// (columns) and 0 at the others; not a knot at the first and the last inner target, since nothing says that the curve is
/// straight where the travel ends.
fn bends(targets: usize) -> DMatrix<f64> {
    let last = targets + 1;
    // Continuity of the slope: M(i−1)/6 + 2M(i)/3 + M(i+1)/6 = y(i−1) − 2y(i) + y(i+1).
    let slopes = DMatrix::from_fn(targets + 2, targets + 2, |row, column| {
        let (end, inwards) = (row == 0 || row == last, row.abs_diff(column));
        match (end, inwards) {
            (true, 0 | 2) => 1.0,
            (true, 1) => -2.0,
            (false, 0) => 2.0 / 3.0,
            (false, 1) => 1.0 / 6.0,
            _ => 0.0,
        }
    });
    let values = DMatrix::from_fn(targets + 2, targets + 2, |row, column| {
        match (row == 0 || row == last, row.abs_diff(column)) {
            (false, 0) => -2.0,
            (false, 1) => 1.0,
            _ => 0.0,
        }
    });
    let solved = slopes.lu().solve(&values);
    solved.unwrap_or_else(|| DMatrix::zeros(targets + 2, targets + 2))
}

/// What a spline of these second derivatives, 1 at `target`, adds to the straight lines between targets at a place in
/// spacings from the beginning of the travel, within it.
fn bend(bends: &DMatrix<f64>, target: usize, along: f64) -> f64 {
    let spacings = bends.ncols() - 1;
    let before = (along as usize).min(spacings - 1);
    let (past, ahead) = (along - before as f64, before as f64 + 1.0 - along);
    let at = |index: usize| bends[(index, target)];
    let cubic = |share: f64| share * (share * share - 1.0);
    (cubic(ahead) * at(before) + cubic(past) * at(before + 1)) / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_session::{predicts, session};

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

    /// Between its targets a smooth table follows any cubic exactly: one that vanishes at both ends of the travel.
    #[test]
    fn a_smooth_table_follows_a_cubic() {
        let curve = |q: f64| 0.3 * (q + 0.04) * (q - 0.04) * (q - 0.013);
        let table = [
            ("e1", curve(-0.02), "m"),
            ("e2", curve(0.0), "m"),
            ("e3", curve(0.02), "m"),
            ("from", -0.04, "m"),
            ("to", 0.04, "m"),
            ("targets", 3.0, "1"),
            ("cubic", 1.0, "1"),
        ];
        predicts("axis.X.positioning", &table, |seen| {
            let q = seen.position("X");
            let within = (-0.04..=0.04).contains(&q);
            -seen.normal.x * if within { curve(q) } else { 0.0 }
        });
    }

    /// With errors at both ends it follows any cubic.
    #[test]
    fn a_smooth_table_with_ends_follows_any_cubic() {
        let curve = |q: f64| 2e-6 + 1e-4 * q - 3e-3 * q * q + 0.3 * q.powi(3);
        let errors = [-0.04, -0.02, 0.0, 0.02, 0.04].map(curve);
        let table = [
            ("e0", errors[0], "m"),
            ("e1", errors[1], "m"),
            ("e2", errors[2], "m"),
            ("e3", errors[3], "m"),
            ("e4", errors[4], "m"),
            ("from", -0.04, "m"),
            ("to", 0.04, "m"),
            ("targets", 3.0, "1"),
            ("cubic", 1.0, "1"),
            ("ends", 1.0, "1"),
        ];
        predicts("axis.X.positioning", &table, |seen| {
            -seen.normal.x * curve(seen.position("X").clamp(-0.04, 0.04))
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
