//! Candidates under construction: the library's blocks, and the shapes that a session makes likely.
//!
//! What does not depend on the deviations is built once ([`Shapes`]) and shared by all attributions of a session. Shapes
//! are scanned against what the best sets leave and refined continuously. Metres.

use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::rc::Rc;

use crate::attribution::Attribution;
use crate::candidate::{Alias, Candidate};
use crate::columns::{Columns, Rows};
use crate::effects::Variant;
use crate::evidence::{Products, add_scaled, dot, scale};
use crate::observation::{Column, Observations};
use crate::rivals::{Rival, rivals};
use crate::scan::{Crossed, Left, Masked};
use crate::search::{Known, Priors, Scored, search, usual_beam};

/// Rows on which shapes are scanned.
const SCANNED: usize = 800;
/// Peaks of a shape's scan that become candidates.
const PEAKS: usize = 2;
/// A shape with at most so many separate values offers them all.
const FEW: usize = 4;
/// Two blocks are the same when their spans share all but this part.
const SAME: f64 = 1e-7;
/// Noise of a usual touch, m: only weighs plausible sizes while shapes are scanned.
const USUAL_NOISE: f64 = 1e-6;
/// Share of a shape by which it is changed for a slope.
const STEP: f64 = 1e-4;
/// Rounds of the search for the best value of a shape.
const REFINED: usize = 16;
/// A column that keeps less than this share of its power beside a basis says nothing of its own.
const OWN: f64 = 1e-4;

/// A value of a shape, the weighted columns it gives over the scanned rows, and their inner products.
pub(crate) struct Trial {
    pub(crate) value: f64,
    columns: Vec<Vec<f64>>,
    gram: Vec<f64>,
    /// What holds each coefficient to its plausible size: over touches that hardly tell, many shapes fit with absurd
    /// sizes.
    held: Vec<f64>,
}

impl Trial {
    /// Columns whose parameters have these largest plausible sizes.
    fn held(value: f64, columns: Vec<Vec<f64>>, variant: &Variant) -> Self {
        let held = variant
            .parameters
            .iter()
            .map(|parameter| (USUAL_NOISE / parameter.plausible).powi(2))
            .collect();
        Self {
            held,
            ..Self::new(value, columns)
        }
    }

    pub(crate) fn new(value: f64, columns: Vec<Vec<f64>>) -> Self {
        let gram = columns
            .iter()
            .flat_map(|one| columns.iter().map(move |other| dot(one, other)))
            .collect();
        Self {
            value,
            held: vec![0.0; columns.len()],
            columns,
            gram,
        }
    }

    /// The weighted columns over the scanned rows.
    pub(crate) fn columns(&self) -> &[Vec<f64>] {
        &self.columns
    }

    /// How much of `left` the columns explain beside an orthonormal basis; `out` are rows that do not count.
    pub(crate) fn gain(&self, basis: &[Vec<f64>], left: &[f64], out: &[usize]) -> f64 {
        let with = |values: &[f64]| -> Vec<f64> {
            let columns = self.columns.iter();
            columns.map(|column| dot(column, values)).collect()
        };
        let shared: Vec<Vec<f64>> = basis.iter().map(|known| with(known)).collect();
        self.explained(shared.iter().map(Vec::as_slice), &mut with(left), out)
    }

    /// The same from the columns' products with each column of the basis, and with what is left (`right`, used up).
    pub(crate) fn explained<'s>(
        &self,
        shared: impl Iterator<Item = &'s [f64]>,
        right: &mut [f64],
        out: &[usize],
    ) -> f64 {
        let width = self.columns.len();
        let mut gram = self.gram.clone();
        for known in shared {
            for (i, one) in known.iter().enumerate() {
                add_scaled(&mut gram[i * width..(i + 1) * width], -one, known);
            }
        }
        for i in 0..width {
            for k in 0..width {
                let missing = out.iter();
                gram[i * width + k] -= missing
                    .map(|&row| self.columns[i][row] * self.columns[k][row])
                    .sum::<f64>();
            }
            gram[i * width + i] += self.held[i];
        }
        let mut gain = 0.0;
        for i in 0..width {
            let power = gram[i * width + i];
            if power <= OWN * self.gram[i * width + i] || power <= 0.0 {
                continue;
            }
            gain += right[i] * right[i] / power;
            for k in i + 1..width {
                let factor = gram[k * width + i] / power;
                right[k] -= factor * right[i];
                for other in i + 1..width {
                    gram[k * width + other] -= factor * gram[i * width + other];
                }
            }
        }
        gain
    }
}

/// Rows in use, and rivals over them.
type OfRows = (Vec<bool>, Rc<[Rc<Rival>]>);

/// How each weighted column of a variant changes with its shape.
type Slopes = Rc<[Vec<f64>]>;

/// What the library offers in a session, whatever its deviations.
pub(crate) struct Shapes<'a> {
    pub(crate) observations: &'a Observations,
    pub(crate) variants: &'a [Variant],
    base: Vec<Candidate>,
    aliases: Vec<Vec<Alias>>,
    trials: Vec<OnceCell<Vec<Trial>>>,
    /// Rows on which shapes are scanned: all of a usual session, evenly spaced ones of a long one.
    pub(crate) sample: Vec<usize>,
    sampled: Option<Observations>,
    /// Rivals over all rows, then over the rows in use, as far as they were asked for: they do not depend on the deviations.
    rivals: RefCell<Vec<OfRows>>,
    /// The base over the rows in use, as far as it was asked for.
    columns: RefCell<Vec<Rc<Columns>>>,
    /// Slopes, by variant and the bits of its shape, as far as they were asked for.
    slopes: RefCell<BTreeMap<(usize, u64), Slopes>>,
    /// Products of candidates with all trials, as far as they were asked for.
    pub(crate) crossed: Crossed,
}

impl<'a> Shapes<'a> {
    pub(crate) fn new(observations: &'a Observations, variants: &'a [Variant]) -> Self {
        let rows = observations.rows.len();
        let stride = rows.div_ceil(SCANNED).max(1);
        let sample: Vec<usize> = (0..rows).step_by(stride).collect();
        let sampled = (stride > 1).then(|| Observations {
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
            rivals: RefCell::new(Vec::new()),
            columns: RefCell::new(Vec::new()),
            slopes: RefCell::default(),
            crossed: Crossed::default(),
        };
        for (place, variant) in variants.iter().enumerate() {
            let (plain, bent) = match &variant.shape {
                None => Candidate::both(observations, variants, place),
                Some(shape) if !shape.continuous && shape.trials.len() <= FEW => {
                    for &value in &shape.trials {
                        let candidate = Candidate::new(observations, variants, place, value);
                        shapes.add(candidate);
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
            join(self.variants, &mut self.base, &mut self.aliases, candidate);
        }
    }

    /// Blocks that stand for the whole library where any smooth explanation will do.
    pub(crate) fn usual(&self) -> Vec<&Candidate> {
        let usual = |candidate: &&Candidate| {
            let variant = &self.variants[candidate.variant];
            !candidate.bends && variant.shape.is_none() && variant.share >= 1.0
        };
        self.base.iter().filter(usual).collect()
    }

    /// All rivals over the rows in `active`.
    pub(crate) fn rivals(&self, active: &[bool]) -> Rc<[Rc<Rival>]> {
        let kept: Vec<usize> = (0..active.len()).filter(|&row| active[row]).collect();
        let mut known = self.rivals.borrow_mut();
        if known.is_empty() {
            let all = vec![true; active.len()];
            let made = rivals(self.observations, &all).into_iter().map(Rc::new);
            known.push((all, made.collect()));
        }
        if let Some((_, rivals)) = known.iter().find(|(rows, _)| rows == active) {
            return Rc::clone(rivals);
        }
        let all = &known[0].1;
        let made: Rc<[Rc<Rival>]> = (all.iter())
            .map(|rival| Rc::new(rival.over(&kept)))
            .collect();
        known.push((active.to_vec(), Rc::clone(&made)));
        made
    }

    /// The base over the rows in `active`, whose noise remembers a share `correlation` of the touch before.
    fn columns(&self, active: &[bool], correlation: f64) -> Rc<Columns> {
        let rows = Rows {
            active: active.to_vec(),
            touches: self.observations.touches(),
            correlation,
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
    pub(crate) fn trials(&self, place: usize) -> &[Trial] {
        let Some(shape) = &self.variants[place].shape else {
            return &[];
        };
        self.trials[place].get_or_init(|| {
            let observations = self.sampled.as_ref().unwrap_or(self.observations);
            let mut signatures = self.variants[place].signatures(observations);
            for column in signatures.iter_mut().flatten() {
                for (part, row) in column.iter_mut().zip(&observations.rows) {
                    *part *= row.weight;
                }
            }
            let values = shape.trials.iter();
            values
                .zip(signatures)
                .map(|(&value, columns)| Trial::held(value, columns, &self.variants[place]))
                .collect()
        })
    }

    /// How a variant's weighted columns change with its shape; `None` where that is not continuous.
    pub(crate) fn slopes(&self, place: usize, shape: f64) -> Option<Slopes> {
        let variant = &self.variants[place];
        variant.shape.as_ref().filter(|own| own.continuous)?;
        let mut known = self.slopes.borrow_mut();
        let slopes = known.entry((place, shape.to_bits())).or_insert_with(|| {
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

    fn trial(&self, place: usize, value: f64, rows: Option<&Observations>) -> Trial {
        let observations = rows.unwrap_or(self.observations);
        let columns = self.variants[place].columns(observations, value);
        let weighted = |column: Column| -> Vec<f64> {
            (column.signature.iter().zip(&observations.rows))
                .map(|(part, row)| part * row.weight)
                .collect()
        };
        let columns = columns.into_iter().map(weighted).collect();
        Trial::held(value, columns, &self.variants[place])
    }
}

/// Adds a candidate unless its span is there already; then its effect becomes an alias.
fn join(
    variants: &[Variant],
    candidates: &mut Vec<Candidate>,
    aliases: &mut Vec<Vec<Alias>>,
    candidate: Candidate,
) -> usize {
    for (place, known) in candidates.iter().enumerate() {
        if same_span(known, &candidate) {
            let effect = &variants[candidate.variant].effect;
            let named = |alias: &Alias| variants[alias.variant].effect == *effect;
            if *effect != variants[known.variant].effect && !aliases[place].iter().any(named) {
                aliases[place].push(Alias {
                    variant: candidate.variant,
                    shape: candidate.shape,
                    bends: candidate.bends,
                });
            }
            return place;
        }
    }
    candidates.push(candidate);
    aliases.push(Vec::new());
    candidates.len() - 1
}

/// Candidates of one attribution.
pub(crate) struct Pool<'a> {
    pub(crate) shapes: &'a Shapes<'a>,
    pub(crate) y: &'a [f64],
    pub(crate) active: &'a [bool],
    /// Share of a touch's noise that the next one remembers.
    pub(crate) correlation: f64,
    pub(crate) candidates: Vec<Candidate>,
    pub(crate) aliases: Vec<Vec<Alias>>,
    pub(crate) products: Products,
    /// Candidates are only added: what is known of a set stays true.
    known: Known,
    /// The deviations' products with all trials.
    seen: OnceCell<Rc<Masked>>,
}

impl<'a> Pool<'a> {
    pub(crate) fn new(
        shapes: &'a Shapes<'a>,
        y: &'a [f64],
        active: &'a [bool],
        correlation: f64,
    ) -> Self {
        Self {
            shapes,
            y,
            active,
            correlation,
            candidates: shapes.base.clone(),
            aliases: shapes.aliases.clone(),
            products: Products::new(&[], y, active),
            known: Known::new(),
            seen: OnceCell::new(),
        }
    }

    /// Takes over the candidates of another attribution of the same session.
    pub(crate) fn take(&mut self, other: &Attribution) {
        self.candidates.clone_from(&other.candidates);
        self.aliases.clone_from(&other.aliases);
    }

    fn effect(&self, member: usize) -> &str {
        &self.shapes.variants[self.candidates[member].variant].effect
    }

    pub(crate) fn priors(&self) -> Priors {
        let mut numbers: BTreeMap<&str, usize> = BTreeMap::new();
        let mut counts: BTreeMap<&str, f64> = BTreeMap::new();
        for variant in self.shapes.variants {
            let next = numbers.len();
            numbers.entry(&variant.effect).or_insert(next);
            *counts.entry(&variant.effect).or_insert(0.0) += variant.share;
        }
        let classes = |place: usize| {
            let mut effects: Vec<&str> = self.aliases[place]
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
                    let share = self.shapes.variants[candidate.variant].share;
                    candidate.log_prior
                        + (share / counts[self.effect(member)]).ln()
                        + classes(member)
                })
                .collect(),
            effects: numbers.len(),
        }
    }

    pub(crate) fn search(&mut self) -> Vec<Scored> {
        self.refresh();
        let priors = self.priors();
        search(&self.products, &priors, usual_beam(), &mut self.known)
    }

    /// Products of all candidates there are by now.
    pub(crate) fn refresh(&mut self) {
        let added = self.candidates[self.shapes.base.len()..].iter();
        let added = added.map(|candidate| candidate.block.as_slice());
        let base = self.shapes.columns(self.active, self.correlation);
        let plausible = (self.candidates.iter()).flat_map(|candidate| &candidate.plausible);
        let bent = (self.candidates.iter().enumerate()).filter(|(_, candidate)| candidate.bends);
        self.products =
            (base.products(added, self.y).capped(plausible)).squared(bent.map(|(place, _)| place));
    }

    fn add(&mut self, candidate: Option<Candidate>) {
        if let Some(candidate) = candidate {
            join(
                self.shapes.variants,
                &mut self.candidates,
                &mut self.aliases,
                candidate,
            );
        }
    }

    /// Adds the shapes that best explain what `context` leaves; an effect of the context is scanned beside the others.
    pub(crate) fn scan(&mut self, context: &[usize]) {
        let shapes = self.shapes;
        let mut lefts: BTreeMap<Option<usize>, Left> = BTreeMap::new();
        let out = self.out();
        let seen = || Rc::new(Masked::new(shapes, self.active, self.y));
        let seen = Rc::clone(self.seen.get_or_init(seen));
        let mut next = 0;
        for (place, variant) in shapes.variants.iter().enumerate() {
            let trials = shapes.trials(place);
            let first = next;
            next += trials
                .iter()
                .map(|trial| trial.columns.len())
                .sum::<usize>();
            let offered = variant
                .shape
                .as_ref()
                .is_some_and(|shape| shape.continuous || shape.trials.len() > FEW);
            if !offered {
                continue;
            }
            let own = context
                .iter()
                .position(|&member| self.effect(member) == variant.effect);
            let left = lefts.entry(own).or_insert_with(|| {
                let others = (context.iter().enumerate())
                    .filter(|&(place, _)| Some(place) != own)
                    .map(|(_, &member)| &self.candidates[member]);
                Left::new(shapes, self.active, others, Rc::clone(&seen))
            });
            let gains = left.gains(first, trials, &out);
            let mut peaks: Vec<usize> = (0..gains.len())
                .filter(|&i| {
                    (i == 0 || gains[i] >= gains[i - 1])
                        && (i + 1 == gains.len() || gains[i] >= gains[i + 1])
                })
                .collect();
            peaks.sort_by(|&one, &other| gains[other].total_cmp(&gains[one]).then(one.cmp(&other)));
            for peak in peaks.into_iter().take(PEAKS) {
                let value = trials[peak].value;
                self.add(Candidate::new(
                    shapes.observations,
                    shapes.variants,
                    place,
                    value,
                ));
            }
        }
    }

    /// Refines the continuous shapes of a set, one after the other, and adds the refined candidates.
    pub(crate) fn refine(&mut self, set: &[usize]) {
        let shapes = self.shapes;
        for &member in set {
            let place = self.candidates[member].variant;
            let variant = &shapes.variants[place];
            let Some(shape) = variant.shape.as_ref().filter(|shape| shape.continuous) else {
                continue;
            };
            let others: Vec<usize> = set
                .iter()
                .copied()
                .filter(|&other| other != member)
                .collect();
            let basis = self.basis(&others, &shapes.sample);
            let left = self.left(&basis, &shapes.sample);
            let out = self.out();
            let value = self.candidates[member].shape;
            let nearest = shape.trials.partition_point(|&trial| trial < value);
            let low = shape.trials[nearest.saturating_sub(1)];
            let high = shape.trials[(nearest + 1).min(shape.trials.len() - 1)];
            let quality = |value: f64| {
                shapes
                    .trial(place, value, shapes.sampled.as_ref())
                    .gain(&basis, &left, &out)
            };
            let best = golden(low, high, quality);
            self.add(Candidate::new(
                shapes.observations,
                shapes.variants,
                place,
                best,
            ));
        }
    }

    /// Scanned rows that are not in use.
    fn out(&self) -> Vec<usize> {
        let sample = self.shapes.sample.iter().enumerate();
        sample
            .filter(|&(_, &row)| !self.active[row])
            .map(|(place, _)| place)
            .collect()
    }

    /// Orthonormal basis of what a set spans over the active ones of `rows`.
    fn basis(&self, set: &[usize], rows: &[usize]) -> Vec<Vec<f64>> {
        let columns = set
            .iter()
            .flat_map(|&member| &self.candidates[member].block)
            .map(|column| {
                rows.iter()
                    .map(|&row| if self.active[row] { column[row] } else { 0.0 })
                    .collect()
            });
        orthonormal(columns)
    }

    /// What a basis leaves of the deviations over the active ones of `rows`.
    fn left(&self, basis: &[Vec<f64>], rows: &[usize]) -> Vec<f64> {
        let mut left: Vec<f64> = rows
            .iter()
            .map(|&row| if self.active[row] { self.y[row] } else { 0.0 })
            .collect();
        remove(&mut left, basis);
        left
    }
}

/// Orthonormal basis of columns.
pub(crate) fn orthonormal(columns: impl Iterator<Item = Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for mut rest in columns {
        let full = dot(&rest, &rest);
        remove(&mut rest, &basis);
        remove(&mut rest, &basis);
        let power = dot(&rest, &rest);
        if power > 1e-10 * full && power > 0.0 {
            scale(&mut rest, 1.0 / power.sqrt());
            basis.push(rest);
        }
    }
    basis
}

/// Takes the part in an orthonormal basis away.
pub(crate) fn remove(values: &mut [f64], basis: &[Vec<f64>]) {
    for known in basis {
        let along = dot(known, values);
        add_scaled(values, -along, known);
    }
}

fn same_span(one: &Candidate, other: &Candidate) -> bool {
    if one.block.len() != other.block.len() {
        return false;
    }
    let width = one.block.len() as f64;
    let mut shared = 0.0;
    for (place, a) in one.block.iter().enumerate() {
        shared += other.block.iter().map(|b| dot(a, b).powi(2)).sum::<f64>();
        if shared < (place as f64 + 1.0) - width * SAME {
            return false;
        }
    }
    shared > width * (1.0 - SAME)
}

/// Place of the maximum of a unimodal function.
fn golden(mut low: f64, mut high: f64, quality: impl Fn(f64) -> f64) -> f64 {
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut qa, mut qb) = (quality(a), quality(b));
    for _ in 0..REFINED {
        if qa > qb {
            (high, b, qb) = (b, a, qa);
            a = high - ratio * (high - low);
            qa = quality(a);
        } else {
            (low, a, qa) = (a, b, qb);
            b = low + ratio * (high - low);
            qb = quality(b);
        }
    }
    0.5 * (low + high)
}
