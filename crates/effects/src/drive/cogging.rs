//! `drive.cogging`: an effort periodic in the position: teeth of the motor or of the gear.
//!
//! f = s·sin(w·q) + c·cos(w·q), the number of half waves over the travel profiled.

use std::f64::consts::TAU;

use super::{Channel, Drive, acts_on, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{Definition, Effect};

pub(super) struct Cogging;

impl Effect for Cogging {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.cogging",
            name: "cogging of the drive, periodic in the position",
            remedy: "check motor commutation and gear; cogging compensation of the drive may remove it",
            parameters: &[("sin", "effort", 1e3), ("cos", "effort", 1e3)],
            acts_on: acts_on(),
        }
    }

    fn drive(&self, drive: &Drive<'_>, _: &[DriveEffect]) -> Option<DriveEffect> {
        let signals = drive.signals;
        let (low, high) = signals
            .position
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), &q| (l.min(q), h.max(q)));
        let range = (high - low).max(f64::MIN_POSITIVE);
        let at = |turns: i32| {
            let wave = TAU * 0.5 * f64::from(turns) / range;
            // What the low-pass leaves of a wave that is passed at this speed.
            let column = |value: fn(f64) -> f64| {
                (signals.position.iter().zip(&signals.speed))
                    .map(|(q, v)| {
                        value(wave * q) * (-0.5 * (wave * v * signals.width).powi(2)).exp()
                    })
                    .collect()
            };
            vec![
                term("sin", "effort", column(f64::sin)),
                term("cos", "effort", column(f64::cos)),
            ]
        };
        drive.on(Channel::Effort, self.id(), || {
            (COARSEST..=FINEST).map(at).collect()
        })
    }
}

/// Half waves over the travel, at least: fewer are no teeth, but a slow change along the way.
const COARSEST: i32 = 6;
/// And at most.
const FINEST: i32 = 120;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::specimen::{columns, signals};

    #[test]
    fn the_coarsest_wave_has_three_periods_over_the_travel() {
        let sine = &columns(&Cogging, Channel::Effort)[0];
        let position = signals().position;
        let range = 0.2;
        for (value, q) in sine.iter().zip(&position) {
            assert!((value - (TAU * 3.0 * q / range).sin()).abs() < 1e-9);
        }
    }
}
