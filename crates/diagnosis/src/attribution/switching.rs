//! Discrepancies that switch between two states: the rival of correlated noise.
//!
//! Something loose gives a signal of two levels. Its states are estimated beside the effects of a set
//! ([`inference::switching`]); given them, the displacement is a process of few directions like any other discrepancy, and the
//! probability of their sequence stands in its prior. The nominal place may be either state, or lie between them. Metres.

use std::ops::Range;
use std::rc::Rc;

use effects::discrepancy::switching as loadings;
use inference::discrepancy::{Discrepancy, Kind};
use inference::posterior::Model;
use inference::search::ScoredSet;
use inference::switching::{TwoStates, two_states};

use super::candidate_pool::CandidatePool;
use super::with_discrepancy::score_with_discrepancies;
use super::{Estimator, Fitted, other_kinds};

/// Log likelihood that two states must gain over one beside a set: less cannot pay for a cause outside the vocabulary.
const WORTH: f64 = 6.0;
/// Where the nominal place lies between the two states: in either, or in their middle.
const NOMINAL: [f64; 3] = [0.0, 0.5, 1.0];
/// A state is one that lasts: this often at least a touch finds it as the touch before did. Of 3 % stray touches among 150,
/// which have a model of their own, as many are neighbours once in three thousand sessions.
const LASTS: usize = 3;
/// Probability of a state at the start, where the sign of the residual says so.
const LIKELY: f64 = 0.9;

/// What switches, beside sets of the candidates of a pool.
pub(super) struct Switching<'a>(pub(super) &'a CandidatePool<'a>);

impl Estimator for Switching<'_> {
    fn is_own(kind: &Kind) -> bool {
        *kind == Kind::Switching
    }

    /// Switching discrepancies in what each of some sets leaves, those of the same states one after the other.
    fn beside(&self, fits: &[Fitted], known: &[Rc<Discrepancy>]) -> Vec<Rc<Discrepancy>> {
        let pool = self.0;
        let observations = pool.shapes.observations;
        let touched: Vec<usize> = (0..observations.touches())
            .filter(|&row| pool.active[row])
            .collect();
        let used: Vec<usize> = (0..pool.active.len())
            .filter(|&row| pool.active[row])
            .collect();
        let pick =
            |values: &[f64]| -> Vec<f64> { touched.iter().map(|&row| values[row]).collect() };
        let what = loadings(observations);
        let log_prior = -(((other_kinds(known) + 1) * NOMINAL.len() * what.len()) as f64).ln();
        let mut found = Vec::new();
        for fit in fits {
            let discrepancy = (fit.beside).map(|(index, power)| (&*known[index], power));
            let Some(residuals) = pool.residuals_of(&fit.set, discrepancy) else {
                continue;
            };
            let residuals = pick(&residuals);
            for columns in &what {
                let picked: Vec<Vec<f64>> = columns.iter().map(|column| pick(column)).collect();
                let Some(states) =
                    likeliest(&residuals, &picked).filter(|found| lasts(&found.second))
                else {
                    continue;
                };
                for nominal in NOMINAL {
                    let mut share = vec![0.0; pool.active.len()];
                    for (&row, second) in touched.iter().zip(&states.second) {
                        share[row] = f64::from(u8::from(*second)) - nominal;
                    }
                    let present: Vec<Vec<f64>> = (columns.iter())
                        .map(|column| used.iter().map(|&row| column[row] * share[row]).collect())
                        .collect();
                    let log_prior = log_prior + states.log_probability;
                    found.push(Rc::new(Discrepancy::new(
                        Kind::Switching,
                        &present,
                        log_prior,
                    )));
                }
            }
        }
        found
    }

    fn scored(
        pool: &CandidatePool<'_>,
        beside: &[ScoredSet],
        found: &[Rc<Discrepancy>],
        first: usize,
        models: &[Model],
    ) -> Vec<Model> {
        score_with_discrepancies(pool, beside, found, first, models)
    }
}

/// Indices among those discrepancies of the ones that have the states of the one at this index.
pub(super) fn same_states(index: usize) -> Range<usize> {
    let first = index - index % NOMINAL.len();
    first..first + NOMINAL.len()
}

/// The likeliest of the signals of two states that start from the sign of the residuals in one direction each; `None` where
/// none is worth it.
fn likeliest(residuals: &[f64], columns: &[Vec<f64>]) -> Option<TwoStates> {
    let from = |column: &Vec<f64>| {
        let pairs = || residuals.iter().zip(column);
        let power: f64 = pairs().map(|(_, column)| column * column).sum();
        let level = pairs().map(|(value, column)| value * column).sum::<f64>() / power;
        let start = pairs().map(|(value, column)| {
            if (value - level * column) * column > 0.0 {
                LIKELY
            } else {
                1.0 - LIKELY
            }
        });
        let start: Vec<f64> = start.collect();
        two_states(residuals, columns, &start, WORTH)
    };
    columns
        .iter()
        .filter_map(from)
        .max_by(|one, other| one.gain.total_cmp(&other.gain))
}

/// True where both states last and one of them comes back: what changes once has slipped.
fn lasts(second: &[bool]) -> bool {
    let changes = second.windows(2).filter(|pair| pair[0] != pair[1]).count();
    changes > 1
        && [false, true].iter().all(|state| {
            let pairs = second.windows(2);
            pairs
                .filter(|pair| pair.iter().all(|own| own == state))
                .count()
                >= LASTS
        })
}
