//! `axis.<A>.backlash`: lost motion on reversal (ISO 230-2, reversal error).
//!
//! δq = −½·b·sgn(speed): the slide hangs behind its drive, seen from either side. A slide that stands while it is read has
//! no speed: where its targets are approached from both sides, the sign of its last move takes the place of the speed
//! (`last_move` 1). There the standard states a reversal error for each target, and a worn screw loses more where it was used
//! most: b is the mean over the travel, b1, b2, … what evenly spaced places from one end to the other add to it, between which
//! it is interpolated linearly (constant `places`). Typical 1–15 µm.

use std::collections::BTreeMap;

use machine::{Chain, JointKind};
use nalgebra::{DMatrix, DVector};

use crate::effect::{ActsOn, Constants, Definition, Effect, Instance, Subject};
use crate::observation::{Observations, Pose};
use crate::variant::{Parameter, Variant};

use super::cyclic::distinct_positions;

pub(super) struct Backlash;

impl Effect for Backlash {
    fn definition(&self) -> Definition {
        Definition {
            id: "axis.<A>.backlash",
            name: "backlash of axis <A>: lost motion on reversal",
            remedy: "adjust the preload of the screw, or correct the backlash compensation of the control",
            parameters: &[],
            acts_on: ActsOn::of(Subject::Machine),
        }
    }

    fn parameters(&self, chain: &Chain, of: &Instance<'_>) -> Vec<Parameter> {
        let unit = if of.turns(chain) { "rad" } else { "m" };
        vec![Parameter::new("b", unit, 2e-4)]
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let moving = (rows.chain.axis_names().enumerate())
            .filter(|(axis, _)| !rows.prescribed.contains(axis));
        moving
            .flat_map(|(axis, name)| {
                let of = Instance::on(name);
                let both = from_both_sides(rows, axis);
                let standing = both.then(|| self.standing(&rows.chain, &of)).flatten();
                let varying = (both && distinct_positions(rows, axis) >= 2 * PLACES)
                    .then(|| self.varying(&rows.chain, &of, rows.travel(axis), PLACES))
                    .flatten()
                    .map(|variant| variant.with_prior_weight(VARYING));
                let moving = self.on_joint(&rows.chain, &of, |pose, axis| pose.speeds[axis]);
                moving.into_iter().chain(standing).chain(varying)
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
        let places = (constants.get("places", PLACES as f64).round() as usize).clamp(2, MOST);
        let moving = self.on_joint(chain, of, |pose, axis| pose.speeds[axis]);
        let standing = self.standing(chain, of);
        let varying = self.varying(chain, of, travel, places);
        moving.into_iter().chain(standing).chain(varying).collect()
    }
}

/// Places over the travel at which the lost motion may differ, both ends included, and the most that may be declared.
const PLACES: usize = 7;
const MOST: usize = 64;
/// Prior weight of a lost motion that varies over the travel.
const VARYING: f64 = 0.3;
/// Prior standard deviation of what a place adds, over that of the mean, and over what share of the travel it changes.
const SHARE: f64 = 0.2;
const LENGTH: f64 = 0.4;

/// Fewest targets that are approached from both sides.
const FEWEST: usize = 3;
/// Targets closer than this are one, m or rad.
const SAME: f64 = 1e-4;

/// True where most readings along an axis were taken at targets that it approached from both sides.
fn from_both_sides(rows: &Observations, axis: usize) -> bool {
    let mut targets: BTreeMap<(i64, [i64; 3]), [usize; 2]> = BTreeMap::new();
    for row in &rows.rows {
        let Some(pose) = &row.pose else { continue };
        if row.normal.dot(&pose.sensitivity.axes[axis]) == 0.0 || pose.arrived[axis] == 0.0 {
            continue;
        }
        let place = (pose.latched[axis] / SAME).round() as i64;
        let facing = [0, 1, 2].map(|k| (row.normal[k] * 1e3).round() as i64);
        let sides = targets.entry((place, facing)).or_default();
        sides[usize::from(pose.arrived[axis] > 0.0)] += 1;
    }
    let all: usize = targets.values().flatten().sum();
    let both: Vec<usize> = (targets.values())
        .filter(|sides| sides.iter().all(|&side| side > 0))
        .map(|sides| sides.iter().sum())
        .collect();
    both.len() >= FEWEST && 2 * both.iter().sum::<usize>() > all
}

impl Backlash {
    /// Of slides that stand while they are read.
    fn standing(&self, chain: &Chain, of: &Instance<'_>) -> Option<Variant> {
        let variant = self.on_joint(chain, of, |pose, axis| pose.arrived[axis])?;
        Some(variant.with_constants(&[("last_move", 1.0, "1")]))
    }

    /// The same, another one at each place of the travel.
    fn varying(
        &self,
        chain: &Chain,
        of: &Instance<'_>,
        (from, to): (f64, f64),
        places: usize,
    ) -> Option<Variant> {
        let (axis, joint) = of.joint(chain)?;
        if joint.kind != JointKind::Prismatic {
            return None;
        }
        let mean = self.parameters(chain, of).pop()?;
        let added = (1..=places).map(|place| Parameter {
            name: format!("b{place}"),
            ..mean.clone()
        });
        let parameters = std::iter::once(mean.clone()).chain(added).collect();
        let spacing = (to - from) / (places as f64 - 1.0);
        let variant = Variant::linear(of.id(self.id()), parameters, move |rows| {
            let column = |place: Option<usize>| {
                rows.machine_column(false, |pose, _| {
                    let along =
                        ((pose.positions[axis] - from) / spacing).clamp(0.0, places as f64 - 1.0);
                    let share =
                        place.map_or(1.0, |place| (1.0 - (along - place as f64).abs()).max(0.0));
                    pose.sensitivity.axes[axis] * (-0.5 * side(pose.arrived[axis]) * share)
                })
            };
            let added = (0..places).map(|place| column(Some(place)));
            std::iter::once(column(None)).chain(added).collect()
        });
        let variant = variant.with_prior_covariance(covariance(places));
        Some(variant.with_constants(&[
            ("last_move", 1.0, "1"),
            ("from", from, "m"),
            ("to", to, "m"),
            ("places", places as f64, "1"),
        ]))
    }

    /// `moves` is positive where the drive moved forwards, negative where it moved back, 0 where nobody can say.
    fn on_joint(
        &self,
        chain: &Chain,
        of: &Instance<'_>,
        moves: fn(&Pose, usize) -> f64,
    ) -> Option<Variant> {
        let (axis, _) = of.joint(chain)?;
        let parameters = self.parameters(chain, of);
        Some(Variant::linear(of.id(self.id()), parameters, move |rows| {
            vec![rows.machine_column(false, |pose, _| {
                pose.sensitivity.axes[axis] * (-0.5 * side(moves(pose, axis)))
            })]
        }))
    }
}

/// The side from which a move comes: 1 forwards, −1 back, 0 where nobody can say.
fn side(moved: f64) -> f64 {
    if moved == 0.0 { 0.0 } else { moved.signum() }
}

/// Prior covariance of the mean and of what each place adds: a smooth function whose mean over the places is zero.
fn covariance(places: usize) -> DMatrix<f64> {
    let last = places as f64 - 1.0;
    let smooth = DMatrix::from_fn(places, places, |i, j| {
        let apart = i.abs_diff(j) as f64 / (last * LENGTH);
        SHARE * SHARE * (-0.5 * apart * apart).exp()
    });
    let sums: DVector<f64> = smooth.column_sum();
    let around = &smooth - &sums * sums.transpose() / sums.sum();
    DMatrix::from_fn(places + 1, places + 1, |i, j| match (i, j) {
        (0, 0) => 1.0,
        (0, _) | (_, 0) => 0.0,
        _ => around[(i - 1, j - 1)],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_session::{predicts, session};

    /// Slides that stand at their targets, each approached from both sides: the side is that of the last move.
    #[test]
    fn targets_approached_from_both_sides_show_it_at_a_standstill() {
        let mut once = session();
        for event in &mut once.events {
            event.feed = 0.0;
        }
        let mut twice = once.clone();
        let last = once.events.len() as u64;
        for (number, event) in once.events.iter().rev().enumerate() {
            let mut back = event.clone();
            back.sequence = last + number as u64;
            back.header.stamp.sec = 5000 + 8 * number as i32;
            twice.events.push(back);
        }
        let offered = |session: &crate::Session| {
            let rows = crate::observe(session).expect("rows");
            Backlash.offer(&rows).into_iter().any(|one| {
                one.effect == "axis.X.backlash"
                    && one.constants == [("last_move", 1.0, "1")]
                    && one.columns(&rows, 0.0)[0]
                        .signature
                        .iter()
                        .any(|part| part.abs() > 0.1)
            })
        };
        assert!(offered(&twice));
        assert!(!offered(&once), "nothing is approached twice");
    }

    /// What the places add is a smooth function without a mean.
    #[test]
    fn the_mean_over_the_travel_is_the_mean() {
        let covariance = covariance(7);
        let added = covariance.view((1, 1), (7, 7));
        assert!(added.row_sum().amax() < 1e-12);
        assert!(added.diagonal().min() > 0.0 && covariance[(0, 0)] > added.diagonal().max());
    }

    #[test]
    fn half_the_lost_motion_on_either_side() {
        predicts("axis.X.backlash", &[("b", 8e-6, "m")], |seen| {
            let across = seen.normal.x.abs();
            if across > 1e-6 { -4e-6 * across } else { 0.0 }
        });
    }
}
