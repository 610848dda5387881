//! `axis.<A>.backlash`: lost motion on reversal (ISO 230-2, reversal error).
//!
//! δq = −½·b·sgn(speed): the slide hangs behind its drive, seen from either side. A slide that stands while it is read has
//! no speed: where its targets are approached from both sides, the sign of its last move takes the place of the speed
//! (`last_move` 1). Typical 1–15 µm.

use std::collections::BTreeMap;

use machine::Chain;

use crate::effect::{ActsOn, Constants, Effect, Instance, Subject};
use crate::library::{Parameter, Variant};
use crate::observation::{Observations, Pose};

pub(super) struct Backlash;

impl Effect for Backlash {
    fn id(&self) -> &'static str {
        "axis.<A>.backlash"
    }

    fn describe(&self, of: &Instance<'_>) -> String {
        format!("backlash of axis {}: lost motion on reversal", of.axis)
    }

    fn remedy(&self) -> &'static str {
        "adjust the preload of the screw, or correct the backlash compensation of the control"
    }

    fn parameters(&self, chain: &Chain, of: &Instance<'_>) -> Vec<Parameter> {
        let unit = if of.turns(chain) { "rad" } else { "m" };
        vec![Parameter::new("b", unit, 2e-4)]
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn::of(Subject::Machine)
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let moving = (rows.chain.axis_names().enumerate())
            .filter(|(axis, _)| !rows.prescribed.contains(axis));
        moving
            .flat_map(|(axis, name)| {
                let of = Instance::on(name);
                let standing = from_both_sides(rows, axis).then(|| self.standing(&rows.chain, &of));
                let moving = self.way(&rows.chain, &of, |pose, axis| pose.speeds[axis]);
                moving.into_iter().chain(standing.flatten())
            })
            .collect()
    }

    fn declared(&self, chain: &Chain, of: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        let moving = self.way(chain, of, |pose, axis| pose.speeds[axis]);
        moving.into_iter().chain(self.standing(chain, of)).collect()
    }
}

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
        let way = self.way(chain, of, |pose, axis| pose.arrived[axis])?;
        Some(way.with_constants(&[("last_move", 1.0, "1")]))
    }

    /// `moves` is positive where the drive moved forwards, negative where it moved back, 0 where nobody can say.
    fn way(
        &self,
        chain: &Chain,
        of: &Instance<'_>,
        moves: fn(&Pose, usize) -> f64,
    ) -> Option<Variant> {
        let (axis, _) = of.joint(chain)?;
        let parameters = self.parameters(chain, of);
        Some(Variant::linear(of.id(self.id()), parameters, move |rows| {
            vec![rows.machine_column(false, |pose, _| {
                let moved = moves(pose, axis);
                let side = if moved == 0.0 { 0.0 } else { moved.signum() };
                pose.sensitivity.axes[axis] * (-0.5 * side)
            })]
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::{predicts, session};

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

    #[test]
    fn half_the_lost_motion_on_either_side() {
        predicts("axis.X.backlash", &[("b", 8e-6, "m")], |seen| {
            let across = seen.normal.x.abs();
            if across > 1e-6 { -4e-6 * across } else { 0.0 }
        });
    }
}
