//! Discrepancies on a part of the travel of an axis, which is found together with at most one effect. Metres.
//!
//! Something local may hide an effect, and an effect something local: every candidate is solved by least squares together
//! with every part of the travel, and so are the sets that are the best until then. The best pairs are moved to where they explain
//! most, and the evidence decides between their processes and all others.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use effects::discrepancy::{Displacement, Localised};
use inference::discrepancy::{Discrepancy, Kind};
use inference::linear::{SPANNED, dot, orthonormal, project_out};
use inference::posterior::Model;
use inference::search::ScoredSet;
use nalgebra::{DMatrix, DVector};

use super::candidate_pool::CandidatePool;
use super::with_discrepancy::search_beside_each;
use super::{Estimator, Fitted, other_kinds};

/// Most parts of the travel beside which the library is searched.
const MOST: usize = 6;
/// Blocks of more columns than this are not solved together with a part of the travel.
const WIDEST: usize = 6;
/// Log likelihood that each effect costs, about what its choice from the library does.
const OF_EFFECT: f64 = 5.0;
/// Log likelihood by which a part of the travel may be behind the best set before it is moved to where it explains most.
const COARSE: f64 = 100.0;
/// Parts of the travel that are moved, at most.
const REFINED: usize = 30;
/// What keeps less than this share of its power beside the columns of a set shows nothing else.
const SHOWN: f64 = 1e-4;

/// Displacements on all parts of the travel, beside the deviations, over the rows on which shapes are scanned.
pub(super) struct TravelScan<'a> {
    pool: &'a CandidatePool<'a>,
    localised: &'a Localised,
    /// Scanned rows that are in use.
    used: Vec<bool>,
    /// Deviations, zero where a row is not in use.
    y: Vec<f64>,
    /// A row for each displacement, zero likewise.
    across: Cow<'a, DMatrix<f64>>,
    /// Their sums of squares, and their products with the deviations.
    powers: Vec<f64>,
    products: DVector<f64>,
    /// Beside each candidate alone.
    alone: Scanned,
}

/// The displacements beside some sets.
#[derive(Default)]
struct Scanned {
    /// Largest log likelihood of a set without a displacement, less what it costs.
    without: f64,
    found: Vec<Found>,
}

/// The displacement that explains most beside a set.
struct Found {
    /// Log likelihood of both, less what the set costs.
    worth: f64,
    /// What the set costs.
    cost: f64,
    number: usize,
    basis: Vec<Vec<f64>>,
    /// The displacement near it that explains most, and the worth of that.
    refined: OnceCell<(f64, Displacement)>,
}

impl Estimator for TravelScan<'_> {
    fn is_own(kind: &Kind) -> bool {
        matches!(kind, Kind::AxisRange(_))
    }

    /// Localised discrepancies beside each of some sets and beside each candidate alone, the best of them; the set is fitted
    /// together with each.
    fn beside(&self, fits: &[Fitted], known: &[Rc<Discrepancy>]) -> Vec<Rc<Discrepancy>> {
        let alone = fits.iter().filter(|fit| fit.beside.is_none());
        let sets: Vec<Vec<usize>> = alone.map(|fit| fit.set.clone()).collect();
        let pool = self.pool;
        let count = self.localised.count();
        if count == 0 {
            return Vec::new();
        }
        let choice = (count as f64).ln();
        let log_prior = -((other_kinds(known) + 1) as f64).ln() - choice;
        let rows = pool.rows();
        let process = |displacement: Displacement| {
            let process = displacement.process(pool.shapes.observations, pool.active, log_prior)?;
            Some(Rc::new(if pool.lag1_correlation == 0.0 {
                process
            } else {
                process.whitened_for(&rows)
            }))
        };
        let mut processes: Vec<Rc<Discrepancy>> = Vec::new();
        for process in (self.best(&sets, choice).into_iter()).filter_map(process) {
            let mut others = known.iter().chain(&processes);
            if !others.any(|other| other.is_alike(&process)) {
                processes.push(process);
            }
            if processes.len() == MOST {
                break;
            }
        }
        processes
    }

    fn scored(
        pool: &CandidatePool<'_>,
        beside: &[ScoredSet],
        found: &[Rc<Discrepancy>],
        first: usize,
        _: &[Model],
    ) -> Vec<Model> {
        search_beside_each(pool, beside, found, first)
    }
}

impl<'a> TravelScan<'a> {
    pub(super) fn new(pool: &'a CandidatePool<'a>) -> Self {
        let sample = &pool.shapes.sample;
        let used: Vec<bool> = sample.iter().map(|&row| pool.active[row]).collect();
        let y = masked(sample.iter().map(|&row| pool.y[row]).collect(), &used);
        let (localised, across) = pool.shapes.localised();
        let mut across = Cow::Borrowed(across);
        for row in (0..used.len()).filter(|&row| !used[row]) {
            across.to_mut().column_mut(row).fill(0.0);
        }
        let mut powers = vec![0.0; localised.count()];
        for column in across.column_iter() {
            for (power, value) in powers.iter_mut().zip(&column) {
                *power += value * value;
            }
        }
        let mut scan = Self {
            pool,
            localised,
            used,
            products: &*across * DVector::from_column_slice(&y),
            y,
            across,
            powers,
            alone: Scanned::default(),
        };
        let alone: Vec<Vec<usize>> = scan.candidates().collect();
        scan.alone = scan.scanned(&alone);
        scan
    }

    /// The displacements that explain most beside each of some sets and beside each candidate alone, best first; `choice` is
    /// what the choice among all displacements costs.
    fn best(&self, sets: &[Vec<usize>], choice: f64) -> Vec<Displacement> {
        let scanned = self.scanned(sets);
        let without = scanned.without.max(self.alone.without);
        let mut found: Vec<&Found> = (scanned.found.iter().chain(&self.alone.found))
            .filter(|found| found.worth > without - COARSE)
            .collect();
        found.sort_by(|one, other| other.worth.total_cmp(&one.worth));
        found.truncate(REFINED);
        let mut refined: Vec<(f64, Displacement)> = (found.iter())
            .map(|found| *found.refined.get_or_init(|| self.refined(found)))
            .filter(|(worth, _)| *worth > without + choice)
            .collect();
        refined.sort_by(|one, other| other.0.total_cmp(&one.0));
        refined
            .into_iter()
            .map(|(_, displacement)| displacement)
            .collect()
    }

    /// The displacement that explains most beside each of some sets.
    fn scanned(&self, sets: &[Vec<usize>]) -> Scanned {
        let bases: Vec<Vec<Vec<f64>>> = sets.iter().map(|set| self.basis(set)).collect();
        let directions = bases.iter().flatten().flatten().copied();
        let count = bases.iter().map(Vec::len).sum();
        let crossed = &*self.across * DMatrix::from_iterator(self.y.len(), count, directions);
        let mut scanned = Scanned {
            without: f64::NEG_INFINITY,
            found: Vec::new(),
        };
        let mut first = 0;
        for (set, basis) in sets.iter().zip(bases) {
            let crossed = crossed.columns(first, basis.len());
            first += basis.len();
            let along: Vec<f64> = (basis.iter())
                .map(|direction| dot(direction, &self.y))
                .collect();
            let left = dot(&self.y, &self.y) - dot(&along, &along);
            let cost = OF_EFFECT * set.len() as f64;
            scanned.without = scanned.without.max(self.log_likelihood(left) - cost);
            let (mut powers, mut products) = (self.powers.clone(), self.products.clone());
            for (crossed, along) in crossed.column_iter().zip(&along) {
                for ((power, product), shared) in
                    powers.iter_mut().zip(products.iter_mut()).zip(&crossed)
                {
                    *power -= shared * shared;
                    *product -= along * shared;
                }
            }
            let best = (powers.iter().zip(&products).zip(&self.powers).enumerate())
                .filter(|(_, ((power, _), all))| **power > SHOWN * **all)
                .map(|(number, ((power, product), _))| (product * product / power, number))
                .max_by(|one, other| one.0.total_cmp(&other.0));
            scanned.found.extend(best.map(|(explained, number)| Found {
                worth: self.log_likelihood(left - explained) - cost,
                cost,
                number,
                basis,
                refined: OnceCell::new(),
            }));
        }
        scanned
    }

    /// Of each effect the candidate that explains most alone.
    fn candidates(&self) -> impl Iterator<Item = Vec<usize>> {
        let candidates = &self.pool.candidates;
        let mut best: BTreeMap<&str, (f64, usize)> = BTreeMap::new();
        for (member, candidate) in candidates.iter().enumerate() {
            if candidate.block.len() > WIDEST {
                continue;
            }
            let along = self.basis(&[member]).into_iter();
            let explained: f64 = along
                .map(|direction| dot(&direction, &self.y).powi(2))
                .sum();
            let known = best
                .entry(self.pool.effect(member))
                .or_insert((explained, member));
            if explained > known.0 {
                *known = (explained, member);
            }
        }
        best.into_values().map(|(_, member)| vec![member])
    }

    /// Orthonormal basis of the columns of a set.
    fn basis(&self, set: &[usize]) -> Vec<Vec<f64>> {
        let columns = (set.iter()).flat_map(|&member| &self.pool.candidates[member].block);
        let sample = &self.pool.shapes.sample;
        let scanned =
            |column: &Vec<f64>| masked(sample.iter().map(|&row| column[row]).collect(), &self.used);
        orthonormal(columns.map(scanned), SPANNED)
    }

    /// The displacement near the one that was found that explains most, and the log likelihood of both less what the set costs.
    fn refined(&self, found: &Found) -> (f64, Displacement) {
        let mut residuals = self.y.clone();
        project_out(&mut residuals, &found.basis);
        let explained = |column: Vec<f64>| {
            let mut column = masked(column, &self.used);
            let all = dot(&column, &column);
            project_out(&mut column, &found.basis);
            let power = dot(&column, &column);
            let product = dot(&column, &residuals);
            if power > SHOWN * all {
                product * product / power
            } else {
                0.0
            }
        };
        let (explained, displacement) = self.localised.refined(found.number, explained);
        let left = dot(&residuals, &residuals) - explained;
        (self.log_likelihood(left) - found.cost, displacement)
    }

    /// Log likelihood of a sum of squares of the residuals, without its constant.
    fn log_likelihood(&self, left: f64) -> f64 {
        let count = self.used.iter().filter(|used| **used).count() as f64;
        -0.5 * count * left.max(f64::MIN_POSITIVE).ln()
    }
}

/// Values of the scanned rows, zero where they are not in use.
fn masked(mut values: Vec<f64>, used: &[bool]) -> Vec<f64> {
    for (value, used) in values.iter_mut().zip(used) {
        if !used {
            *value = 0.0;
        }
    }
    values
}
