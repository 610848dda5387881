//! Which effects: candidates, their shapes, the search, and the rivals, put together into one posterior over sets.
//!
//! Shapes (periods, time constants, instants) are scanned against what the best sets leave and refined continuously.
//! Every set stands alone and beside each promising rival; probabilities are over all of them. Outliers are masked
//! before; the second order of large displacements on curved surfaces is corrected from outside.

use std::collections::BTreeMap;

use crate::candidate::Candidate;
use crate::effects::Variant;
use crate::evidence::{Fit, Products, add_scaled, dot, scale};
use crate::observation::Observations;
use crate::rivals::{Rival, rivals};
use crate::search::{MOST_EFFECTS, Priors, Scored, extend, prune, search, usual_beam};

/// Prior probability that something outside the vocabulary acts.
const UNKNOWN: f64 = 0.05;
/// Variances of a rival over that of the noise that are tried.
const POWERS: [f64; 7] = [0.3, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0];
/// A rival this far (natural log) behind the best is not searched further.
const FAR_BEHIND: f64 = 14.0;
/// Rounds of growth beyond the search's depth.
const GROWTHS: usize = 3;
/// Rows on which shapes are scanned.
const SCANNED: usize = 800;
/// Peaks of a shape's scan that become candidates.
const PEAKS: usize = 2;
/// Two blocks are the same when their spans share all but this part.
const SAME: f64 = 1e-7;

/// One explanation: a set of candidates, with or without a rival.
#[derive(Debug, Clone)]
pub struct Model {
    /// Candidates, ascending.
    pub set: Vec<usize>,
    /// Rival and the variance of its process over that of the noise.
    pub rival: Option<(usize, f64)>,
    /// Probability among all models.
    pub probability: f64,
    /// Log evidence plus log prior.
    pub score: f64,
}

/// All explanations of a session.
#[derive(Debug)]
pub struct Attribution {
    /// Candidates in use.
    pub candidates: Vec<Candidate>,
    /// Candidates with the same signature as each candidate (by place in the library of variants).
    pub aliases: Vec<Vec<usize>>,
    /// Rivals.
    pub rivals: Vec<Rival>,
    /// Models, most probable first.
    pub models: Vec<Model>,
    /// Products over the active rows.
    pub products: Products,
    /// Weighted deviations of all rows.
    pub y: Vec<f64>,
    /// Rows in use.
    pub active: Vec<bool>,
}

/// Explains weighted deviations `y` of the rows in `active`.
pub fn attribute(
    observations: &Observations,
    variants: &[Variant],
    y: &[f64],
    active: &[bool],
) -> Attribution {
    let mut pool = Pool::new(observations, variants, y, active);
    pool.scan(&[]);
    let mut scored = pool.search();
    for _ in 0..2 {
        let contexts = best_of_each_size(&scored, 3);
        let before = pool.candidates.len();
        for context in &contexts {
            pool.scan(context);
        }
        pool.refine(&scored[0].set.clone());
        if pool.candidates.len() == before {
            break;
        }
        scored = pool.search();
    }
    pool.grow(&mut scored);
    pool.finish(&scored)
}

/// The best set of each size up to `most`, and the best of all.
fn best_of_each_size(scored: &[Scored], most: usize) -> Vec<Vec<usize>> {
    let mut sets: Vec<Vec<usize>> = scored
        .first()
        .map(|best| best.set.clone())
        .into_iter()
        .collect();
    for size in 1..=most {
        if let Some(best) = scored.iter().find(|scored| scored.set.len() == size)
            && !sets.contains(&best.set)
        {
            sets.push(best.set.clone());
        }
    }
    sets
}

/// A value of a shape and the weighted columns it gives.
type Trial = (f64, Vec<Vec<f64>>);

/// Candidates under construction.
struct Pool<'a> {
    observations: &'a Observations,
    variants: &'a [Variant],
    y: &'a [f64],
    active: &'a [bool],
    candidates: Vec<Candidate>,
    aliases: Vec<Vec<usize>>,
    products: Products,
    scans: BTreeMap<usize, Vec<Trial>>,
    /// Rows on which shapes are scanned: all of a usual session, evenly spaced ones of a long one.
    sample: Vec<usize>,
    sampled: Observations,
}

impl<'a> Pool<'a> {
    fn new(
        observations: &'a Observations,
        variants: &'a [Variant],
        y: &'a [f64],
        active: &'a [bool],
    ) -> Self {
        let stride = observations.rows.len().div_ceil(SCANNED);
        let sample: Vec<usize> = (0..observations.rows.len()).step_by(stride).collect();
        let sampled = Observations {
            rows: sample
                .iter()
                .map(|&row| observations.rows[row].clone())
                .collect(),
            ..observations.clone()
        };
        let mut pool = Self {
            observations,
            variants,
            y,
            active,
            candidates: Vec::new(),
            aliases: Vec::new(),
            products: Products::new(&[], y, active),
            scans: BTreeMap::new(),
            sample,
            sampled,
        };
        for (place, variant) in variants.iter().enumerate() {
            if variant.shape.is_none() {
                pool.add(Candidate::new(observations, variants, place, 0.0));
                pool.add(Candidate::bent(observations, variants, place, 0.0));
            }
        }
        pool
    }

    /// Adds a candidate unless its span is there already; then its effect becomes an alias.
    fn add(&mut self, candidate: Option<Candidate>) -> Option<usize> {
        let candidate = candidate?;
        for (place, known) in self.candidates.iter().enumerate() {
            if same_span(known, &candidate) {
                let effect = &self.variants[candidate.variant].effect;
                let known_effect = &self.variants[known.variant].effect;
                if effect != known_effect && !self.aliases[place].contains(&candidate.variant) {
                    self.aliases[place].push(candidate.variant);
                }
                return Some(place);
            }
        }
        self.candidates.push(candidate);
        self.aliases.push(Vec::new());
        Some(self.candidates.len() - 1)
    }

    fn priors(&self) -> Priors {
        let mut numbers: BTreeMap<&str, usize> = BTreeMap::new();
        let mut counts: BTreeMap<&str, f64> = BTreeMap::new();
        for variant in self.variants {
            let next = numbers.len();
            numbers.entry(&variant.effect).or_insert(next);
            *counts.entry(&variant.effect).or_insert(0.0) += 1.0;
        }
        let of = |candidate: &Candidate| self.variants[candidate.variant].effect.as_str();
        let classes = |place: usize| {
            let mut effects: Vec<&str> = self.aliases[place]
                .iter()
                .map(|&alias| self.variants[alias].effect.as_str())
                .collect();
            effects.sort_unstable();
            effects.dedup();
            (1.0 + effects.len() as f64).ln()
        };
        Priors {
            effect: self
                .candidates
                .iter()
                .map(|candidate| numbers[of(candidate)])
                .collect(),
            log_prior: self
                .candidates
                .iter()
                .enumerate()
                .map(|(place, candidate)| {
                    candidate.log_prior - counts[of(candidate)].ln() + classes(place)
                })
                .collect(),
            effects: numbers.len(),
        }
    }

    fn search(&mut self) -> Vec<Scored> {
        self.refresh();
        search(&self.products, &self.priors(), usual_beam())
    }

    /// Products of all candidates there are by now.
    fn refresh(&mut self) {
        let blocks: Vec<&[Vec<f64>]> = self
            .candidates
            .iter()
            .map(|candidate| candidate.block.as_slice())
            .collect();
        self.products = Products::new(&blocks, self.y, self.active);
    }

    /// A machine with more wrong than the search's depth: adds effects one by one, shapes scanned anew each round.
    fn grow(&mut self, scored: &mut Vec<Scored>) {
        let Some(mut best) = scored
            .first()
            .filter(|best| best.set.len() >= MOST_EFFECTS)
            .cloned()
        else {
            return;
        };
        for _ in 0..GROWTHS {
            self.scan(&best.set);
            self.refresh();
            let priors = self.priors();
            let Some(longer) = extend(&self.products, &priors, &best.set) else {
                break;
            };
            best = prune(&self.products, &priors, longer);
            scored.insert(0, best.clone());
        }
        // Neighbours of the long set tell how sure each member is.
        let priors = self.priors();
        for place in 0..best.set.len() {
            let mut set = best.set.clone();
            set.remove(place);
            let score = self.products.log_evidence(&set) + priors.of(&set);
            scored.push(Scored { set, score });
        }
        scored.sort_by(|one, other| other.score.total_cmp(&one.score));
    }

    /// Adds the shapes that best explain what `context` leaves.
    fn scan(&mut self, context: &[usize]) {
        let active: Vec<bool> = self.sample.iter().map(|&row| self.active[row]).collect();
        let y: Vec<f64> = self.sample.iter().map(|&row| self.y[row]).collect();
        let basis = self.basis(context, &self.sample);
        let left = project(&y, &active, &basis);
        for (place, variant) in self.variants.iter().enumerate() {
            let Some(shape) = &variant.shape else {
                continue;
            };
            let own = |&member: &usize| {
                self.variants[self.candidates[member].variant].effect == variant.effect
            };
            if context.iter().any(own) {
                continue;
            }
            let trials = self.scans.entry(place).or_insert_with(|| {
                let columns = |&value: &f64| {
                    let columns = variant.columns(&self.sampled, value);
                    let weighted = |column: crate::observation::Column| -> Vec<f64> {
                        (column.signature.iter().zip(&self.sampled.rows).zip(&active))
                            .map(|((part, row), &used)| if used { part * row.weight } else { 0.0 })
                            .collect()
                    };
                    (value, columns.into_iter().map(weighted).collect())
                };
                shape.trials.iter().map(columns).collect()
            });
            let gains: Vec<f64> = trials
                .iter()
                .map(|(_, columns)| gain(columns, &basis, &left))
                .collect();
            let mut peaks: Vec<usize> = (0..gains.len())
                .filter(|&i| {
                    (i == 0 || gains[i] >= gains[i - 1])
                        && (i + 1 == gains.len() || gains[i] >= gains[i + 1])
                })
                .collect();
            peaks.sort_by(|&one, &other| gains[other].total_cmp(&gains[one]).then(one.cmp(&other)));
            let values: Vec<f64> = peaks
                .iter()
                .take(PEAKS)
                .map(|&peak| trials[peak].0)
                .collect();
            for value in values {
                self.add(Candidate::new(
                    self.observations,
                    self.variants,
                    place,
                    value,
                ));
            }
        }
    }

    /// Refines the continuous shapes of a set, one after the other, and adds the refined candidates.
    fn refine(&mut self, set: &[usize]) {
        for &member in set {
            let place = self.candidates[member].variant;
            let variant = &self.variants[place];
            let Some(shape) = variant.shape.as_ref().filter(|shape| shape.continuous) else {
                continue;
            };
            let others: Vec<usize> = set
                .iter()
                .copied()
                .filter(|&other| other != member)
                .collect();
            let every: Vec<usize> = (0..self.y.len()).collect();
            let basis = self.basis(&others, &every);
            let left = project(self.y, self.active, &basis);
            let value = self.candidates[member].shape;
            let nearest = shape.trials.partition_point(|&trial| trial < value);
            let low = shape.trials[nearest.saturating_sub(1)];
            let high = shape.trials[(nearest + 1).min(shape.trials.len() - 1)];
            let quality = |value: f64| {
                Candidate::new(self.observations, self.variants, place, value)
                    .map_or(0.0, |candidate| {
                        gain(&masked(&candidate.block, self.active), &basis, &left)
                    })
            };
            let best = golden(low, high, quality);
            self.add(Candidate::new(
                self.observations,
                self.variants,
                place,
                best,
            ));
        }
    }

    /// Orthonormal basis of what a set spans over the active ones of `rows`.
    fn basis(&self, set: &[usize], rows: &[usize]) -> Vec<Vec<f64>> {
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for &member in set {
            for column in masked(&self.candidates[member].block, self.active) {
                let mut rest: Vec<f64> = rows.iter().map(|&row| column[row]).collect();
                for _ in 0..2 {
                    for known in &basis {
                        let along = dot(known, &rest);
                        add_scaled(&mut rest, -along, known);
                    }
                }
                let length = dot(&rest, &rest).sqrt();
                if length > 1e-6 {
                    scale(&mut rest, 1.0 / length);
                    basis.push(rest);
                }
            }
        }
        basis
    }

    fn finish(self, scored: &[Scored]) -> Attribution {
        let priors = self.priors();
        let rivals = rivals(self.observations, self.active);
        let mut models: Vec<Model> = scored
            .iter()
            .take(400)
            .map(|scored| Model {
                set: scored.set.clone(),
                rival: None,
                probability: 0.0,
                score: scored.score + (1.0 - UNKNOWN).ln(),
            })
            .collect();
        self.challenge(scored, &rivals, &priors, &mut models);
        models.sort_by(|one, other| other.score.total_cmp(&one.score));
        models.dedup_by(|one, other| one.set == other.set && one.rival == other.rival);
        let best = models.first().map_or(0.0, |model| model.score);
        let total: f64 = models.iter().map(|model| (model.score - best).exp()).sum();
        for model in &mut models {
            model.probability = (model.score - best).exp() / total;
        }
        Attribution {
            candidates: self.candidates,
            aliases: self.aliases,
            rivals,
            models,
            products: self.products,
            y: self.y.to_vec(),
            active: self.active.to_vec(),
        }
    }

    /// Sets every rival beside the best sets, and searches anew beside those that do well.
    fn challenge(
        &self,
        scored: &[Scored],
        rivals: &[Rival],
        priors: &Priors,
        models: &mut Vec<Model>,
    ) {
        let mut sets: Vec<Vec<usize>> = vec![Vec::new()];
        for scored in scored.iter().take(12) {
            for size in 0..=scored.set.len() {
                let mut part = scored.set.clone();
                if size < part.len() {
                    part.remove(size);
                }
                if !sets.contains(&part) {
                    sets.push(part);
                }
            }
        }
        let mut best = models
            .iter()
            .map(|model| model.score)
            .fold(f64::NEG_INFINITY, f64::max);
        let mut promising: Vec<(f64, usize, f64)> = Vec::new();
        // Only the candidates of these sets are set beside every rival: the whole library would cost too much.
        let mut members: Vec<usize> = sets.iter().flatten().copied().collect();
        members.sort_unstable();
        members.dedup();
        let few: Vec<&Candidate> = members
            .iter()
            .map(|&member| &self.candidates[member])
            .collect();
        let plain = self.products.part(&members);
        let local: Vec<Vec<usize>> = sets
            .iter()
            .map(|set| {
                set.iter()
                    .filter_map(|member| members.binary_search(member).ok())
                    .collect()
            })
            .collect();
        for (place, rival) in rivals.iter().enumerate() {
            let beside = Beside::new(&few, rival, self.y, self.active);
            let mut own: Option<(f64, f64)> = None;
            for power in POWERS {
                let price = rival.log_prior + UNKNOWN.ln() - (POWERS.len() as f64).ln();
                let whitened = beside.products(power, &plain);
                for (set, places) in sets.iter().zip(&local) {
                    let score = whitened.log_evidence(places) + priors.of(set) + price;
                    models.push(Model {
                        set: set.clone(),
                        rival: Some((place, power)),
                        probability: 0.0,
                        score,
                    });
                    if own.is_none_or(|(known, _)| score > known) {
                        own = Some((score, power));
                    }
                }
            }
            if let Some((score, power)) = own {
                best = best.max(score);
                promising.push((score, place, power));
            }
        }
        promising.sort_by(|one, other| other.0.total_cmp(&one.0));
        for (score, place, power) in promising.into_iter().take(6) {
            if score < best - FAR_BEHIND {
                break;
            }
            let rival = &rivals[place];
            let all: Vec<&Candidate> = self.candidates.iter().collect();
            let whitened =
                Beside::new(&all, rival, self.y, self.active).products(power, &self.products);
            let price = rival.log_prior + UNKNOWN.ln() - (POWERS.len() as f64).ln();
            for found in search(&whitened, priors, 6).into_iter().take(60) {
                models.push(Model {
                    set: found.set,
                    rival: Some((place, power)),
                    probability: 0.0,
                    score: found.score + price,
                });
            }
        }
    }
}

/// Products of the candidates with a rival's directions.
struct Beside<'a> {
    rival: &'a Rival,
    /// Per candidate column, its products with the rival's directions.
    crossed: Vec<Vec<f64>>,
    seen: Vec<f64>,
}

impl<'a> Beside<'a> {
    fn new(candidates: &[&Candidate], rival: &'a Rival, y: &[f64], active: &[bool]) -> Self {
        let pick = |values: &[f64]| -> Vec<f64> {
            values
                .iter()
                .zip(active)
                .filter(|&(_, &used)| used)
                .map(|(&value, _)| value)
                .collect()
        };
        let against = |values: &[f64]| -> Vec<f64> {
            let values = pick(values);
            rival
                .directions
                .iter()
                .map(|direction| dot(direction, &values))
                .collect()
        };
        let crossed = candidates
            .iter()
            .flat_map(|candidate| candidate.block.iter().map(|column| against(column)));
        Self {
            rival,
            crossed: crossed.collect(),
            seen: against(y),
        }
    }

    /// The products with the rival's part of the rows whitened, for a variance over that of the noise.
    fn products(&self, power: f64, plain: &Products) -> Products {
        let shares: Vec<f64> = self
            .rival
            .powers
            .iter()
            .map(|own| power * own / (1.0 + power * own))
            .collect();
        let weighted: Vec<Vec<f64>> = self
            .crossed
            .iter()
            .map(|column| column.iter().zip(&shares).map(|(x, w)| x * w).collect())
            .collect();
        let count = plain.qy.len();
        let mut whitened = plain.clone();
        for (one, own) in weighted.iter().enumerate() {
            for other in one..count {
                let value = plain.qq[one * count + other] - dot(own, &self.crossed[other]);
                whitened.qq[one * count + other] = value;
                whitened.qq[other * count + one] = value;
            }
            whitened.qy[one] -= dot(own, &self.seen);
        }
        whitened.yy -= self
            .seen
            .iter()
            .zip(&shares)
            .map(|(x, w)| x * x * w)
            .sum::<f64>();
        whitened.offset += 0.5
            * self
                .rival
                .powers
                .iter()
                .map(|own| (1.0 + power * own).ln())
                .sum::<f64>();
        whitened
    }
}

impl Attribution {
    /// Fit of a model's set on the active rows, beside its rival.
    pub fn fit(&self, model: &Model) -> Option<Fit> {
        match model.rival {
            None => self.products.fit(&model.set),
            Some((place, power)) => {
                let members: Vec<&Candidate> = model
                    .set
                    .iter()
                    .map(|&member| &self.candidates[member])
                    .collect();
                let places: Vec<usize> = (0..members.len()).collect();
                Beside::new(&members, &self.rivals[place], &self.y, &self.active)
                    .products(power, &self.products.part(&model.set))
                    .fit(&places)
            }
        }
    }
}

fn same_span(one: &Candidate, other: &Candidate) -> bool {
    if one.block.len() != other.block.len() {
        return false;
    }
    let shared: f64 = one
        .block
        .iter()
        .flat_map(|a| other.block.iter().map(move |b| dot(a, b).powi(2)))
        .sum();
    shared > one.block.len() as f64 * (1.0 - SAME)
}

fn masked(block: &[Vec<f64>], active: &[bool]) -> Vec<Vec<f64>> {
    let mask = |column: &Vec<f64>| {
        column
            .iter()
            .zip(active)
            .map(|(&v, &used)| if used { v } else { 0.0 })
            .collect()
    };
    block.iter().map(mask).collect()
}

fn project(y: &[f64], active: &[bool], basis: &[Vec<f64>]) -> Vec<f64> {
    let mut left: Vec<f64> = y
        .iter()
        .zip(active)
        .map(|(&v, &used)| if used { v } else { 0.0 })
        .collect();
    for known in basis {
        let along = dot(known, &left);
        add_scaled(&mut left, -along, known);
    }
    left
}

/// How much of `left` (already projected) the columns explain beside the basis.
fn gain(columns: &[Vec<f64>], basis: &[Vec<f64>], left: &[f64]) -> f64 {
    let mut own: Vec<Vec<f64>> = Vec::new();
    let mut gain = 0.0;
    for column in columns {
        let full = dot(column, column);
        let mut rest = column.clone();
        for known in basis.iter().chain(&own) {
            let along = dot(known, &rest);
            add_scaled(&mut rest, -along, known);
        }
        let power = dot(&rest, &rest);
        if power > 1e-4 * full && power > 0.0 {
            gain += dot(&rest, left).powi(2) / power;
            let length = power.sqrt();
            scale(&mut rest, 1.0 / length);
            own.push(rest);
        }
    }
    gain
}

/// Place of the maximum of a unimodal function.
fn golden(mut low: f64, mut high: f64, quality: impl Fn(f64) -> f64) -> f64 {
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut qa, mut qb) = (quality(a), quality(b));
    for _ in 0..24 {
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
