//! Clock offset and resolution estimated from the records themselves, whatever the deviations say; the effects
//! `time.clock_offset` and `data.quantisation` of [`crate::record`] report them.
//!
//! Latched positions against positions interpolated at the stamp: a shift of the clocks shows as speed × shift. Latched
//! positions on a coarse grid: the grid's step. Seconds, metres.

use probecell_msgs::sensor_msgs::JointState;

use crate::session::{Session, seconds};

/// Standard deviations from which on a clock offset is reported.
const SURE: f64 = 8.0;
/// Smallest uncertainty of a controller's clock, s.
const TICK: f64 = 1e-6;
/// Longest gap between two states over which a position is interpolated, s.
const GAP: f64 = 0.5;

/// A shift of event stamps against axis stamps.
#[derive(Debug, Clone, Copy)]
pub struct ClockOffset {
    /// Event stamps minus axis stamps of the same moment, s.
    pub offset: f64,
    /// Its standard uncertainty, s.
    pub uncertainty: f64,
    /// Rms of latched minus interpolated position before and after, m.
    pub rms: (f64, f64),
    /// True where it is beyond doubt.
    pub certain: bool,
}

/// Compares latched with interpolated positions; `None` without moving latches inside the axis record.
pub fn clock_offset(session: &Session) -> Option<ClockOffset> {
    let states: Vec<(f64, &JointState)> = session
        .joint_states
        .iter()
        .map(|state| (seconds(&state.header.stamp), state))
        .collect();
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    for event in &session.events {
        let stamp = seconds(&event.header.stamp);
        let after = states.partition_point(|(time, _)| *time <= stamp);
        if after == 0 || after >= states.len() {
            continue;
        }
        let ((t0, before), (t1, later)) = (states[after - 1], states[after]);
        if t1 - t0 > GAP || t1 <= t0 {
            continue;
        }
        for (name, &latched) in event.axis_names.iter().zip(&event.axis_positions) {
            let of = |state: &JointState| {
                let index = state.name.iter().position(|known| known == name)?;
                state
                    .position
                    .get(index)
                    .copied()
                    .filter(|value| value.is_finite())
            };
            let (Some(p0), Some(p1)) = (of(before), of(later)) else {
                continue;
            };
            let speed = (p1 - p0) / (t1 - t0);
            if speed.abs() > 1e-5 {
                pairs.push((speed, p0 + speed * (stamp - t0) - latched));
            }
        }
    }
    if pairs.len() < 8 {
        return None;
    }
    let mut ratios: Vec<f64> = pairs.iter().map(|(speed, miss)| miss / speed).collect();
    ratios.sort_by(f64::total_cmp);
    let middle = ratios[ratios.len() / 2];
    let mut spread: Vec<f64> = ratios.iter().map(|ratio| (ratio - middle).abs()).collect();
    spread.sort_by(f64::total_cmp);
    let scale = 1.4826 * spread[spread.len() / 2];
    let kept: Vec<f64> = ratios
        .iter()
        .copied()
        .filter(|ratio| (ratio - middle).abs() <= 4.0 * scale + 1e-12)
        .collect();
    let offset = kept.iter().sum::<f64>() / kept.len() as f64;
    let variance = kept
        .iter()
        .map(|ratio| (ratio - offset).powi(2))
        .sum::<f64>()
        / kept.len() as f64;
    let uncertainty = (variance / kept.len() as f64).sqrt().max(TICK);
    let rms = |shift: f64| {
        let sum: f64 = pairs
            .iter()
            .map(|(speed, miss)| (miss - speed * shift).powi(2))
            .sum();
        (sum / pairs.len() as f64).sqrt()
    };
    let certain = offset.abs() > SURE * uncertainty && rms(offset) < 0.7 * rms(0.0);
    Some(ClockOffset {
        offset,
        uncertainty,
        rms: (rms(0.0), rms(offset)),
        certain,
    })
}

/// Step of the grid on which the latched positions of the moving linear axes lie, m; `None` without a grid.
pub fn resolution(positions: &[Vec<f64>]) -> Option<f64> {
    let mut step: Option<f64> = None;
    for axis in positions {
        let mut values = axis.clone();
        values.sort_by(f64::total_cmp);
        values.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        if values.len() < 6 {
            continue;
        }
        let mut divisor = 0.0_f64;
        for pair in values.windows(2) {
            divisor = greatest_common(divisor, pair[1] - pair[0]);
            if divisor < 5e-8 {
                return None;
            }
            // The longest multiple known so far keeps rounding from piling up.
            let span = pair[1] - values[0];
            divisor = span / (span / divisor).round();
        }
        step = Some(step.map_or(divisor, |known| known.min(divisor)));
    }
    step
}

/// Euclid's algorithm on lengths, to a nanometre.
fn greatest_common(a: f64, b: f64) -> f64 {
    let (mut a, mut b) = (a.max(b), a.min(b));
    while b > 2e-9 {
        let rest = a % b;
        let rest = rest.min(b - rest);
        (a, b) = (b, rest);
    }
    a
}
