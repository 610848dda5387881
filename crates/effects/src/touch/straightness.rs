//! `axis.<A>.straightness`: a slide leaves its line sideways by a smooth function of its position (ISO 230-1).
//!
//! e = a·(u² − 1/3) + a3·(u³ − 0.6u), the Legendre shapes of second and third order over the travel used, u from −1 to
//! 1, along one of the two directions across the axis in the moved frame. Typical 2–10 µm. Constant and slope are
//! location errors; but where the line lies is a convention, so touching at the axis's zero (`line` 1) and through the
//! ends (`line` 2) are offered as well.

use machine::{Chain, JointKind};

use crate::effect::{ActsOn, Constants, Coordinate, Definition, Effect, Instance, Subject};
use crate::observation::{Observations, Pose};
use crate::variant::{Parameter, Variant, linear_axes};

pub(super) struct Straightness;

impl Effect for Straightness {
    fn definition(&self) -> Definition {
        Definition {
            id: "axis.<A>.straightness",
            name: "straightness of axis <A>: lateral deviation along its travel",
            remedy: "check the levelling and guideways of the machine, or compensate the axis with a straightness table",
            parameters: &[],
            acts_on: ActsOn::of(Subject::Machine).smooth_in(&[Coordinate::AxisPosition]),
        }
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters(3)
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

/// The straight line that a slide's path is compared with: a convention of who describes the machine.
#[derive(Clone, Copy)]
enum Line {
    /// Least squares over the travel used.
    Even,
    /// Touching at the axis's zero.
    AtZero,
    /// Through the ends of the travel used.
    Ends,
}

type Shape = fn(f64) -> f64;

/// Shapes of fourth and fifth order, least squares over the travel used.
const HIGHER: [Shape; 2] = [
    |u| u.powi(4) - 6.0 / 7.0 * u * u + 3.0 / 35.0,
    |u| u.powi(5) - 10.0 / 9.0 * u.powi(3) + 5.0 / 21.0 * u,
];
/// Prior weight of a shape up to the fifth order: a long beam hangs between more than two supports.
const LONG: f64 = 0.05;

impl Line {
    /// All lines, with their prior weights.
    const ALL: [(Self, f64); 3] = [(Self::Even, 1.0), (Self::AtZero, 0.2), (Self::Ends, 0.1)];

    /// Its number in reports.
    fn number(self) -> f64 {
        match self {
            Self::Even => 0.0,
            Self::AtZero => 1.0,
            Self::Ends => 2.0,
        }
    }

    /// Where u = 0 lies, and the shapes of second and third order.
    fn shapes(self, mid: f64) -> (f64, (Shape, Shape)) {
        match self {
            Self::Even => (mid, (|u| u * u - 1.0 / 3.0, |u| u * u * u - 0.6 * u)),
            Self::AtZero => (0.0, (|u| u * u, |u| u * u * u)),
            Self::Ends => (mid, (|u| u * u - 1.0, |u| u * u * u - u)),
        }
    }
}

/// Parameters of a shape up to this order.
fn parameters(order: usize) -> Vec<Parameter> {
    let names = ["a", "a3", "a4", "a5"].into_iter().take(order - 1);
    names.map(|name| Parameter::new(name, "m", 1e-4)).collect()
}

impl Straightness {
    /// Every direction across the axis, line and order, over a travel of this middle and half length.
    fn variants(&self, chain: &Chain, of: &Instance<'_>, (mid, half): (f64, f64)) -> Vec<Variant> {
        let Some((axis, joint)) = of.joint(chain) else {
            return Vec::new();
        };
        if joint.kind != JointKind::Prismatic {
            return Vec::new();
        }
        let index = chain.axes()[axis];
        let mut variants = Vec::new();
        for component in (0..3).filter(|&component| joint.axis[component].abs() <= 0.7) {
            for (line, weight) in Line::ALL {
                let (mid, (second, third)) = line.shapes(mid);
                for order in [2, 3, 5] {
                    if order > 3 && !matches!(line, Line::Even) {
                        continue;
                    }
                    let build = move |rows: &Observations| {
                        let at = |pose: &Pose| (pose.positions[axis] - mid) / half;
                        let column = |shape: Shape| {
                            rows.machine_column(true, |pose, _| {
                                pose.sensitivity.motion[index][component] * shape(at(pose))
                            })
                        };
                        let shapes = [second, third].into_iter().chain(HIGHER);
                        shapes.take(order - 1).map(column).collect()
                    };
                    let weight = if order > 3 { LONG } else { weight };
                    let variant = Variant::linear(of.id(self.id()), parameters(order), build);
                    let constants = [
                        ("along", component as f64, "1"),
                        ("mid", mid, "m"),
                        ("half", half, "m"),
                        ("line", line.number(), "1"),
                    ];
                    variants.push(variant.with_constants(&constants).with_prior_weight(weight));
                }
            }
        }
        variants
    }
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn the_slide_strays_by_a_parabola() {
        let constants = [
            ("a", 5e-6, "m"),
            ("along", 1.0, "1"),
            ("mid", 0.01, "m"),
            ("half", 0.05, "m"),
            ("line", 0.0, "1"),
        ];
        predicts("axis.X.straightness", &constants, |seen| {
            let u = (seen.position("X") - 0.01) / 0.05;
            -seen.normal.y * 5e-6 * (u * u - 1.0 / 3.0)
        });
    }
}
