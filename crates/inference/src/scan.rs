//! How much of the residuals of a set each trial shape would explain, from inner products that are computed once.
//!
//! The products of trial columns with a set's columns do not depend on the deviations: they are kept as long as the rows in
//! use are the same ([`CrossProducts`]), and the projection of a trial follows from them by forward substitution. Metres.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use crate::candidate::Candidate;
use crate::linear::{add_scaled, dot, scale};
use crate::trial::Trial;

/// A column that keeps less than this share of its power beside those before it adds nothing to what they span.
const SPANNED: f64 = 1e-10;

/// A candidate's column: its variant, the bits of its shape, whether it has a second order, its number.
type Key = (usize, u64, bool, usize);

/// Inner products of candidates' columns with those of all trials, for each set of rows in use.
#[derive(Default)]
pub struct CrossProducts(RefCell<Vec<RowSet>>);

struct RowSet {
    active: Vec<bool>,
    known: BTreeMap<Key, Rc<MaskedColumn>>,
}

/// Rows on which shapes are scanned, and all trials in a fixed order.
pub trait Trials {
    /// Rows on which shapes are scanned.
    fn sample(&self) -> &[usize];

    /// The trials of every family, family by family.
    fn trials(&self) -> impl Iterator<Item = &Trial>;
}

/// A column over the scanned rows, zero where they are not in use, and its products with the columns of all trials.
pub struct MaskedColumn {
    values: Vec<f64>,
    crossed: Vec<f64>,
}

impl MaskedColumn {
    /// The column of values of all rows.
    pub fn new(shapes: &impl Trials, active: &[bool], values: &[f64]) -> Self {
        let rows = shapes.sample().iter();
        let values: Vec<f64> = rows
            .map(|&row| if active[row] { values[row] } else { 0.0 })
            .collect();
        let columns = shapes.trials().flat_map(Trial::columns);
        let crossed = columns.map(|column| dot(column, &values)).collect();
        Self { values, crossed }
    }
}

impl CrossProducts {
    fn column(
        &self,
        shapes: &impl Trials,
        active: &[bool],
        candidate: &Candidate,
        number: usize,
    ) -> Rc<MaskedColumn> {
        let mut all = self.0.borrow_mut();
        let index = (all.iter().position(|rows| rows.active == active)).unwrap_or_else(|| {
            all.push(RowSet {
                active: active.to_vec(),
                known: BTreeMap::new(),
            });
            all.len() - 1
        });
        let key = (
            candidate.variant,
            candidate.shape.to_bits(),
            candidate.second_order,
            number,
        );
        let made = || Rc::new(MaskedColumn::new(shapes, active, &candidate.block[number]));
        Rc::clone(all[index].known.entry(key).or_insert_with(made))
    }
}

/// The projection of the deviations onto the complement of a set's span.
pub struct ResidualProjection {
    columns: Vec<Rc<MaskedColumn>>,
    y: Rc<MaskedColumn>,
    /// Gram-Schmidt: for each column the combination of the columns that is the next orthonormal one.
    combinations: Vec<Vec<f64>>,
    /// Inner products of the orthonormal columns with the deviations.
    seen: Vec<f64>,
}

impl ResidualProjection {
    /// Residuals of the deviations `y` beside some candidates.
    pub fn new<'c>(
        shapes: &impl Trials,
        active: &[bool],
        crossed: &CrossProducts,
        set: impl Iterator<Item = &'c Candidate>,
        y: Rc<MaskedColumn>,
    ) -> Self {
        let mut projection = Self {
            columns: Vec::new(),
            y,
            combinations: Vec::new(),
            seen: Vec::new(),
        };
        for candidate in set {
            for number in 0..candidate.block.len() {
                projection.add(crossed.column(shapes, active, candidate, number));
            }
        }
        projection
    }

    /// Adds a column unless it is spanned.
    fn add(&mut self, column: Rc<MaskedColumn>) {
        let full = dot(&column.values, &column.values);
        let products: Vec<f64> = (self.columns.iter())
            .map(|known| dot(&known.values, &column.values))
            .collect();
        let mut factors = Vec::with_capacity(self.columns.len() + 1);
        let (mut power, mut seen) = (full, dot(&column.values, &self.y.values));
        for (combination, known) in self.combinations.iter().zip(&self.seen) {
            let shares = combination.iter().zip(&products);
            let factor: f64 = shares.map(|(share, product)| share * product).sum();
            power -= factor * factor;
            seen -= factor * known;
            factors.push(factor);
        }
        if !(power > SPANNED * full) {
            return;
        }
        let mut combination = vec![0.0; self.columns.len() + 1];
        for (factor, known) in factors.iter().zip(&self.combinations) {
            add_scaled(&mut combination, -factor, known);
        }
        combination[self.columns.len()] = 1.0;
        let length = power.sqrt();
        scale(&mut combination, 1.0 / length);
        self.combinations.push(combination);
        self.seen.push(seen / length);
        self.columns.push(column);
    }

    /// Sum of squares that each of some trials would explain, whose first column is number `first` of all; `out` are scanned
    /// rows that do not count.
    pub fn gains(&self, first: usize, trials: &[Trial], out: &[usize]) -> Vec<f64> {
        let count = trials.iter().map(|trial| trial.columns().len()).sum();
        let span = first..first + count;
        let mut right = self.y.crossed[span.clone()].to_vec();
        let mut shared: Vec<Vec<f64>> = Vec::with_capacity(self.combinations.len());
        for (combination, seen) in self.combinations.iter().zip(&self.seen) {
            let mut along = vec![0.0; count];
            for (column, share) in self.columns.iter().zip(combination) {
                add_scaled(&mut along, *share, &column.crossed[span.clone()]);
            }
            add_scaled(&mut right, -seen, &along);
            shared.push(along);
        }
        let mut begun = 0;
        let mut gain = |trial: &Trial| {
            let width = trial.columns().len();
            let of = begun..begun + width;
            begun += width;
            let known = shared.iter().map(|along| &along[of.clone()]);
            trial.explained(known, &mut right[of.clone()], out)
        };
        trials.iter().map(&mut gain).collect()
    }
}
