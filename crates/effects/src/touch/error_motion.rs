//! `axis.<A>.error_motion`: radial error motion of a rotary axis, a harmonic of its angle (ISO 230-7).
//!
//! Radial run-out in the frame at rest: along one direction across the axis, e = a·sin(k·q + phase), or on a circle with
//! or against the turn. k is profiled from 1 to 3 where enough angles are visited. Typical 1–10 µm; at least six angles
//! distinguish it from a location error of the axis. The bearings of an arm run true to micrometres, while its links err by hundreds and
//! look the same: there it is not offered.

use machine::{Chain, JointKind};
use nalgebra::Vector3;

use super::indexing::distinct_angles;
use crate::effect::{ActsOn, Constants, Coordinate, Definition, Effect, Instance, Subject};
use crate::observation::{Observations, Pose};
use crate::variant::{Variant, is_arm};

/// Fewest angles at which it is an effect of its own: at one or two, a run-out is a location error by another name.
const FEWEST: usize = 3;

pub(super) struct ErrorMotion;

impl Effect for ErrorMotion {
    fn definition(&self) -> Definition {
        Definition {
            id: "axis.<A>.error_motion",
            name: "error motion of rotary axis <A>: radial run-out, harmonic in the angle",
            remedy: "check bearings and seat of the rotary axis by a run-out measurement over a full turn",
            parameters: &[("sin", "m", 1e-4), ("cos", "m", 1e-4)],
            acts_on: ActsOn::of(Subject::Machine).smooth_in(&[Coordinate::AxisPosition]),
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let axes = rows.chain.axis_names().enumerate();
        axes.flat_map(|(axis, name)| {
            let angles = distinct_angles(rows, axis);
            let highest = ((angles as f64 - 1.0) / 2.0).ceil().clamp(1.0, 3.0);
            let variants = self.variants(&rows.chain, &Instance::on(name), highest);
            let offered = variants.into_iter();
            offered.map(move |variant| variant.confounded_where(angles < FEWEST))
        })
        .collect()
    }

    fn declared(&self, chain: &Chain, of: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        self.variants(chain, of, 1.0)
    }
}

impl ErrorMotion {
    /// Along both directions across the axis, and on a circle with and against the turn.
    fn variants(&self, chain: &Chain, of: &Instance<'_>, highest: f64) -> Vec<Variant> {
        let Some((axis, joint)) = of.joint(chain) else {
            return Vec::new();
        };
        let across = (0..3).filter(|&component| joint.axis[component].abs() < 0.7);
        let across: Vec<usize> = across.collect();
        let [u, v] = across[..] else {
            return Vec::new();
        };
        if is_arm(chain) || joint.kind != JointKind::Revolute {
            return Vec::new();
        }
        let index = chain.axes()[axis];
        let mut variants = Vec::new();
        for component in [u, v] {
            let build = move |rows: &Observations, k: f64| {
                let column = |wave: fn(f64) -> f64| {
                    rows.machine_column(true, |pose, _| {
                        pose.sensitivity.location[index][component] * wave(k * pose.positions[axis])
                    })
                };
                vec![column(f64::sin), column(f64::cos)]
            };
            let parameters = self.parameters(chain, of);
            let variant = Variant::harmonic(of.id(self.id()), parameters, highest, build);
            variants.push(variant.with_constants(&[("along", component as f64, "1")]));
        }
        for sense in [1.0, -1.0] {
            let build = move |rows: &Observations, k: f64| {
                let circle = move |pose: &Pose, ahead: f64| -> Vector3<f64> {
                    let angle = k * pose.positions[axis] + ahead;
                    let frame = &pose.sensitivity.location[index];
                    frame[u] * angle.sin() - frame[v] * (sense * angle.cos())
                };
                [0.0, std::f64::consts::FRAC_PI_2]
                    .map(|ahead| rows.machine_column(true, |pose, _| circle(pose, ahead)))
                    .into()
            };
            let parameters = self.parameters(chain, of);
            let variant = Variant::harmonic(of.id(self.id()), parameters, highest, build);
            variants.push(variant.with_constants(&[("sense", sense, "1")]));
        }
        variants
    }
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    /// The table runs out along x of the foundation: it carries the part towards the ball.
    #[test]
    fn run_out_along_one_direction_repeats_with_the_turn() {
        let wave = [
            ("a", 4e-6, "m"),
            ("phase", 0.2, "rad"),
            ("k", 1.0, "1"),
            ("along", 0.0, "1"),
        ];
        predicts("axis.C.error_motion", &wave, |seen| {
            seen.normal.x * 4e-6 * (seen.position("C") + 0.2).sin()
        });
    }
}
