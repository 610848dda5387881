//! `axis.<A>.cyclic`: a linear axis errs with the pitch of its screw or scale (ISO 230-2).
//!
//! δq = a·sin(2πq/period + phase), the period profiled over 1–40 mm. Typical 0.5–5 µm. Points spaced by a pitch cannot
//! see it, and between targets of even spacing no period below two spacings is distinguishable from a longer one.

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use machine::{Chain, JointKind};

use crate::effect::{ActsOn, Constants, Coordinate, Definition, Effect, Instance, Subject};
use crate::observation::Observations;
use crate::variant::{Form, Shape, Variant, linear_axes, linspace};

/// Longest and shortest period that a screw or a scale has, m.
const PERIODS: (f64, f64) = (0.04, 0.001);
/// Fewest positions from which a wave is identified: through a few of them goes a wave of almost any period.
pub(super) const FEWEST: usize = 12;
/// Positions closer than this are one, m: a quarter of the shortest period.
const APART: f64 = 2.5e-4;
/// Steps after which a wave is computed anew in a sweep.
const RENEWED: usize = 64;
/// Trials in one resolvable step of the frequency.
const OVERSAMPLED: f64 = 4.0;

pub(super) struct Cyclic;

impl Effect for Cyclic {
    fn definition(&self) -> Definition {
        Definition {
            id: "axis.<A>.cyclic",
            name: "periodic positioning error of axis <A> (screw or scale)",
            remedy: "check the bearing of the screw and the reading head, or correct the axis by a table finer than the pitch",
            parameters: &[("sin", "m", 5e-5), ("cos", "m", 5e-5)],
            acts_on: ActsOn::of(Subject::Machine).smooth_in(&[Coordinate::AxisPosition]),
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let moving = linear_axes(rows, 2.0 * PERIODS.1);
        let seen = moving.filter(|&(axis, _)| distinct_positions(rows, axis) >= FEWEST);
        seen.filter_map(|(axis, (low, high))| {
            let range = high - low;
            let slowest = (1.0 / PERIODS.0).max(0.5 / range);
            // Between targets on a grid a shorter wave is a longer one by another name: the longest is reported.
            let fastest = (1.0 / PERIODS.1).min(0.5 / spacing(rows, axis));
            let steps = (fastest - slowest) * range;
            if steps <= 0.0 {
                return None;
            }
            let count = ((steps * OVERSAMPLED) as usize).clamp(2, 4000);
            let trials = linspace(slowest, fastest, count);
            let trials = trials.iter().rev().map(|frequency| 1.0 / frequency);
            let of = Instance::on(&rows.chain.axis(axis).name);
            self.on_joint(&rows.chain, &of, trials.collect(), steps.max(1.0))
        })
        .collect()
    }

    fn declared(&self, chain: &Chain, of: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        self.on_joint(chain, of, Vec::new(), 1.0)
            .into_iter()
            .collect()
    }
}

impl Cyclic {
    fn on_joint(
        &self,
        chain: &Chain,
        of: &Instance<'_>,
        trials: Vec<f64>,
        distinct: f64,
    ) -> Option<Variant> {
        let (axis, joint) = of.joint(chain)?;
        if joint.kind != JointKind::Prismatic {
            return None;
        }
        let shape = Shape {
            name: "period",
            unit: "m",
            trials,
            continuous: true,
            distinct,
        };
        let build = move |rows: &Observations, period: f64| {
            let column = |wave: fn(f64) -> f64| {
                rows.machine_column(true, |pose, _| {
                    pose.sensitivity.axes[axis] * wave(TAU * pose.positions[axis] / period)
                })
            };
            vec![column(f64::sin), column(f64::cos)]
        };
        let parameters = self.parameters(chain, of);
        let variant = Variant::shaped(of.id(self.id()), parameters, shape, build);
        let swept = variant.with_sweep(move |rows, periods| sweep(rows, axis, periods));
        Some(swept.with_form(Form::Sine))
    }
}

/// Step of the grid of targets that an axis visits, m; 0 without a grid that aliases any period that is tried.
fn spacing(observations: &Observations, axis: usize) -> f64 {
    let poses = observations.rows.iter().filter_map(|row| row.pose.as_ref());
    let positions = poses.map(|pose| pose.positions[axis]).collect();
    let step = crate::clock_check::resolution(&[positions]).unwrap_or(0.0);
    if 2.0 * step > PERIODS.1 { step } else { 0.0 }
}

/// How many positions an axis visits.
pub(super) fn distinct_positions(observations: &Observations, axis: usize) -> usize {
    let poses = observations.rows.iter().filter_map(|row| row.pose.as_ref());
    let positions: BTreeSet<i64> = poses
        .map(|pose| (pose.positions[axis] / APART).round() as i64)
        .collect();
    positions.len()
}

/// One position of the axis in a row: how strongly the row sees it, and the waves at the frequency in turn.
struct Seen {
    row: usize,
    weight: f64,
    wave: (f64, f64),
    step: (f64, f64),
}

/// Sine and cosine at all periods, whose frequencies are evenly spaced: each wave follows from the one before by turning
/// it on, and is set anew now and then.
fn sweep(observations: &Observations, axis: usize, periods: &[f64]) -> Vec<Vec<Vec<f64>>> {
    let rows = observations.rows.len();
    let frequency = |index: usize| 1.0 / periods[index];
    let spacing = if periods.len() > 1 {
        (frequency(periods.len() - 1) - frequency(0)) / (periods.len() - 1) as f64
    } else {
        0.0
    };
    let mut seen: Vec<Seen> = Vec::new();
    let mut positions: Vec<f64> = Vec::new();
    for (row, of) in observations.rows.iter().enumerate() {
        for (pose, sign) in [(&of.pose, -1.0), (&of.cut, 1.0)] {
            if let Some(pose) = pose {
                let position = pose.positions[axis];
                positions.push(position);
                seen.push(Seen {
                    row,
                    weight: sign * of.normal.dot(&pose.sensitivity.axes[axis]),
                    wave: (0.0, 1.0),
                    step: (TAU * spacing * position).sin_cos(),
                });
            }
        }
    }
    let mut all = Vec::with_capacity(periods.len());
    for index in 0..periods.len() {
        let (mut sine, mut cosine) = (vec![0.0; rows], vec![0.0; rows]);
        for (one, position) in seen.iter_mut().zip(&positions) {
            let (s, c) = one.wave;
            one.wave = if index % RENEWED == 0 {
                (TAU * position * frequency(index)).sin_cos()
            } else {
                let (turn_s, turn_c) = one.step;
                (s * turn_c + c * turn_s, c * turn_c - s * turn_s)
            };
            sine[one.row] += one.weight * one.wave.0;
            cosine[one.row] += one.weight * one.wave.1;
        }
        all.push(vec![sine, cosine]);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_session::{predicts, session};

    #[test]
    fn the_error_repeats_with_the_pitch() {
        let wave = [
            ("a", 2e-6, "m"),
            ("phase", 0.7, "rad"),
            ("period", 0.01, "m"),
        ];
        predicts("axis.X.cyclic", &wave, |seen| {
            -seen.normal.x * 2e-6 * (TAU * seen.position("X") / 0.01 + 0.7).sin()
        });
    }

    #[test]
    fn a_sweep_gives_the_columns_of_every_period() {
        let rows = crate::observe(&session()).expect("rows");
        let variant = Cyclic.offer(&rows).into_iter().next().expect("a slide");
        let trials = &variant.shape.as_ref().expect("a period").trials;
        let swept = variant.signatures(&rows);
        for (period, swept) in trials.iter().zip(&swept) {
            let built = variant.columns(&rows, *period);
            for (column, swept) in built.iter().zip(swept) {
                let apart = column
                    .signature
                    .iter()
                    .zip(swept)
                    .map(|(a, b)| (a - b).abs());
                assert!(apart.fold(0.0, f64::max) < 1e-9, "period {period}");
            }
        }
    }
}
