//! A drilled plate of 640 holes, measured on a CMM: where each hole is, against where the machine was told to drill it.

use diagnosis::Session;

use super::{Chance, GANTRY, Reading, session};

/// What was wrong, m, rad and m/m.
#[derive(Clone, Copy, Default)]
pub(crate) struct Errors {
    pub(crate) shift: [f64; 2],
    pub(crate) turn: f64,
    pub(crate) scale: [f64; 2],
    pub(crate) squareness: f64,
    pub(crate) noise: f64,
}

/// The CMM goes from hole to hole in an order of its own.
pub(crate) fn plate(errors: &Errors, seed: u64) -> Session {
    measured(errors, |hole| hole * 237 % 640, &mut Chance::new(seed))
}

/// Without noise, each hole measured at its place in an order.
pub(crate) fn ordered(errors: &Errors, order: impl Fn(u32) -> u32) -> Session {
    measured(errors, order, &mut Chance::new(1))
}

fn measured(errors: &Errors, order: impl Fn(u32) -> u32, chance: &mut Chance) -> Session {
    let mut readings = Vec::new();
    for row in 0..20 {
        for column in 0..32 {
            let (x, y) = (
                0.01 + 0.02 * f64::from(column),
                0.01 + 0.02 * f64::from(row),
            );
            let drilled = (
                x * (1.0 + errors.scale[0]) - errors.squareness * y,
                y * (1.0 + errors.scale[1]),
            );
            let (sin, cos) = errors.turn.sin_cos();
            let seen = [
                cos * drilled.0 - sin * drilled.1
                    + errors.shift[0]
                    + errors.noise * chance.normal(),
                sin * drilled.0
                    + cos * drilled.1
                    + errors.shift[1]
                    + errors.noise * chance.normal(),
                0.0,
            ];
            for normal in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
                readings.push(Reading {
                    feature: (row * 32 + column) as u32,
                    point: seen,
                    normal,
                    feed: 0.0,
                    axes: vec![x, y, 0.1],
                    time: 2.0 * f64::from(order(row as u32 * 32 + column as u32)),
                });
            }
        }
    }
    session(
        "plate",
        GANTRY,
        &["X", "Y", "Z"],
        ([0.0, 0.0, -0.1], 0.0),
        &readings,
    )
}

/// A row of 90 holes along x, measured once in the order of their place at an even pace.
pub(crate) fn rail(errors: &Errors, seed: u64) -> Session {
    let mut chance = Chance::new(seed);
    let mut readings = Vec::new();
    for column in 0..90 {
        let x = 0.0071 * f64::from(column);
        let seen = x * (1.0 + errors.scale[0]) + errors.noise * chance.normal();
        readings.push(Reading {
            feature: column as u32 / 6,
            point: [seen, 0.0, 0.0],
            normal: [1.0, 0.0, 0.0],
            feed: 0.0,
            axes: vec![x, 0.0, 0.1],
            time: 5.0 * f64::from(column),
        });
    }
    session(
        "rail",
        GANTRY,
        &["X", "Y", "Z"],
        ([0.0, 0.0, -0.1], 0.0),
        &readings,
    )
}
