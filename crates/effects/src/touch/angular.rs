//! `axis.<A>.angular`: roll, pitch or yaw of a slide that grows along its travel (ISO 230-1).
//!
//! A rotation k·(q − mid) about one axis of the frame, either of the moved carriage (`moved` 1) or of the guideway at
//! rest: the two differ by a bow across the axis, since the descriptions differ in the point they turn about. Where the
//! rotation vanishes is a convention of who describes the machine: in the middle of the travel used or at the axis's
//! zero. It may bend, k2·half·(u² − 1/3) with u from −1 to 1 over the travel used. Typical 5–40 µrad.

use machine::{Chain, JointKind};

use crate::effect::{ActsOn, Constants, Coordinate, Definition, Effect, Instance, Subject};
use crate::observation::{Column, Observations};
use crate::variant::{Parameter, Variant, linear_axes};

/// How probable it is that the rotation vanishes at the axis's zero and not in the middle of the travel used.
const FROM_ZERO: f64 = 0.2;
/// Prior weight of a rotation that bends along the travel.
const BENT: f64 = 0.05;

/// Columns of a variant over the rows.
type Columns = Box<dyn Fn(&Observations) -> Vec<Column> + Send + Sync>;

pub(super) struct Angular;

impl Effect for Angular {
    fn definition(&self) -> Definition {
        Definition {
            id: "axis.<A>.angular",
            name: "roll, pitch or yaw that grows along axis <A>",
            remedy: "check the levelling and guideways of the machine, or compensate the axis with a table of angular errors",
            parameters: &[("k", "rad/m", 3e-3), ("k2", "rad/m", 3e-3)],
            acts_on: ActsOn::of(Subject::Machine).smooth_in(&[Coordinate::AxisPosition]),
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let moving = linear_axes(rows, 1e-4);
        let variants = moving.flat_map(|(axis, (low, high))| {
            let name = &rows.chain.axis(axis).name;
            let travel = (0.5 * (high + low), 0.5 * (high - low));
            self.variants(&rows.chain, &Instance::on(name), travel)
        });
        variants.collect()
    }

    fn declared(
        &self,
        chain: &Chain,
        of: &Instance<'_>,
        constants: &Constants<'_>,
    ) -> Vec<Variant> {
        let travel = (constants.get("mid", 0.0), constants.get("half", 1.0));
        self.variants(chain, of, travel)
    }
}

impl Angular {
    /// Rotations of carriage and guideway about every axis, from the middle of the travel and from zero, over a travel of this
    /// middle and half length.
    fn variants(&self, chain: &Chain, of: &Instance<'_>, (mid, half): (f64, f64)) -> Vec<Variant> {
        let Some((axis, joint)) = of.joint(chain) else {
            return Vec::new();
        };
        if joint.kind != JointKind::Prismatic {
            return Vec::new();
        }
        let index = chain.axes()[axis];
        let mut variants = Vec::new();
        for (component, about) in [(3, 0.0), (4, 1.0), (5, 2.0)] {
            for moved in [true, false] {
                // About itself, a guideway at rest turns as its carriage does.
                if !moved && joint.axis[component - 3].abs() > 0.7 {
                    continue;
                }
                let turn = move |rows: &Observations, by: &dyn Fn(f64) -> f64| {
                    rows.machine_column(true, |pose, _| {
                        let sensitivity = &pose.sensitivity;
                        let frames = if moved {
                            &sensitivity.motion
                        } else {
                            &sensitivity.location
                        };
                        frames[index][component] * by(pose.positions[axis] - mid)
                    })
                };
                let constants = |mid: f64| {
                    [
                        ("about", about, "1"),
                        ("moved", f64::from(u8::from(moved)), "1"),
                        ("mid", mid, "m"),
                    ]
                };
                let variant = |build: Columns, order: usize| {
                    let parameters: Vec<Parameter> = self.parameters(chain, of);
                    let parameters = parameters.into_iter().take(order).collect();
                    Variant::linear(of.id(self.id()), parameters, build)
                };
                variants.push(
                    variant(
                        Box::new(move |rows| vec![turn(rows, &|from_mid| from_mid)]),
                        1,
                    )
                    .with_constants(&constants(mid)),
                );
                variants.push(
                    variant(
                        Box::new(move |rows| vec![turn(rows, &|from_mid| from_mid + mid)]),
                        1,
                    )
                    .with_constants(&constants(0.0))
                    .with_prior_weight(FROM_ZERO),
                );
                let bent = move |from_mid: f64| half * ((from_mid / half).powi(2) - 1.0 / 3.0);
                let mut over_travel = constants(mid).to_vec();
                over_travel.push(("half", half, "m"));
                variants.push(
                    variant(
                        Box::new(move |rows| {
                            vec![turn(rows, &|from_mid| from_mid), turn(rows, &bent)]
                        }),
                        2,
                    )
                    .with_constants(&over_travel)
                    .with_prior_weight(BENT),
                );
            }
        }
        variants
    }
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    /// Roll of the X carriage that bends along its travel.
    #[test]
    fn a_rotation_bends_along_the_travel() {
        let constants = [
            ("k", 1e-4, "rad/m"),
            ("k2", -3e-4, "rad/m"),
            ("about", 0.0, "1"),
            ("moved", 1.0, "1"),
            ("mid", 0.01, "m"),
            ("half", 0.05, "m"),
        ];
        predicts("axis.X.angular", &constants, |seen| {
            let u = (seen.position("X") - 0.01) / 0.05;
            let turn = 0.05 * (1e-4 * u - 3e-4 * (u * u - 1.0 / 3.0));
            -turn * (seen.normal.z * seen.ball.y - seen.normal.y * seen.ball.z)
        });
    }

    /// Yaw of the X carriage: the ball turns about where the carriage stands, or about the guideway's origin.
    #[test]
    fn carriage_and_guideway_turn_about_points_of_their_own() {
        for moved in [1.0, 0.0] {
            let constants = [
                ("k", 1e-4, "rad/m"),
                ("about", 2.0, "1"),
                ("moved", moved, "1"),
                ("mid", 0.01, "m"),
            ];
            predicts("axis.X.angular", &constants, |seen| {
                let turn = 1e-4 * (seen.position("X") - 0.01);
                let lever_x = seen.ball.x - moved * seen.position("X");
                -turn * (seen.normal.y * lever_x - seen.normal.x * seen.ball.y)
            });
        }
    }
}
