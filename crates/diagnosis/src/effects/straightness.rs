//! `axis.<A>.straightness`: a slide leaves its line sideways by a smooth function of its position.
//!
//! e = a·(u² − 1/3) + a3·(u³ − 0.6u), the Legendre shapes of second and third order over the travel used, u from −1 to
//! 1, along one of the two directions across the axis in the moved frame. Typical 2–10 µm. Constant and slope are
//! location errors, unless the line was laid elsewhere (through the ends, through the axis's zero): then they come with
//! it.

use machine::JointKind;

use super::{Parameter, Variant};
use crate::observation::{Observations, Pose};

/// How probable it is that the line is laid elsewhere than evenly through the travel used.
const ELSEWHERE: f64 = 0.1;

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
            for (shapes, share) in [(2, 1.0), (3, 1.0), (4, ELSEWHERE), (5, ELSEWHERE)] {
                let build = move |observations: &Observations| {
                    let at = |pose: &Pose| (pose.positions[axis] - mid) / half;
                    let column = |shape: fn(f64) -> f64| {
                        observations.machine_column(true, |pose, _| {
                            pose.sensitivity.motion[index][component] * shape(at(pose))
                        })
                    };
                    let mut columns = vec![column(|u| u * u - 1.0 / 3.0)];
                    if shapes % 2 == 1 {
                        columns.push(column(|u| u * u * u - 0.6 * u));
                    }
                    if shapes > 3 {
                        columns.extend([column(|_| 1.0), column(|u| u)]);
                    }
                    columns
                };
                let names: &[&str] = match shapes {
                    2 => &["a"],
                    3 => &["a", "a3"],
                    4 => &["a", "offset", "slope"],
                    _ => &["a", "a3", "offset", "slope"],
                };
                let parameters = names
                    .iter()
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
                    ])
                    .weighing(share),
                );
            }
        }
    }
}
