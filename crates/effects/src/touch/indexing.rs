//! `axis.<A>.indexing`: indexing error of a rotary axis, a harmonic of its angle (ISO 230-2).
//!
//! δq = a·sin(k·q + phase): eccentric scale (k = 1), two-per-turn gears, or the transmission of an arm's joint, whose
//! period is 12–30° of joint angle, so k is profiled up to 36 where the session visits enough angles. Typical
//! 10–500 µrad.
//!
//! A joint that yields under the weight it carries (an arm sags) is off by δq = compliance × effort of gravity, a harmonic in
//! the angles of all joints behind it: where the robot description gives masses, that variant (constant `sag` 1) stands
//! in addition to the harmonics. Typical 0.1–10 µrad per N m.

use machine::{Chain, JointKind};

use crate::effect::{ActsOn, Constants, Coordinate, Definition, Effect, Instance, Subject};
use crate::observation::Observations;
use crate::variant::{Parameter, Variant};

/// Fewest angles at which it is an effect of its own: at one only, a wrong angle is a location error by another name.
const FEWEST: usize = 2;

pub(super) struct Indexing;

impl Effect for Indexing {
    fn definition(&self) -> Definition {
        Definition {
            id: "axis.<A>.indexing",
            name: "indexing error of rotary axis <A>, harmonic in the angle",
            remedy: "calibrate the rotary axis over a full turn and correct it by a table, or centre its scale",
            parameters: &[("sin", "rad", 1e-3), ("cos", "rad", 1e-3)],
            acts_on: ActsOn::of(Subject::Machine).smooth_in(&[Coordinate::AxisPosition]),
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let axes: Vec<(usize, &str)> = rows.chain.axis_names().enumerate().collect();
        let harmonics = axes.iter().filter_map(|&(axis, name)| {
            let angles = distinct_angles(rows, axis);
            let variant = self.on_joint(&rows.chain, &Instance::on(name), highest(angles))?;
            Some(variant.confounded_where(angles < FEWEST))
        });
        let sags = axes.iter().filter(|(axis, _)| is_weighed_down(rows, *axis));
        let sags = sags.filter_map(|(_, name)| self.sag(&rows.chain, &Instance::on(name)));
        harmonics.chain(sags).collect()
    }

    fn declared(&self, chain: &Chain, of: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        let sag = self.sag(chain, of);
        self.on_joint(chain, of, 1.0)
            .into_iter()
            .chain(sag)
            .collect()
    }
}

/// The highest harmonic that is offered where an axis visits so many angles.
///
/// Angles need not be evenly spaced over the turn, so that the sampling theorem does not apply: at three of them any harmonic is
/// one of its own, at two all are the same.
fn highest(angles: usize) -> f64 {
    match angles {
        ..3 => 1.0,
        3..=40 => 4.0,
        _ => 36.0,
    }
}

/// Change of the effort of gravity in a session below which a joint is not weighed down differently, N m.
const WEIGHT: f64 = 1.0;

/// True for a joint that carries changing weight.
fn is_weighed_down(rows: &Observations, axis: usize) -> bool {
    let poses = rows.rows.iter().filter_map(|row| row.pose.as_ref());
    let efforts = poses.map(|pose| rows.chain.gravity_efforts(&pose.positions)[axis]);
    let (least, most) = efforts.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), one| {
        (least.min(one), most.max(one))
    });
    most - least > WEIGHT
}

impl Indexing {
    /// A joint that yields under the weight it carries.
    fn sag(&self, chain: &Chain, of: &Instance<'_>) -> Option<Variant> {
        let (axis, joint) = of.joint(chain)?;
        let weighs = chain.joints().iter().any(|joint| joint.mass > 0.0);
        if joint.kind != JointKind::Revolute || !weighs {
            return None;
        }
        let parameters = vec![Parameter::new("compliance", "rad/(N m)", 1e-5)];
        let variant = Variant::linear(of.id(self.id()), parameters, move |rows| {
            vec![rows.machine_column(true, |pose, _| {
                let effort = rows.chain.gravity_efforts(&pose.positions)[axis];
                pose.sensitivity.axes[axis] * effort
            })]
        });
        Some(variant.with_constants(&[("sag", 1.0, "1")]))
    }

    fn on_joint(&self, chain: &Chain, of: &Instance<'_>, highest: f64) -> Option<Variant> {
        let (axis, joint) = of.joint(chain)?;
        if joint.kind != JointKind::Revolute {
            return None;
        }
        let build = move |rows: &Observations, k: f64| {
            let column = |wave: fn(f64) -> f64| {
                rows.machine_column(true, |pose, _| {
                    pose.sensitivity.axes[axis] * wave(k * pose.positions[axis])
                })
            };
            vec![column(f64::sin), column(f64::cos)]
        };
        let parameters = self.parameters(chain, of);
        let id = of.id(self.id());
        Some(Variant::harmonic(id, parameters, highest, build))
    }
}

/// How many angles (0.05° apart) an axis visits.
pub(super) fn distinct_angles(observations: &Observations, axis: usize) -> usize {
    let mut angles: Vec<i64> = observations
        .rows
        .iter()
        .filter_map(|row| row.pose.as_ref())
        .map(|pose| {
            (pose.positions[axis].rem_euclid(std::f64::consts::TAU) * 1146.0).round() as i64
        })
        .collect();
    angles.sort_unstable();
    angles.dedup();
    angles.len()
}

#[cfg(test)]
mod tests {
    use super::highest;
    use crate::test_session::predicts;

    /// sin(3q) and cos(3q) at −20°, 0° and 50° are in the span of no sin(q), cos(q): the determinant of both and one of the
    /// others does not vanish.
    #[test]
    fn three_uneven_angles_show_which_harmonic_acts() {
        let angles = [-20.0_f64, 0.0, 50.0].map(f64::to_radians);
        let first = [angles.map(f64::sin), angles.map(f64::cos)];
        let other = angles.map(|q| (3.0 * q).sin());
        let (a, b) = (
            nalgebra::Vector3::from(first[0]),
            nalgebra::Vector3::from(first[1]),
        );
        assert!(a.cross(&b).dot(&nalgebra::Vector3::from(other)).abs() > 0.1);
        assert!(highest(3) >= 3.0);
        // At two angles any two waves span everything.
        assert!((highest(2) - 1.0).abs() < f64::EPSILON);
    }

    /// The table stands off by an angle: the part has turned under the ball.
    #[test]
    fn a_table_off_its_angle_carries_the_part_round() {
        let wave = [("a", 5e-5, "rad"), ("phase", 0.4, "rad"), ("k", 2.0, "1")];
        predicts("axis.C.indexing", &wave, |seen| {
            let off = 5e-5 * (2.0 * seen.position("C") + 0.4).sin();
            let (p, n) = (seen.row.position, seen.row.normal);
            off * (n.y * p.x - n.x * p.y)
        });
    }
}
