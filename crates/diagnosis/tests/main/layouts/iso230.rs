//! A linear axis against an interferometer by ISO 230-2: targets every 5 mm, both directions, five runs.

use std::f64::consts::TAU;

use diagnosis::Session;

use super::{Chance, Reading, session};

const AXIS: &str = r#"<robot name="axis">
  <link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
  <joint name="clamping" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
  <joint name="X" type="prismatic"><parent link="foundation"/><child link="probe_mount"/><axis xyz="1 0 0"/>
    <limit lower="-0.1" upper="1" effort="1" velocity="1"/></joint>
</robot>"#;

/// What the axis does wrong, m and s.
#[derive(Clone, Copy, Default)]
pub(crate) struct Errors {
    pub(crate) lost_motion: f64,
    /// Amplitude and pitch.
    pub(crate) cyclic: (f64, f64),
    /// How far it strays half-way, by a cubic that ends at its ends.
    pub(crate) curve: f64,
    /// Per second.
    pub(crate) drift: f64,
    pub(crate) noise: f64,
}

/// The run: each target up and down, five times, 8 s a reading.
pub(crate) fn run(errors: &Errors, seed: u64) -> Session {
    let mut chance = Chance::new(seed);
    axis(0.3, 0.005, |x, up, share| {
        let u = x / 0.3;
        let behind = if up { -0.5 } else { 0.5 } * errors.lost_motion;
        behind
            + errors.cyclic.0 * (TAU * x / errors.cyclic.1.max(1e-6) + 0.4).sin()
            + errors.curve * 10.39 * u * (1.0 - u) * (0.5 - u)
            + errors.drift * 8.0 * 610.0 * share
            + errors.noise * chance.normal()
    })
}

/// Targets every `step` (m) of a travel, up and down, five times, 8 s a reading; `error` (m) of the place, whether it is
/// approached upwards, and the share of the time that went by.
pub(crate) fn axis(
    travel: f64,
    step: f64,
    mut error: impl FnMut(f64, bool, f64) -> f64,
) -> Session {
    let last = (travel / step).round() as u32;
    let targets: Vec<f64> = (0..=last).map(|number| step * f64::from(number)).collect();
    let count = 10.0 * targets.len() as f64;
    let mut readings: Vec<Reading> = Vec::new();
    for _ in 0..5 {
        for up in [true, false] {
            for place in 0..targets.len() {
                let x = targets[if up { place } else { targets.len() - 1 - place }];
                let number = readings.len() as f64;
                readings.push(Reading {
                    feature: 0,
                    point: [x + error(x, up, number / count), 0.0, 0.0],
                    normal: [1.0, 0.0, 0.0],
                    feed: 0.0,
                    axes: vec![x],
                    time: 8.0 * number,
                });
            }
        }
    }
    session("axis X", AXIS, &["X"], ([0.0; 3], 0.0), &readings)
}
