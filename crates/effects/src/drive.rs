//! Effects of drives: columns over the samples of one axis, one file each.
//!
//! Motion: e = position − command. Effort: e = effort − (nominal mass or inertia)·acceleration. Friction after
//! Armstrong-Hélouvry; signs of speed are smoothed over a fiftieth of the usual speed, since measured speeds are noisy
//! around standstill. A position error against the command is no effect on the effort: under a servo the effort follows
//! it always. m or rad, seconds, and the effort's own unit.

mod backlash;
mod cogging;
pub mod columns;
mod compliance;
mod coulomb_friction;
mod delay;
mod droop;
mod effort_gain;
mod friction_offset;
mod gravity;
mod inertia;
mod link_inertia;
mod payload;
mod saturation;
pub mod signals;
mod stribeck;
mod viscous_friction;

use machine::Chain;

use crate::effect::{ActsOn, Effect, Subject};

use columns::term;
pub use columns::{Channel, Drive, DriveEffect, Term, difference, nominal_inertia};
pub use signals::{Signals, signals};

/// All of them, in the order in which they are tried.
pub const ALL: &[&dyn Effect] = &[
    &coulomb_friction::CoulombFriction,
    &viscous_friction::ViscousFriction,
    &friction_offset::FrictionOffset,
    &inertia::Inertia,
    &stribeck::Stribeck,
    &gravity::Gravity,
    &delay::Delay,
    &backlash::Backlash,
    &compliance::Compliance,
    &cogging::Cogging,
    &payload::Payload,
    &link_inertia::LinkInertia,
    &effort_gain::EffortGain,
    &droop::Droop,
    &saturation::Saturation,
];

/// What an effect of a drive acts on.
const fn acts_on() -> ActsOn {
    ActsOn::of(Subject::Drive)
}

/// Effects that can act on an axis in a channel.
pub fn library(chain: &Chain, signals: &Signals, channel: Channel) -> Vec<DriveEffect> {
    let drive = Drive::new(chain, signals, channel);
    let mut effects: Vec<DriveEffect> = Vec::new();
    for effect in ALL {
        let offered = effect.drive(&drive, &effects);
        effects.extend(offered);
    }
    effects
}

#[cfg(test)]
mod specimen {
    use super::{Channel, Drive, Signals};

    /// A sine of one axis at 0.1 m amplitude and 1 Hz, sampled at 100 Hz, with command and effort.
    pub(super) fn signals() -> Signals {
        let time: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k)).collect();
        let wave = |f: fn(f64) -> f64, size: f64| -> Vec<f64> {
            let omega = std::f64::consts::TAU;
            time.iter().map(|t| size * f(omega * t)).collect()
        };
        let omega = std::f64::consts::TAU;
        Signals {
            axis: "X".to_owned(),
            piece: vec![0; time.len()],
            position: wave(f64::sin, 0.1),
            speed: wave(f64::cos, 0.1 * omega),
            acceleration: wave(f64::sin, -0.1 * omega * omega),
            effort: wave(f64::cos, 3.0),
            command: wave(f64::sin, 0.1),
            command_speed: wave(f64::cos, 0.1 * omega),
            direction: vec![1.0; time.len()],
            time,
            ..Signals::default()
        }
    }

    /// The columns of an effect at its first shape.
    pub(super) fn columns(effect: &dyn crate::effect::Effect, channel: Channel) -> Vec<Vec<f64>> {
        let (chain, signals) = (crate::test_session::chain(), signals());
        let drive = Drive::new(&chain, &signals, channel);
        let found = effect.drive(&drive, &[]).expect("an effect of the channel");
        let first = found.shapes.into_iter().next().expect("a shape");
        first.into_iter().map(|term| term.column).collect()
    }
}
