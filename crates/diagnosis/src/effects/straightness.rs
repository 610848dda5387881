//! `axis.<A>.straightness`: a slide leaves its line sideways by a smooth function of its position.
//!
//! e = a·(u² − 1/3) + a3·(u³ − 0.6u), the Legendre shapes of second and third order over the travel used, u from −1 to
//! 1, along one of the two directions across the axis in the moved frame. Typical 2–10 µm. Constant and slope are
//! location errors; but where the line lies is a convention, so touching at the axis's zero (`line` 1) and through the
//! ends (`line` 2) are offered as well.

use machine::JointKind;

use super::{Parameter, Variant};
use crate::observation::{Observations, Pose};

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

impl Line {
    /// How a report tells it.
    fn number(self) -> f64 {
        match self {
            Self::Even => 0.0,
            Self::AtZero => 1.0,
            Self::Ends => 2.0,
        }
    }

    /// Where u = 0 lies, and the shapes of second and third order.
    fn of(self, mid: f64) -> (f64, (Shape, Shape)) {
        match self {
            Self::Even => (mid, (|u| u * u - 1.0 / 3.0, |u| u * u * u - 0.6 * u)),
            Self::AtZero => (0.0, (|u| u * u, |u| u * u * u)),
            Self::Ends => (mid, (|u| u * u - 1.0, |u| u * u * u - u)),
        }
    }
}

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    for axis in 0..observations.chain.axes().len() {
        let joint = observations.chain.axis(axis);
        let (low, high) = observations.travel(axis);
        if joint.kind != JointKind::Prismatic || high - low < 1e-4 {
            continue;
        }
        let (mid, half) = (0.5 * (high + low), 0.5 * (high - low));
        let index = observations.chain.axes()[axis];
        for (component, direction) in [(0, 0.0), (1, 1.0), (2, 2.0)] {
            if joint.axis[component].abs() > 0.7 {
                continue;
            }
            for (line, share) in [(Line::Even, 1.0), (Line::AtZero, 0.2), (Line::Ends, 0.1)] {
                let (mid, (second, third)) = line.of(mid);
                for order in [2, 3] {
                    let build = move |observations: &Observations| {
                        let at = |pose: &Pose| (pose.positions[axis] - mid) / half;
                        let column = |shape: fn(f64) -> f64| {
                            observations.machine_column(true, |pose, _| {
                                pose.sensitivity.motion[index][component] * shape(at(pose))
                            })
                        };
                        let mut columns = vec![column(second)];
                        if order == 3 {
                            columns.push(column(third));
                        }
                        columns
                    };
                    let parameters = ["a", "a3"]
                        .iter()
                        .take(order - 1)
                        .map(|&name| Parameter::new(name, "m", 1e-4))
                        .collect();
                    variants.push(
                        Variant::linear(
                            format!("axis.{}.straightness", joint.name),
                            parameters,
                            build,
                        )
                        .with_constants(&[
                            ("along", direction, "1"),
                            ("mid", mid, "m"),
                            ("half", half, "m"),
                            ("line", line.number(), "1"),
                        ])
                        .weighing(share),
                    );
                }
            }
        }
    }
}
