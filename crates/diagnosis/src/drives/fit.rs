//! Least squares of drive effects over the sessions of an axis, and whether an effect is a constant of the machine.
//!
//! Samples of a drive are correlated; uncertainties count only the independent ones. The effort's or motion's own unit.

use nalgebra::{DMatrix, DVector};

use super::{Axis, Chosen, Drives};
use crate::evidence::{add_scaled, dot};

/// Longest correlation looked for, samples.
const LONGEST: usize = 300;
/// A correlation below this is none.
const DIED_OUT: f64 = 0.05;
/// Ridge that keeps equal columns apart, relative to their power.
const RIDGE: f64 = 1e-9;
/// A half with less than this share of the other's motion does not vote.
const SILENT: f64 = 0.1;
/// Pieces of time that are left out in turn.
pub(super) const FOLDS: usize = 10;

/// What a fit leaves out.
#[derive(Debug, Clone, Copy)]
pub(super) enum Leave {
    /// One piece of time of a session.
    Fold(usize, usize),
    /// A whole session.
    Session(usize),
    /// The first or second half of every session.
    Half(usize),
}

impl Leave {
    pub(super) fn leaves(self, session: usize, sample: usize, count: usize) -> bool {
        let fold = sample * FOLDS / count;
        match self {
            Self::Fold(number, left) => session == number && fold == left,
            Self::Session(number) => session == number,
            Self::Half(parity) => (fold * 2 / FOLDS) == parity,
        }
    }
}

/// Least squares of one axis.
#[derive(Debug, Default)]
pub(super) struct Fit {
    pub(super) coefficients: Vec<f64>,
    pub(super) spread: Vec<f64>,
    /// Mean square of what is left.
    pub(super) power: f64,
    /// Share of the samples that are independent.
    pub(super) share: f64,
    pub(super) samples: f64,
}

impl Drives {
    /// Least squares of an axis over all fitted sessions; with `doubt` also the uncertainties, which allow for
    /// correlated samples.
    pub(super) fn fit(
        &self,
        index: usize,
        chosen: &Chosen,
        without: Option<Leave>,
        doubt: bool,
    ) -> Fit {
        let name = &self.fitted[0][index].signals.axis;
        let mut normal = DMatrix::<f64>::zeros(0, 0);
        let mut right = DVector::<f64>::zeros(0);
        let mut used: Vec<(Vec<Vec<f64>>, Vec<f64>)> = Vec::new();
        let (mut samples, mut total) = (0.0, 0.0);
        for (number, session) in self.fitted.iter().enumerate() {
            let Some(axis) = session.iter().find(|axis| axis.signals.axis == *name) else {
                continue;
            };
            let count = axis.centred.len();
            let keep = |values: &[f64]| -> Vec<f64> {
                let left =
                    |sample: &usize| without.is_none_or(|l| !l.leaves(number, *sample, count));
                (0..count)
                    .filter(left)
                    .map(|sample| values[sample])
                    .collect()
            };
            let columns: Vec<Vec<f64>> = columns(axis, chosen).into_iter().map(keep).collect();
            let y = keep(&axis.centred);
            samples += y.len() as f64;
            total += dot(&y, &y);
            let n = columns.len();
            if normal.is_empty() {
                normal = DMatrix::zeros(n, n);
                right = DVector::zeros(n);
            }
            for i in 0..n {
                for k in 0..=i {
                    let product = dot(&columns[i], &columns[k]);
                    normal[(i, k)] += product;
                    if i != k {
                        normal[(k, i)] += product;
                    }
                }
                right[i] += dot(&columns[i], &y);
            }
            used.push((columns, y));
        }
        let n = right.len();
        let sizes: Vec<f64> = (0..n)
            .map(|i| normal[(i, i)].sqrt().max(f64::MIN_POSITIVE))
            .collect();
        let scaled = DMatrix::from_fn(n, n, |i, k| {
            normal[(i, k)] / (sizes[i] * sizes[k]) + if i == k { RIDGE } else { 0.0 }
        });
        let inverse = scaled.try_inverse().unwrap_or_else(|| DMatrix::zeros(n, n));
        let target = DVector::from_fn(n, |i, _| right[i] / sizes[i]);
        let solved = &inverse * target;
        let coefficients: Vec<f64> = (0..n).map(|i| solved[i] / sizes[i]).collect();
        let left = dot(right.as_slice(), &coefficients);
        let power = (total - left).max(1e-12 * total) / samples.max(1.0);
        if !doubt {
            return Fit {
                coefficients,
                power,
                samples,
                ..Fit::default()
            };
        }
        let mut left = Vec::with_capacity(samples as usize);
        for (columns, mut y) in used {
            for (column, coefficient) in columns.iter().zip(&coefficients) {
                add_scaled(&mut y, -coefficient, column);
            }
            left.extend(y);
        }
        let share = effective_share(&left);
        // Correlated samples count less: the covariance grows by the inverse of their independent share.
        let variance = power / share;
        let spread = (0..n).map(|i| (inverse[(i, i)] * variance).sqrt() / sizes[i]);
        Fit {
            spread: spread.collect(),
            coefficients,
            power,
            share,
            samples,
        }
    }

    /// True when the last effect of a set is the same in both halves of the record: a constant of the machine, with
    /// the sign that physics asks for.
    pub(super) fn steady(&self, chosen: &Chosen) -> bool {
        let Some(&(place, shape)) = chosen.last() else {
            return true;
        };
        (0..self.fitted[0].len()).all(|index| {
            let effect = &self.fitted[0][index].effects[place];
            let terms = effect.shapes[shape].len();
            let half = |parity: usize| {
                let fit = self.fit(index, chosen, Some(Leave::Half(parity)), true);
                let first = fit.coefficients.len().saturating_sub(terms);
                (
                    fit.coefficients[first..].to_vec(),
                    fit.spread[first..].to_vec(),
                )
            };
            let ((one, s1), (other, s2)) = (half(0), half(1));
            (0..one.len()).all(|term| {
                let (a, b) = (one[term], other[term]);
                let doubt = 3.0 * s1[term].hypot(s2[term]);
                let [e1, e2] = self.energies(index, &effect.shapes[shape][term].name, place, shape);
                // A half in which next to nothing happens says nothing.
                let silent = e1.min(e2) < SILENT * e1.max(e2);
                let same = silent || (a - b).abs() <= doubt.max(0.5 * a.abs().max(b.abs()));
                let physical = effect.sign == 0.0 || (effect.sign * (a + b) >= -doubt);
                same && physical
            })
        })
    }

    /// Energy of a term in the first and second halves of the records of an axis.
    fn energies(&self, index: usize, term: &str, place: usize, shape: usize) -> [f64; 2] {
        let name = &self.fitted[0][index].signals.axis;
        let mut sums = [0.0; 2];
        let axes = self.fitted.iter().flatten();
        for axis in axes.filter(|axis| axis.signals.axis == *name) {
            let count = axis.centred.len();
            let own = axis.effects[place].shapes[shape].iter();
            for column in own.filter(|own| own.name == term).map(|own| &own.column) {
                for (sample, value) in column.iter().enumerate() {
                    let half = usize::from(!Leave::Half(0).leaves(0, sample, count));
                    sums[half] += value * value;
                }
            }
        }
        sums
    }
}

/// Columns of a set, in its order.
pub(super) fn columns<'a>(axis: &'a Axis, chosen: &Chosen) -> Vec<&'a [f64]> {
    chosen
        .iter()
        .flat_map(|&(place, shape)| &axis.effects[place].shapes[shape])
        .map(|term| term.column.as_slice())
        .collect()
}

/// What a set with these coefficients leaves of an axis.
pub(super) fn residuals(axis: &Axis, chosen: &Chosen, coefficients: &[f64]) -> Vec<f64> {
    let mut left = axis.centred.clone();
    for (column, coefficient) in columns(axis, chosen).iter().zip(coefficients) {
        add_scaled(&mut left, -coefficient, column);
    }
    left
}

/// Share of samples that are independent: the inverse of the correlation's integral, up to where it has died out.
fn effective_share(left: &[f64]) -> f64 {
    let power = dot(left, left).max(f64::MIN_POSITIVE);
    let mut sum = 1.0;
    for lag in 1..(left.len() / 10).min(LONGEST) {
        let correlation = dot(&left[lag..], &left[..left.len() - lag]) / power;
        if correlation < DIED_OUT {
            break;
        }
        sum += 2.0 * correlation;
    }
    1.0 / sum
}
