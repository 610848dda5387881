//! How much of what a set leaves each tried shape would explain, from inner products that are made once.
//!
//! The products of tried columns with a set's columns do not depend on the deviations: they are kept as long as the rows
//! in use are the same ([`Crossed`]), and what a set leaves of a trial follows from them by forward substitution. Metres.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use crate::candidate::Candidate;
use crate::evidence::{add_scaled, dot, scale};
use crate::pool::{Shapes, Trial};

/// A column that keeps less than this share of its power beside those before it adds nothing to what they span.
const SPANNED: f64 = 1e-10;

/// A candidate's column: its variant, the bits of its shape, whether it bends, its number.
type Key = (usize, u64, bool, usize);

/// Products of columns with those of all trials, over the rows in use.
#[derive(Default)]
pub(crate) struct Crossed(RefCell<Vec<OfRows>>);

struct OfRows {
    active: Vec<bool>,
    known: BTreeMap<Key, Rc<Masked>>,
}

/// A column over the scanned rows, zero where they are not in use, and its products with the columns of all trials.
pub(crate) struct Masked {
    values: Vec<f64>,
    crossed: Vec<f64>,
}

impl Masked {
    /// Of values of all rows.
    pub(crate) fn new(shapes: &Shapes<'_>, active: &[bool], values: &[f64]) -> Self {
        let rows = shapes.sample.iter();
        let values: Vec<f64> = rows
            .map(|&row| if active[row] { values[row] } else { 0.0 })
            .collect();
        let tried = (0..shapes.variants.len()).flat_map(|place| shapes.trials(place));
        let columns = tried.flat_map(Trial::columns);
        let crossed = columns.map(|column| dot(column, &values)).collect();
        Self { values, crossed }
    }
}

impl Crossed {
    fn of(
        &self,
        shapes: &Shapes<'_>,
        active: &[bool],
        candidate: &Candidate,
        number: usize,
    ) -> Rc<Masked> {
        let mut all = self.0.borrow_mut();
        let place = (all.iter().position(|of| of.active == active)).unwrap_or_else(|| {
            all.push(OfRows {
                active: active.to_vec(),
                known: BTreeMap::new(),
            });
            all.len() - 1
        });
        let key = (
            candidate.variant,
            candidate.shape.to_bits(),
            candidate.bends,
            number,
        );
        let made = || Rc::new(Masked::new(shapes, active, &candidate.block[number]));
        Rc::clone(all[place].known.entry(key).or_insert_with(made))
    }
}

/// What a set spans and what it leaves of the deviations.
pub(crate) struct Left {
    columns: Vec<Rc<Masked>>,
    y: Rc<Masked>,
    /// A line for each column: itself less what the columns before it have, over its length.
    lines: Vec<Vec<f64>>,
    /// Products of the lines with the deviations.
    seen: Vec<f64>,
}

impl Left {
    /// Of the deviations `y` beside some candidates.
    pub(crate) fn new<'c>(
        shapes: &Shapes<'_>,
        active: &[bool],
        set: impl Iterator<Item = &'c Candidate>,
        y: Rc<Masked>,
    ) -> Self {
        let mut left = Self {
            columns: Vec::new(),
            y,
            lines: Vec::new(),
            seen: Vec::new(),
        };
        for candidate in set {
            for number in 0..candidate.block.len() {
                left.add(shapes.crossed.of(shapes, active, candidate, number));
            }
        }
        left
    }

    /// Adds a column unless it is spanned.
    fn add(&mut self, column: Rc<Masked>) {
        let full = dot(&column.values, &column.values);
        let products: Vec<f64> = (self.columns.iter())
            .map(|own| dot(&own.values, &column.values))
            .collect();
        let mut factors = Vec::with_capacity(self.columns.len() + 1);
        let (mut power, mut seen) = (full, dot(&column.values, &self.y.values));
        for (line, known) in self.lines.iter().zip(&self.seen) {
            let shares = line.iter().zip(&products);
            let factor: f64 = shares.map(|(share, product)| share * product).sum();
            power -= factor * factor;
            seen -= factor * known;
            factors.push(factor);
        }
        if !(power > SPANNED * full) {
            return;
        }
        let mut line = vec![0.0; self.columns.len() + 1];
        for (factor, known) in factors.iter().zip(&self.lines) {
            add_scaled(&mut line, -factor, known);
        }
        line[self.columns.len()] = 1.0;
        let length = power.sqrt();
        scale(&mut line, 1.0 / length);
        self.lines.push(line);
        self.seen.push(seen / length);
        self.columns.push(column);
    }

    /// How much each of some trials would explain, whose first column is number `first` of all; `out` are scanned rows
    /// that do not count.
    pub(crate) fn gains(&self, first: usize, trials: &[Trial], out: &[usize]) -> Vec<f64> {
        let count = trials.iter().map(|trial| trial.columns().len()).sum();
        let own = first..first + count;
        let mut right = self.y.crossed[own.clone()].to_vec();
        let mut shared: Vec<Vec<f64>> = Vec::with_capacity(self.lines.len());
        for (line, seen) in self.lines.iter().zip(&self.seen) {
            let mut along = vec![0.0; count];
            for (column, share) in self.columns.iter().zip(line) {
                add_scaled(&mut along, *share, &column.crossed[own.clone()]);
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
