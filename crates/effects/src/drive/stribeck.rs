//! `drive.stribeck`: friction that falls from standstill to slow motion.
//!
//! f = force·sgn(v)·exp(−(v/v_s)²), the speed v_s profiled (Armstrong-Hélouvry).

use super::{Channel, Drive, acts_on, term};
use crate::drive::columns::DriveEffect;
use crate::effect::{Definition, Effect};

pub(super) struct Stribeck;

impl Effect for Stribeck {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.stribeck",
            name: "Stribeck friction of the drive near standstill",
            remedy: "check lubrication and guideways; friction compensation of the drive may remove it",
            parameters: &[("force", "effort", 1e3)],
            acts_on: acts_on(),
        }
    }

    fn drive(&self, drive: &Drive<'_>, _: &[DriveEffect]) -> Option<DriveEffect> {
        let speed = &drive.signals.speed;
        let fastest = speed
            .iter()
            .fold(0.0_f64, |most, v| most.max(v.abs()))
            .max(f64::MIN_POSITIVE);
        let at = |share: f64| {
            let slow = share * fastest;
            let pairs = speed.iter().zip(&drive.sign);
            let column = pairs
                .map(|(v, s)| s * (-(v / slow).powi(2)).exp())
                .collect();
            vec![term("force", "effort", column)]
        };
        let offered = drive.on(Channel::Effort, self.id(), || SHARES.map(at).into());
        offered.map(|effect| effect.signed(1.0))
    }
}

/// Speeds over which it falls, as shares of the fastest.
const SHARES: [f64; 4] = [0.02, 0.05, 0.12, 0.3];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::specimen::{columns, signals};

    #[test]
    fn it_fades_as_the_axis_moves() {
        let column = &columns(&Stribeck, Channel::Effort)[0];
        let speed = signals().speed;
        for (value, v) in column.iter().zip(&speed) {
            assert!(value * v >= 0.0);
            if v.abs() > 0.2 * speed[0] {
                assert!(value.abs() < 1e-6);
            }
        }
    }
}
