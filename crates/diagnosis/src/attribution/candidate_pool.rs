//! The candidates of an attribution: the blocks of the library, and the shapes that a session makes probable.
//!
//! What does not depend on the deviations is built once ([`Shapes`]) and shared by all attributions of a session. Shapes
//! are scanned against the residuals of the best sets and refined continuously. Metres.

use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::rc::Rc;

use effects::discrepancy::{Localised, discrepancies};
use effects::observation::{Column, Observations};
use effects::{Variant, candidate, candidates};
use inference::candidate::{Alias, Candidate};
use inference::columns::{Columns, Rows, matrix_of};
use inference::discrepancy::Discrepancy;
use inference::evidence::InnerProducts;
use inference::golden_section::golden_section;
use inference::linear::{SPANNED, dot, orthonormal, project_out};
use inference::posterior::ModelPosterior;
use inference::scan::{CrossProducts, MaskedColumn, ResidualProjection, Trials};
use inference::search::{EvidenceCache, Priors, ScoredSet, exchange_best, search};
use inference::trial::Trial;
use inference::whitened::Regression;
use nalgebra::DMatrix;

/// Rows on which shapes are scanned.
const SCANNED: usize = 800;
/// Peaks of a shape's scan that become candidates.
const PEAKS: usize = 2;
/// A shape with at most this many separate values becomes a candidate at each.
const FEW: usize = 4;
/// A process that keeps less than this share of its power beside a table of an effect says nothing else.
const APART: f64 = 0.02;
/// Share of a shape by which it is changed for a slope.
const STEP: f64 = 1e-4;

/// Rows in use, and discrepancies over them.
type OfRows = (Vec<bool>, Rc<[Rc<Discrepancy>]>);

/// How each weighted column of a variant changes with its shape.
type Slopes = Rc<[Vec<f64>]>;

/// What the library offers in a session, whatever its deviations.
pub(crate) struct Shapes<'a> {
    pub(crate) observations: &'a Observations,
    pub(crate) variants: &'a [Variant],
    base: Vec<Candidate>,
    aliases: Vec<Vec<Alias>>,
    trials: Vec<OnceCell<Vec<Trial>>>,
    /// Rows on which shapes are scanned: all of a usual session, some of a long one.
    pub(crate) sample: Vec<usize>,
    sampled: Option<Observations>,
    /// Discrepancies over all rows, then over the rows in use, as far as they were asked for: they do not depend on the deviations.
    discrepancies: RefCell<Vec<OfRows>>,
    /// The base over the rows in use, as far as it was asked for.
    columns: RefCell<Vec<Rc<Columns>>>,
    /// Slopes, by variant and the bits of its shape, as far as they were asked for.
    slopes: RefCell<BTreeMap<(usize, u64), Slopes>>,
    /// Inner products of candidates with all trials, as far as they were asked for.
    pub(crate) crossed: CrossProducts,
    localised: OnceCell<(Localised, DMatrix<f64>)>,
}

impl<'a> Shapes<'a> {
    pub(crate) fn new(observations: &'a Observations, variants: &'a [Variant]) -> Self {
        let rows = observations.rows.len();
        let sample = sample_of(rows);
        let sampled = (sample.len() < rows).then(|| Observations {
            rows: sample
                .iter()
                .map(|&row| observations.rows[row].clone())
                .collect(),
            ..observations.clone()
        });
        let mut shapes = Self {
            observations,
            variants,
            base: Vec::new(),
            aliases: Vec::new(),
            trials: variants.iter().map(|_| OnceCell::new()).collect(),
            sample,
            sampled,
            discrepancies: RefCell::new(Vec::new()),
            columns: RefCell::new(Vec::new()),
            slopes: RefCell::default(),
            crossed: CrossProducts::default(),
            localised: OnceCell::new(),
        };
        for (index, variant) in variants.iter().enumerate() {
            let (plain, bent) = match &variant.shape {
                None => candidates(observations, variants, index),
                Some(shape) if !shape.continuous && shape.trials.len() <= FEW => {
                    for &value in &shape.trials {
                        shapes.add(candidate(observations, variants, index, value));
                    }
                    continue;
                }
                Some(_) => continue,
            };
            shapes.add(plain);
            shapes.add(bent);
        }
        shapes
    }

    fn add(&mut self, candidate: Option<Candidate>) {
        if let Some(candidate) = candidate {
            add_or_alias(self.variants, &mut self.base, &mut self.aliases, candidate);
        }
    }

    /// Displacements on parts of the travel of each axis, with a row for each over the rows on which shapes are scanned.
    pub(crate) fn localised(&self) -> &(Localised, DMatrix<f64>) {
        self.localised.get_or_init(|| {
            let localised = Localised::new(self.sampled.as_ref().unwrap_or(self.observations));
            let (rows, count) = (self.sample.len(), localised.count());
            let across = DMatrix::from_vec(rows, count, localised.columns()).transpose();
            (localised, across)
        })
    }

    /// Blocks that stand for the whole library where any smooth explanation will do.
    pub(crate) fn default_blocks(&self) -> Vec<&[Vec<f64>]> {
        let usual = |candidate: &&Candidate| {
            let variant = &self.variants[candidate.variant];
            !candidate.second_order && variant.shape.is_none() && variant.prior_weight >= 1.0
        };
        let usual = self.base.iter().filter(usual);
        usual.map(|candidate| candidate.block.as_slice()).collect()
    }

    /// All discrepancies over the rows in `active`.
    pub(crate) fn discrepancies(&self, active: &[bool]) -> Rc<[Rc<Discrepancy>]> {
        let kept: Vec<usize> = (0..active.len()).filter(|&row| active[row]).collect();
        let mut known = self.discrepancies.borrow_mut();
        if known.is_empty() {
            let all = vec![true; active.len()];
            let made = discrepancies(self.observations, &all).into_iter();
            let tables = self.smooth_tables();
            let other = made.filter(|discrepancy| !is_spanned(discrepancy, &tables));
            known.push((all, other.map(Rc::new).collect()));
        }
        if let Some((_, discrepancies)) = known.iter().find(|(rows, _)| rows == active) {
            return Rc::clone(discrepancies);
        }
        let all = &known[0].1;
        let made: Rc<[Rc<Discrepancy>]> = (all.iter())
            .map(|discrepancy| Rc::new(discrepancy.restricted_to(&kept)))
            .collect();
        known.push((active.to_vec(), Rc::clone(&made)));
        made
    }

    /// An orthonormal basis of what each effect can do that is a smooth function with a prior of its own.
    fn smooth_tables(&self) -> Vec<DMatrix<f64>> {
        let mut tables: BTreeMap<&str, Vec<&Vec<f64>>> = BTreeMap::new();
        for candidate in &self.base {
            let variant = &self.variants[candidate.variant];
            if variant.prior.is_some() {
                let columns = tables.entry(&variant.effect).or_default();
                columns.extend(&candidate.block);
            }
        }
        let rows = self.observations.rows.len();
        let basis = |columns: Vec<&Vec<f64>>| {
            matrix_of(rows, &orthonormal(columns.into_iter().cloned(), SPANNED))
        };
        tables.into_values().map(basis).collect()
    }

    /// The base over the rows in `active`, with AR(1) noise of this lag-1 correlation.
    fn columns(&self, active: &[bool], lag1_correlation: f64) -> Rc<Columns> {
        let rows = Rows {
            active: active.to_vec(),
            touches: self.observations.touches(),
            lag1_correlation,
        };
        let mut known = self.columns.borrow_mut();
        if let Some(columns) = known.iter().find(|columns| *columns.rows() == rows) {
            return Rc::clone(columns);
        }
        let blocks = self.base.iter().map(|candidate| candidate.block.as_slice());
        let made = Rc::new(Columns::new(rows, blocks));
        known.push(Rc::clone(&made));
        made
    }

    /// Tried values of a variant's shape; none where it has no shape.
    pub(crate) fn trials(&self, index: usize) -> &[Trial] {
        let Some(shape) = &self.variants[index].shape else {
            return &[];
        };
        self.trials[index].get_or_init(|| {
            let observations = self.sampled.as_ref().unwrap_or(self.observations);
            let mut signatures = self.variants[index].signatures(observations);
            for column in signatures.iter_mut().flatten() {
                for (part, row) in column.iter_mut().zip(&observations.rows) {
                    *part *= row.weight;
                }
            }
            let values = shape.trials.iter();
            values
                .zip(signatures)
                .map(|(&value, columns)| bounded(value, columns, &self.variants[index]))
                .collect()
        })
    }

    /// How a variant's weighted columns change with its shape; `None` where that is not continuous.
    pub(crate) fn slopes(&self, index: usize, shape: f64) -> Option<Slopes> {
        let variant = &self.variants[index];
        variant.shape.as_ref().filter(|shape| shape.continuous)?;
        let mut known = self.slopes.borrow_mut();
        let slopes = known.entry((index, shape.to_bits())).or_insert_with(|| {
            let step = STEP * shape;
            let above = variant.columns(self.observations, shape + step);
            let below = variant.columns(self.observations, shape - step);
            let slope = |(high, low): (&Column, &Column)| -> Vec<f64> {
                let rows = self.observations.rows.iter();
                let change = high.signature.iter().zip(&low.signature);
                (change.zip(rows))
                    .map(|((high, low), row)| (high - low) / (2.0 * step) * row.weight)
                    .collect()
            };
            above.iter().zip(&below).map(slope).collect()
        });
        Some(Rc::clone(slopes))
    }

    /// Values on the scanned rows, zero where a row is not `active`.
    pub(crate) fn scanned(&self, values: &[f64], active: &[bool]) -> Vec<f64> {
        (self.sample.iter())
            .map(|&row| if active[row] { values[row] } else { 0.0 })
            .collect()
    }

    /// Scanned rows that are not `active`, by their index among the scanned.
    pub(crate) fn inactive(&self, active: &[bool]) -> Vec<usize> {
        (0..self.sample.len())
            .filter(|&index| !active[self.sample[index]])
            .collect()
    }

    fn trial(&self, index: usize, value: f64, rows: Option<&Observations>) -> Trial {
        let observations = rows.unwrap_or(self.observations);
        let columns = self.variants[index].columns(observations, value);
        let weighted = |column: Column| -> Vec<f64> {
            (column.signature.iter().zip(&observations.rows))
                .map(|(part, row)| part * row.weight)
                .collect()
        };
        let columns = columns.into_iter().map(weighted).collect();
        bounded(value, columns, &self.variants[index])
    }
}

impl Trials for Shapes<'_> {
    fn sample(&self) -> &[usize] {
        &self.sample
    }

    fn trials(&self) -> impl Iterator<Item = &Trial> {
        (0..self.variants.len()).flat_map(|index| self.trials(index))
    }
}

/// Rows of so many on which shapes are scanned, ascending: all of [`SCANNED`], of more those that a Kronecker sequence of the
/// golden section picks. Evenly spaced ones would take one direction only of places that are read along x, then along y.
fn sample_of(rows: usize) -> Vec<usize> {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let share = SCANNED as f64 / rows.max(1) as f64;
    (0..rows)
        .filter(|&row| share >= 1.0 || (GOLDEN * row as f64).fract() < share)
        .collect()
}

/// True for a process that is one of these tables by another name: a displacement along an axis that depends on where it is,
/// however it is described, is its positioning error.
fn is_spanned(discrepancy: &Discrepancy, tables: &[DMatrix<f64>]) -> bool {
    let mut left = tables.iter().map(|table| discrepancy.share_beside(table));
    left.any(|left| left.is_some_and(|left| left < APART))
}

/// A trial whose coefficients are unlikely to exceed the plausible sizes of a variant's parameters.
fn bounded(value: f64, columns: Vec<Vec<f64>>, variant: &Variant) -> Trial {
    let plausible = variant
        .parameters
        .iter()
        .map(|parameter| parameter.plausible);
    Trial::bounded(value, columns, plausible)
}

/// Adds a candidate, or an alias of the one whose span is the same; gives its index.
fn add_or_alias(
    variants: &[Variant],
    candidates: &mut Vec<Candidate>,
    aliases: &mut Vec<Vec<Alias>>,
    candidate: Candidate,
) -> usize {
    for (index, known) in candidates.iter().enumerate() {
        if known.same_span(&candidate) {
            let effect = &variants[candidate.variant].effect;
            let named = |alias: &Alias| variants[alias.variant].effect == *effect;
            if *effect != variants[known.variant].effect && !aliases[index].iter().any(named) {
                aliases[index].push(Alias {
                    variant: candidate.variant,
                    shape: candidate.shape,
                    second_order: candidate.second_order,
                });
            }
            return index;
        }
    }
    candidates.push(candidate);
    aliases.push(Vec::new());
    candidates.len() - 1
}

/// Candidates of one attribution.
pub(crate) struct CandidatePool<'a> {
    pub(crate) shapes: &'a Shapes<'a>,
    pub(crate) y: &'a [f64],
    pub(crate) active: &'a [bool],
    /// Lag-1 correlation of the touch noise.
    pub(crate) lag1_correlation: f64,
    pub(crate) candidates: Vec<Candidate>,
    pub(crate) aliases: Vec<Vec<Alias>>,
    pub(crate) products: InnerProducts,
    /// Candidates are only added, so that the evidence of a set stays valid.
    evidence: EvidenceCache,
    /// The deviations' products with all trials.
    deviations: OnceCell<Rc<MaskedColumn>>,
}

impl<'a> CandidatePool<'a> {
    pub(crate) fn new(
        shapes: &'a Shapes<'a>,
        y: &'a [f64],
        active: &'a [bool],
        lag1_correlation: f64,
    ) -> Self {
        Self {
            shapes,
            y,
            active,
            lag1_correlation,
            candidates: shapes.base.clone(),
            aliases: shapes.aliases.clone(),
            products: InnerProducts::new(&[], y, active),
            evidence: EvidenceCache::new(),
            deviations: OnceCell::new(),
        }
    }

    /// Takes over the candidates of another attribution of the same session.
    pub(crate) fn take_over(&mut self, other: &ModelPosterior) {
        self.candidates.clone_from(&other.candidates);
        self.aliases.clone_from(&other.aliases);
    }

    /// The rows in use and the correlation of their noise.
    pub(crate) fn rows(&self) -> Rows {
        Rows {
            active: self.active.to_vec(),
            touches: self.shapes.observations.touches(),
            lag1_correlation: self.lag1_correlation,
        }
    }

    /// Weighted deviations of all rows less what the effects of a set predict that is fitted alone or beside a discrepancy, m; `None`
    /// for a set that cannot be solved.
    pub(super) fn residuals_of(
        &self,
        set: &[usize],
        beside: Option<(&Discrepancy, f64)>,
    ) -> Option<Vec<f64>> {
        let regression = Regression {
            candidates: &self.candidates,
            products: &self.products,
            y: self.y,
            rows: self.rows(),
        };
        regression.residuals(set, beside)
    }

    pub(super) fn effect(&self, member: usize) -> &str {
        &self.shapes.variants[self.candidates[member].variant].effect
    }

    pub(crate) fn priors(&self) -> Priors {
        let mut numbers: BTreeMap<&str, usize> = BTreeMap::new();
        let mut counts: BTreeMap<&str, f64> = BTreeMap::new();
        for variant in self.shapes.variants {
            let next = numbers.len();
            numbers.entry(&variant.effect).or_insert(next);
            *counts.entry(&variant.effect).or_insert(0.0) += variant.prior_weight;
        }
        let classes = |index: usize| {
            let mut effects: Vec<&str> = self.aliases[index]
                .iter()
                .map(|alias| self.shapes.variants[alias.variant].effect.as_str())
                .collect();
            effects.sort_unstable();
            effects.dedup();
            (1.0 + effects.len() as f64).ln()
        };
        let members = 0..self.candidates.len();
        Priors {
            effect: members
                .clone()
                .map(|member| numbers[self.effect(member)])
                .collect(),
            log_prior: members
                .map(|member| {
                    let candidate = &self.candidates[member];
                    let share = self.shapes.variants[candidate.variant].prior_weight;
                    candidate.log_prior
                        + (share / counts[self.effect(member)]).ln()
                        + classes(member)
                })
                .collect(),
            effects: numbers.len(),
        }
    }

    /// A search of this width over all candidates there are by now.
    pub(crate) fn search(&mut self, beam: usize) -> Vec<ScoredSet> {
        self.refresh();
        let priors = self.priors();
        let mut scored = search(&self.products, &priors, beam, &mut self.evidence);
        exchange_best(&self.products, &priors, &mut scored);
        scored
    }

    /// Inner products of all candidates there are by now.
    pub(crate) fn refresh(&mut self) {
        let added = self.candidates[self.shapes.base.len()..].iter();
        let added = added.map(|candidate| candidate.block.as_slice());
        let base = self.shapes.columns(self.active, self.lag1_correlation);
        let plausible = (self.candidates.iter()).flat_map(|candidate| &candidate.plausible);
        let bent =
            (self.candidates.iter().enumerate()).filter(|(_, candidate)| candidate.second_order);
        self.products =
            (base.products(added, self.y).capped(plausible)).squared(bent.map(|(index, _)| index));
    }

    fn add(&mut self, candidate: Option<Candidate>) {
        if let Some(candidate) = candidate {
            add_or_alias(
                self.shapes.variants,
                &mut self.candidates,
                &mut self.aliases,
                candidate,
            );
        }
    }

    /// Adds the shapes that best explain the residuals of `context`; an effect of the context is scanned beside the others.
    pub(crate) fn scan(&mut self, context: &[usize]) {
        let masked = || Rc::new(MaskedColumn::new(self.shapes, self.active, self.y));
        let deviations = Rc::clone(self.deviations.get_or_init(masked));
        self.scan_for(context, &deviations);
    }

    /// The same in `left`, what something unknown leaves of the deviations, and refines the shapes of the context there; true
    /// where that gives candidates that were not there.
    pub(crate) fn scan_beside(&mut self, context: &[usize], left: &[f64]) -> bool {
        let before = self.candidates.len();
        let deviations = Rc::new(MaskedColumn::new(self.shapes, self.active, left));
        self.scan_for(context, &deviations);
        self.refine_for(context, left);
        self.candidates.len() > before
    }

    fn scan_for(&mut self, context: &[usize], deviations: &Rc<MaskedColumn>) {
        let shapes = self.shapes;
        let mut projections: BTreeMap<Option<usize>, ResidualProjection> = BTreeMap::new();
        let out = shapes.inactive(self.active);
        let mut next = 0;
        for (index, variant) in shapes.variants.iter().enumerate() {
            let trials = shapes.trials(index);
            let first = next;
            next += trials
                .iter()
                .map(|trial| trial.columns().len())
                .sum::<usize>();
            let offered = variant
                .shape
                .as_ref()
                .is_some_and(|shape| shape.continuous || shape.trials.len() > FEW);
            if !offered {
                continue;
            }
            let member = context
                .iter()
                .position(|&member| self.effect(member) == variant.effect);
            let projection = projections.entry(member).or_insert_with(|| {
                let others = (context.iter().enumerate())
                    .filter(|&(index, _)| Some(index) != member)
                    .map(|(_, &member)| &self.candidates[member]);
                ResidualProjection::new(
                    shapes,
                    self.active,
                    &shapes.crossed,
                    others,
                    Rc::clone(deviations),
                )
            });
            let gains = projection.gains(first, trials, &out);
            let mut peaks: Vec<usize> = (0..gains.len())
                .filter(|&i| {
                    (i == 0 || gains[i] >= gains[i - 1])
                        && (i + 1 == gains.len() || gains[i] >= gains[i + 1])
                })
                .collect();
            peaks.sort_by(|&a, &b| gains[b].total_cmp(&gains[a]).then(a.cmp(&b)));
            for peak in peaks.into_iter().take(PEAKS) {
                let value = trials[peak].value;
                self.add(candidate(
                    shapes.observations,
                    shapes.variants,
                    index,
                    value,
                ));
            }
        }
    }

    /// Refines the continuous shapes of a set, one after the other, and adds the refined candidates.
    pub(crate) fn refine(&mut self, set: &[usize]) {
        self.refine_for(set, self.y);
    }

    fn refine_for(&mut self, set: &[usize], deviations: &[f64]) {
        let shapes = self.shapes;
        for &member in set {
            let index = self.candidates[member].variant;
            let variant = &shapes.variants[index];
            let Some(shape) = variant.shape.as_ref().filter(|shape| shape.continuous) else {
                continue;
            };
            let others = (set.iter())
                .filter(|&&other| other != member)
                .map(|&other| &self.candidates[other]);
            let residuals = ScannedResiduals::new(shapes, self.active, deviations, others);
            let value = self.candidates[member].shape;
            let nearest = shape.trials.partition_point(|&trial| trial < value);
            let low = shape.trials[nearest.saturating_sub(1)];
            let high = shape.trials[(nearest + 1).min(shape.trials.len() - 1)];
            let quality = |value: f64| {
                residuals.explained_by(&shapes.trial(index, value, shapes.sampled.as_ref()))
            };
            let best = golden_section(low, high, quality);
            self.add(candidate(shapes.observations, shapes.variants, index, best));
        }
    }
}

/// Values over the scanned rows less their projection onto the span of a set of candidates.
pub(crate) struct ScannedResiduals {
    basis: Vec<Vec<f64>>,
    residuals: Vec<f64>,
    /// Scanned rows that are not in use, by their index among the scanned.
    inactive: Vec<usize>,
}

impl ScannedResiduals {
    /// Residuals of `values`, one for each row, beside the candidates of `set`; rows that are not `active` count as zero.
    pub(crate) fn new<'c>(
        shapes: &Shapes<'_>,
        active: &[bool],
        values: &[f64],
        set: impl Iterator<Item = &'c Candidate>,
    ) -> Self {
        let columns = set.flat_map(|candidate| &candidate.block);
        let basis = orthonormal(
            columns.map(|column| shapes.scanned(column, active)),
            SPANNED,
        );
        let mut residuals = shapes.scanned(values, active);
        project_out(&mut residuals, &basis);
        Self {
            basis,
            residuals,
            inactive: shapes.inactive(active),
        }
    }

    /// Sum of squares.
    pub(crate) fn energy(&self) -> f64 {
        dot(&self.residuals, &self.residuals)
    }

    /// How much of the sum of squares a trial explains beside the set.
    pub(crate) fn explained_by(&self, trial: &Trial) -> f64 {
        trial.gain(&self.basis, &self.residuals, &self.inactive)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of any period up to a dozen every residue is taken as often as any other, within a tenth.
    #[test]
    fn a_sample_prefers_no_residue() {
        assert_eq!(sample_of(700), (0..700).collect::<Vec<_>>());
        for rows in [1280, 5003] {
            let sample = sample_of(rows);
            assert!(sample.len().abs_diff(SCANNED) <= 2, "{}", sample.len());
            for period in 2..=12 {
                for residue in 0..period {
                    let own = sample
                        .iter()
                        .filter(|&&row| row % period == residue)
                        .count();
                    let expected = SCANNED / period;
                    assert!(
                        10 * own.abs_diff(expected) <= expected + 10,
                        "{own} of {residue} mod {period}"
                    );
                }
            }
        }
    }
}
