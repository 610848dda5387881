//! Least squares of drive effects over the sessions of an axis, and whether an effect is a constant of the machine.
//!
//! Samples of a drive are correlated; uncertainties count only the independent ones. Coefficients are in the unit of the
//! effort or motion over that of the term.

use effects::session::SessionError;
use inference::least_squares::{NormalEquations, Solution};
use inference::linear::add_scaled;

use super::{Axis, Chosen, Drives};
use crate::blocks::independent_share;

/// Ridge that keeps equal columns apart, relative to their power.
const RIDGE: f64 = 1e-9;
/// A half with less than this share of the other's energy has no say.
const NEGLIGIBLE: f64 = 0.1;
/// Standard uncertainties by which the coefficients of the two halves may differ.
const COVERAGE: f64 = 3.0;
/// Share of the larger coefficient by which those of the two halves may always differ.
const STEADY: f64 = 0.5;
/// Folds of the cross-validation in time.
pub(super) const FOLDS: usize = 10;

/// Samples that a fit leaves out.
#[derive(Debug, Clone, Copy)]
pub(super) enum Leave {
    /// A session and one of its folds in time.
    Fold(usize, usize),
    /// A whole session.
    Session(usize),
    /// The first (0) or second (1) half of every session.
    Half(usize),
}

impl Leave {
    /// True for a sample, one of `count` of a session, that is left out.
    pub(super) fn leaves(self, session: usize, sample: usize, count: usize) -> bool {
        let fold = sample * FOLDS / count;
        match self {
            Self::Fold(number, left_out) => session == number && fold == left_out,
            Self::Session(number) => session == number,
            Self::Half(half) => (fold * 2 / FOLDS) == half,
        }
    }
}

/// A fit with uncertainties.
#[derive(Debug)]
pub(super) struct UncertainFit {
    pub(super) coefficients: Vec<f64>,
    /// Standard uncertainty of each coefficient.
    pub(super) uncertainties: Vec<f64>,
    /// Number of independent samples.
    pub(super) independent: f64,
}

/// Columns and deviations of one session that a fit uses.
struct Part {
    columns: Vec<Vec<f64>>,
    y: Vec<f64>,
}

impl Drives {
    /// Least squares of an axis over all fitted sessions, less the samples that are left out.
    pub(super) fn fit(
        &self,
        index: usize,
        chosen: &Chosen,
        leave: Option<Leave>,
    ) -> Result<Solution, SessionError> {
        self.solve(index, &self.parts(index, chosen, leave))
    }

    /// The same with uncertainties that allow for correlated samples.
    pub(super) fn fit_with_uncertainties(
        &self,
        index: usize,
        chosen: &Chosen,
        leave: Option<Leave>,
    ) -> Result<UncertainFit, SessionError> {
        let parts = self.parts(index, chosen, leave);
        let solution = self.solve(index, &parts)?;
        let samples: usize = parts.iter().map(|part| part.y.len()).sum();
        let mut residuals = Vec::with_capacity(samples);
        for Part { columns, mut y } in parts {
            for (column, coefficient) in columns.iter().zip(&solution.coefficients) {
                add_scaled(&mut y, -coefficient, column);
            }
            residuals.extend(y);
        }
        let share = independent_share(&residuals);
        // Correlated samples count less: the covariance grows by the inverse of their independent share.
        let variance = solution.mean_square / share;
        let unit = solution.unit_variances.iter();
        Ok(UncertainFit {
            uncertainties: unit.map(|unit| (unit * variance).sqrt()).collect(),
            coefficients: solution.coefficients,
            independent: samples as f64 * share,
        })
    }

    fn parts(&self, index: usize, chosen: &Chosen, leave: Option<Leave>) -> Vec<Part> {
        let name = &self.fitted[0][index].signals.axis;
        let part = |(number, session): (usize, &Vec<Axis>)| {
            let axis = session.iter().find(|axis| axis.signals.axis == *name)?;
            let count = axis.centred.len();
            let keep = |values: &[f64]| -> Vec<f64> {
                (values.iter().enumerate())
                    .filter(|&(sample, _)| {
                        leave.is_none_or(|leave| !leave.leaves(number, sample, count))
                    })
                    .map(|(_, &value)| value)
                    .collect()
            };
            Some(Part {
                columns: columns(axis, chosen).into_iter().map(keep).collect(),
                y: keep(&axis.centred),
            })
        };
        self.fitted.iter().enumerate().filter_map(part).collect()
    }

    fn solve(&self, index: usize, parts: &[Part]) -> Result<Solution, SessionError> {
        let mut normal = NormalEquations::new(parts.first().map_or(0, |part| part.columns.len()));
        for part in parts {
            normal.add(&part.columns, &part.y);
        }
        normal
            .solve(RIDGE)
            .map_err(|singular| SessionError::Singular {
                axis: self.fitted[0][index].signals.axis.clone(),
                singular,
            })
    }

    /// True when the last effect of a set is the same in both halves of the record: a constant of the machine, with
    /// the sign that physics asks for.
    pub(super) fn steady(&self, chosen: &Chosen) -> Result<bool, SessionError> {
        let Some(&(number, shape)) = chosen.last() else {
            return Ok(true);
        };
        for index in 0..self.fitted[0].len() {
            let effect = &self.fitted[0][index].effects[number];
            let terms = &effect.shapes[shape];
            let first = self.fit_with_uncertainties(index, chosen, Some(Leave::Half(0)))?;
            let second = self.fit_with_uncertainties(index, chosen, Some(Leave::Half(1)))?;
            let offset = first.coefficients.len().saturating_sub(terms.len());
            for (term, column) in terms.iter().zip(offset..) {
                let (a, b) = (first.coefficients[column], second.coefficients[column]);
                let (ua, ub) = (first.uncertainties[column], second.uncertainties[column]);
                let uncertainty = COVERAGE * ua.hypot(ub);
                let [e1, e2] = self.energies(index, &term.name, (number, shape));
                let negligible = e1.min(e2) < NEGLIGIBLE * e1.max(e2);
                let same =
                    negligible || (a - b).abs() <= uncertainty.max(STEADY * a.abs().max(b.abs()));
                let physical = effect.sign == 0.0 || (effect.sign * (a + b) >= -uncertainty);
                if !(same && physical) {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Energy of a term of an effect at a shape in the first and second halves of the records of an axis.
    fn energies(&self, index: usize, term: &str, (effect, shape): (usize, usize)) -> [f64; 2] {
        let name = &self.fitted[0][index].signals.axis;
        let mut sums = [0.0; 2];
        let axes = self.fitted.iter().flatten();
        for axis in axes.filter(|axis| axis.signals.axis == *name) {
            let count = axis.centred.len();
            let terms = axis.effects[effect].shapes[shape].iter();
            for column in terms
                .filter(|other| other.name == term)
                .map(|other| &other.column)
            {
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
        .flat_map(|&(effect, shape)| &axis.effects[effect].shapes[shape])
        .map(|term| term.column.as_slice())
        .collect()
}

/// Residuals of an axis beside a set with these coefficients.
pub(super) fn residuals(axis: &Axis, chosen: &Chosen, coefficients: &[f64]) -> Vec<f64> {
    let mut residuals = axis.centred.clone();
    for (column, coefficient) in columns(axis, chosen).iter().zip(coefficients) {
        add_scaled(&mut residuals, -coefficient, column);
    }
    residuals
}
