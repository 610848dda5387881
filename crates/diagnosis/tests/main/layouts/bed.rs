//! A bed touched from above on a grid (a height map), and a block touched on five faces; both lie as somebody put them.

use diagnosis::Session;

use super::{Chance, GANTRY, Reading, V, session};

/// How a part lies.
pub(crate) struct Pose {
    /// Rotation vector, rad.
    pub(crate) turn: V,
    /// m.
    pub(crate) shift: V,
}

impl Pose {
    /// Rodrigues' formula.
    pub(crate) fn rotate(&self, v: V) -> V {
        let angle = norm(self.turn);
        if angle == 0.0 {
            return v;
        }
        let k = self.turn.map(|part| part / angle);
        let (sin, cos) = angle.sin_cos();
        let (across, along) = (cross(k, v), dot(k, v));
        std::array::from_fn(|i| v[i] * cos + across[i] * sin + k[i] * along * (1.0 - cos))
    }
}

/// Where a ball of `radius` that moves along `normal` over the nominal point stops before the plane of the part, beyond
/// where it would before the nominal one, m.
fn stops(pose: &Pose, point: V, normal: V, radius: f64) -> f64 {
    let (real, turned) = (pose.rotate(normal), pose.rotate(point));
    let away: V = std::array::from_fn(|i| turned[i] + pose.shift[i] - point[i]);
    (dot(real, away) + radius) / dot(real, normal) - radius
}

/// A bed of 0.5 × 0.4 m, row by row in a snake; `bow` is the sagitta of its middle along x, m.
pub(crate) fn height_map(pose: &Pose, bow: f64, noise: f64, seed: u64) -> Session {
    formed_bed(pose, |x, _| bow * (1.0 - (x / 0.25).powi(2)), noise, seed)
}

/// The same with any form, m above the plane at a place.
pub(crate) fn formed_bed(
    pose: &Pose,
    form: impl Fn(f64, f64) -> f64,
    noise: f64,
    seed: u64,
) -> Session {
    let mut chance = Chance::new(seed);
    touched(pose, |x, y| form(x, y) + noise * chance.normal(), [13, 11])
}

/// The same without noise, touched on a grid of so many places.
pub(crate) fn formed_bed_of(
    pose: &Pose,
    form: impl Fn(f64, f64) -> f64,
    grid: [i32; 2],
) -> Session {
    touched(pose, form, grid)
}

fn touched(pose: &Pose, mut form: impl FnMut(f64, f64) -> f64, [along, rows]: [i32; 2]) -> Session {
    let mut readings = Vec::new();
    for row in 0..rows {
        for step in 0..along {
            let step = if row % 2 == 0 { step } else { along - 1 - step };
            let share = |number: i32, of: i32| 2.0 * f64::from(number) / f64::from(of - 1) - 1.0;
            let (x, y) = (0.25 * share(step, along), 0.2 * share(row, rows));
            let formed = form(x, y);
            let up = stops(pose, [x, y, 0.0], [0.0, 0.0, 1.0], 5e-4) + formed;
            readings.push(Reading {
                feature: 0,
                point: [x, y, 0.0],
                normal: [0.0, 0.0, 1.0],
                feed: 0.002,
                axes: vec![x, y, 0.1 + 5e-4 + up],
                time: 4.0 * readings.len() as f64,
            });
        }
    }
    session(
        "bed",
        GANTRY,
        &["X", "Y", "Z"],
        ([0.0, 0.0, -0.1], 5e-4),
        &readings,
    )
}

/// A block of 160 × 120 × 60 mm, five by five points on each of five faces.
pub(crate) fn block(pose: &Pose, noise: f64, seed: u64) -> Session {
    let half: V = [0.08, 0.06, 0.03];
    let mut chance = Chance::new(seed);
    let mut readings = Vec::new();
    for (feature, (axis, sign)) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0)]
        .into_iter()
        .enumerate()
    {
        let mut normal = [0.0; 3];
        normal[axis] = sign;
        for number in 0..25 {
            let place = |along: usize, step: i32| {
                half[along] * (0.4 * f64::from(step - 2) + 0.03 * f64::from(step * step % 3))
            };
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let mut point = [0.0; 3];
            point[axis] = sign * half[axis];
            point[u] = place(u, number % 5);
            point[v] = place(v, number / 5);
            let beyond = 0.003 + stops(pose, point, normal, 0.003) + noise * chance.normal();
            let ball: V = std::array::from_fn(|i| point[i] + beyond * normal[i]);
            readings.push(Reading {
                feature: feature as u32,
                point,
                normal,
                feed: if number % 2 == 0 { 0.002 } else { 0.005 },
                axes: vec![ball[0], ball[1], ball[2] + 0.1],
                time: 6.0 * f64::from((37 * readings.len() as i32) % 125),
            });
        }
    }
    session(
        "block",
        GANTRY,
        &["X", "Y", "Z"],
        ([0.0, 0.0, -0.1], 0.003),
        &readings,
    )
}

fn dot(a: V, b: V) -> f64 {
    a.iter().zip(&b).map(|(a, b)| a * b).sum()
}

fn norm(a: V) -> f64 {
    dot(a, a).sqrt()
}

fn cross(a: V, b: V) -> V {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
