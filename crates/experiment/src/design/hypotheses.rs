//! The remaining explanations and the prediction of each for candidate touches.
//!
//! The most probable models of the attribution; where a candidate of a model has aliases in this session, each of them; and
//! the effects that a report names as indistinguishable. Every explanation is fitted anew on rows that include the
//! candidate touches, so that a direction that the session could not observe is free there. With a discrepancy the prediction
//! has at least the standard deviation of its process. Metres; covariances in m².

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use super::extended_rows::ExtendedRows;
use super::information::Prediction;
use crate::proposal::Named;
use effects::{Variant, candidate, second_order_candidate};
use inference::candidate::Candidate;
use inference::evidence::InnerProducts;
use inference::linear::add_scaled;
use inference::posterior::{Model, ModelPosterior};

/// Models beyond this share of the posterior are left out.
const COVERED: f64 = 0.995;
/// Aliases over which the probability of a candidate is distributed.
const ALIASES: usize = 4;
/// Trials of a shape when it stands in for a named effect.
const TRIALS: usize = 12;
/// Predictions that differ by less than this share of the noise are indistinguishable: eight touches would not decide.
const NOTHING: f64 = 0.5;
/// A substitute loses at most this much log evidence.
const FAR_BEHIND: f64 = 20.0;
/// A larger set is preferred to a smaller one within it only when it is this many times as probable.
const REFUTED: f64 = 10.0;
/// Explanations above this share of the strongest of their class represent the class.
const STRONG: f64 = 0.05;
/// Identifier of a cause outside the vocabulary.
pub(crate) const UNKNOWN: &str = "unknown";

/// All explanations with their predictions.
#[derive(Debug, Default)]
pub(crate) struct Posterior {
    /// One for each explanation; weights sum to 1.
    pub(crate) predictions: Vec<Prediction>,
    /// Effects of each class, sorted; [`UNKNOWN`] among them.
    pub(crate) classes: Vec<Vec<String>>,
    /// Pairs of effects that no candidate touch discriminates.
    pub(crate) indistinguishable: Vec<[String; 2]>,
}

impl Posterior {
    /// Merges classes that differ in one effect and have explanations with indistinguishable predictions.
    fn merge_indistinguishable(&mut self) {
        for class in (1..self.classes.len()).rev() {
            let equal = (0..class).find_map(|other| {
                let [one, two] = swapped(&self.classes[class], &self.classes[other])?;
                let strong = |class: usize| {
                    let own = || {
                        self.predictions
                            .iter()
                            .filter(move |own| own.class == class)
                    };
                    let most = own().map(|own| own.weight).fold(0.0, f64::max);
                    own().filter(move |own| own.weight > STRONG * most)
                };
                let same = strong(class)
                    .any(|a| strong(other).any(|b| indistinguishable_predictions(a, b)));
                same.then_some((other, [one, two]))
            });
            if let Some((other, names)) = equal {
                // Sets of several effects meet in the same pair again.
                let known = |pair: &[String; 2]| names.iter().all(|name| pair.contains(name));
                if !self.indistinguishable.iter().any(known) {
                    self.indistinguishable.push(names);
                }
                for own in self.predictions.iter_mut().filter(|own| own.class == class) {
                    own.class = other;
                }
            }
        }
        // Classes that lost their explanations stay as empty names of no weight: numbers do not change.
    }
}

/// The two effects in which two sets differ, when they differ in one each.
fn swapped(one: &[String], other: &[String]) -> Option<[String; 2]> {
    let mut own = one.iter().filter(|name| !other.contains(name));
    let mut its = other.iter().filter(|name| !one.contains(name));
    let pair = [own.next()?.clone(), its.next()?.clone()];
    let unknown = pair.iter().any(|name| name == UNKNOWN);
    (own.next().is_none() && its.next().is_none() && !unknown).then_some(pair)
}

fn indistinguishable_predictions(one: &Prediction, other: &Prediction) -> bool {
    let bound = NOTHING * one.noise.min(other.noise).sqrt();
    let apart = one.mean.iter().zip(&other.mean).map(|(a, b)| (a - b).abs());
    apart.fold(0.0, f64::max) < bound
}

/// A variant at a shape, with or without the second order.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Member {
    variant: usize,
    shape: f64,
    second_order: bool,
}

/// What the explanations are made from.
pub(crate) struct Source<'a> {
    /// Rows of the touches taken, extended by the candidates.
    pub(crate) extended: &'a ExtendedRows,
    /// The library.
    pub(crate) variants: &'a [Variant],
    /// The attribution of the rows taken.
    pub(crate) attribution: &'a ModelPosterior,
}

impl Source<'_> {
    /// At most about `most` explanations; `set` holds the candidates of the first of the named `effects`.
    pub(crate) fn posterior(&self, set: &[usize], effects: &[Named<'_>], most: usize) -> Posterior {
        let mut table = Table {
            source: self,
            y: self.extended.fill(&self.attribution.y, 0.0),
            active: self.extended.fill(&self.attribution.active, false),
            cache: BTreeMap::new(),
            posterior: Posterior::default(),
            known: Vec::new(),
        };
        let mut covered = 0.0;
        for model in &self.attribution.models {
            if covered > COVERED || table.posterior.predictions.len() >= most {
                break;
            }
            covered += model.probability;
            if self.attribution.is_unknown(model) {
                table.add_with_discrepancy(model);
            } else {
                table.add_with_aliases(model);
            }
        }
        table.add_equivalents(set, effects);
        let total: f64 = (table.posterior.predictions.iter())
            .map(|own| own.weight)
            .sum();
        for own in &mut table.posterior.predictions {
            own.weight /= total;
        }
        table.posterior.merge_indistinguishable();
        table.posterior
    }

    fn names(&self, members: &[Member]) -> Vec<String> {
        let mut names: Vec<String> = members
            .iter()
            .map(|member| self.variants[member.variant].effect.clone())
            .collect();
        names.sort();
        names.dedup();
        names
    }

    fn member(&self, index: usize) -> Member {
        let candidate = &self.attribution.candidates[index];
        Member {
            variant: candidate.variant,
            shape: candidate.shape,
            second_order: candidate.second_order,
        }
    }
}

struct Table<'a> {
    source: &'a Source<'a>,
    y: Vec<f64>,
    active: Vec<bool>,
    cache: BTreeMap<(usize, u64, bool), Option<Candidate>>,
    posterior: Posterior,
    known: Vec<Vec<Member>>,
}

impl Table<'_> {
    fn class(&mut self, names: Vec<String>) -> usize {
        let classes = &mut self.posterior.classes;
        classes
            .iter()
            .position(|known| *known == names)
            .unwrap_or_else(|| {
                classes.push(names);
                classes.len() - 1
            })
    }

    fn candidate(&mut self, member: Member) -> Option<&Candidate> {
        let source = self.source;
        let key = (member.variant, member.shape.to_bits(), member.second_order);
        let make = || {
            let rows = &source.extended.observations;
            if member.second_order {
                second_order_candidate(rows, source.variants, member.variant, member.shape)
            } else {
                candidate(rows, source.variants, member.variant, member.shape)
            }
        };
        self.cache.entry(key).or_insert_with(make).as_ref()
    }

    /// Log evidence (with the members' own priors) and prediction of a set; `None` where it cannot be solved.
    fn fit(&mut self, members: &[Member]) -> Option<(f64, Prediction)> {
        let mut blocks: Vec<Vec<Vec<f64>>> = Vec::with_capacity(members.len());
        let mut prior = 0.0;
        for &member in members {
            let candidate = self.candidate(member)?;
            prior += candidate.log_prior;
            blocks.push(candidate.block.clone());
        }
        let views: Vec<&[Vec<f64>]> = blocks.iter().map(Vec::as_slice).collect();
        let all: Vec<usize> = (0..members.len()).collect();
        let fit = InnerProducts::new(&views, &self.y, &self.active).fit(&all)?;
        let columns: Vec<&[f64]> = blocks
            .iter()
            .flatten()
            .map(|column| self.ahead(column))
            .collect();
        let count = self.source.extended.wanted.len();
        let mut mean = vec![0.0; count];
        for (column, coefficient) in columns.iter().zip(&fit.coefficients) {
            add_scaled(&mut mean, *coefficient, column);
        }
        let covariance = carried(&columns, &fit.covariance, fit.variance, count);
        Some((
            fit.log_evidence + prior,
            Prediction {
                weight: 0.0,
                class: 0,
                mean,
                covariance,
                noise: fit.variance,
            },
        ))
    }

    /// The candidate rows of a column.
    fn ahead<'c>(&self, column: &'c [f64]) -> &'c [f64] {
        let extended = self.source.extended;
        &column[extended.first..extended.first + extended.wanted.len()]
    }

    /// Adds an explanation; `named` are those of its members that would be named.
    fn push(
        &mut self,
        members: Vec<Member>,
        named: &[Member],
        weight: f64,
        prediction: Prediction,
    ) {
        let class = self.class(self.source.names(named));
        self.posterior.predictions.push(Prediction {
            weight,
            class,
            ..prediction
        });
        self.known.push(members);
    }

    /// Adds a model, and the models with the aliases of its candidates in their place.
    fn add_with_aliases(&mut self, model: &Model) {
        let mut sets: Vec<Vec<Member>> = vec![Vec::new()];
        for &index in &model.set {
            let own = self.source.member(index);
            let equals = self.source.attribution.aliases[index]
                .iter()
                .take(ALIASES)
                .map(|alias| Member {
                    variant: alias.variant,
                    shape: alias.shape,
                    second_order: alias.second_order,
                });
            let choices: Vec<Member> = std::iter::once(own).chain(equals).collect();
            sets = sets
                .iter()
                .flat_map(|set| {
                    choices.iter().map(|&choice| {
                        let mut longer = set.clone();
                        longer.push(choice);
                        longer
                    })
                })
                .take(ALIASES * ALIASES)
                .collect();
        }
        let weight = model.probability / sets.len() as f64;
        let small = simplest(self.source.attribution, model);
        for members in sets {
            if let Some((_, prediction)) = self.fit(&members) {
                // An effect that is not sure enough to be named makes no explanation of its own.
                let named: Vec<Member> = (members.iter().zip(&model.set))
                    .filter(|(_, index)| small.set.contains(index))
                    .map(|(member, _)| *member)
                    .collect();
                self.push(members, &named, weight, prediction);
            }
        }
    }

    /// Adds a model with a discrepancy: its effects are extrapolated, the discrepancy adds its mean variance.
    fn add_with_discrepancy(&mut self, model: &Model) {
        let source = self.source;
        let (Some((index, power)), Some(fit)) = (model.discrepancy, source.attribution.fit(model))
        else {
            return;
        };
        let count = source.extended.wanted.len();
        let mut columns: Vec<Vec<f64>> = Vec::new();
        for &member in &model.set {
            let candidate = &source.attribution.candidates[member];
            let variant = &source.variants[candidate.variant];
            let rows = variant.columns(&source.extended.observations, candidate.shape);
            for column in 0..candidate.block.len() {
                let mut ahead = vec![0.0; count];
                for (parameter, row) in rows.iter().enumerate() {
                    let share = candidate.parameters_from_block[(parameter, column)];
                    add_scaled(&mut ahead, share, self.ahead(&row.signature));
                }
                columns.push(ahead);
            }
        }
        let mut mean = vec![0.0; count];
        for (column, coefficient) in columns.iter().zip(&fit.coefficients) {
            add_scaled(&mut mean, *coefficient, column);
        }
        let views: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let discrepancy = &source.attribution.discrepancies[index];
        let rows = discrepancy.rows().max(1) as f64;
        let spread = power * discrepancy.trace() / rows;
        let small = simplest(source.attribution, model);
        let members: Vec<Member> = small
            .set
            .iter()
            .map(|&index| source.member(index))
            .collect();
        let mut names = source.names(&members);
        names.push(UNKNOWN.to_owned());
        let class = self.class(names);
        self.posterior.predictions.push(Prediction {
            weight: model.probability,
            class,
            mean,
            covariance: carried(&views, &fit.covariance, fit.variance, count),
            noise: fit.variance * (1.0 + spread),
        });
        self.known.push(Vec::new());
    }

    /// Adds the effects that a report names as indistinguishable, where no model has them yet.
    fn add_equivalents(&mut self, set: &[usize], effects: &[Named<'_>]) {
        let source = self.source;
        let attribution = source.attribution;
        let whole: Vec<Member> = set.iter().map(|&index| source.member(index)).collect();
        let sum: f64 = (self.known.iter().zip(&self.posterior.predictions))
            .filter(|(known, _)| same(known, &whole))
            .map(|(_, own)| own.weight)
            .sum();
        let Some((base, prediction)) = self.fit(&whole).filter(|_| !whole.is_empty()) else {
            return;
        };
        let weight = if sum > 0.0 {
            sum
        } else {
            self.push(whole.clone(), &whole, 0.05, prediction);
            0.05
        };
        for (index, effect) in effects.iter().take(set.len()).enumerate() {
            for name in effect.indistinguishable_from {
                let mut names: Vec<String> = source.names(&whole);
                names.retain(|known| known != effect.effect);
                names.push(name.clone());
                names.sort();
                names.dedup();
                if self.posterior.classes.contains(&names) {
                    continue;
                }
                let mut best: Option<(f64, Vec<Member>, Prediction)> = None;
                for member in substitutes(source.variants, attribution, name) {
                    let mut members = whole.clone();
                    members[index] = member;
                    if let Some((score, prediction)) = self.fit(&members)
                        && best.as_ref().is_none_or(|known| score > known.0)
                    {
                        best = Some((score, members, prediction));
                    }
                }
                if let Some((score, members, prediction)) = best {
                    let share = weight * (score - base).clamp(-FAR_BEHIND, 0.0).exp();
                    self.push(members.clone(), &members, share, prediction);
                }
            }
        }
    }
}

/// Variants and shapes with which an effect could substitute another: linear ones, shapes of the attribution, a few trials.
fn substitutes(variants: &[Variant], attribution: &ModelPosterior, name: &str) -> Vec<Member> {
    let mut substitutes = Vec::new();
    for (variant, own) in variants.iter().enumerate() {
        if own.effect != name {
            continue;
        }
        let mut substitute = |shape: f64| {
            substitutes.push(Member {
                variant,
                shape,
                second_order: false,
            });
        };
        let Some(shape) = &own.shape else {
            substitute(0.0);
            continue;
        };
        let found = (attribution.candidates.iter()).filter(|found| found.variant == variant);
        for candidate in found {
            substitute(candidate.shape);
        }
        let stride = shape.trials.len().div_ceil(TRIALS).max(1);
        for &value in shape.trials.iter().step_by(stride) {
            substitute(value);
        }
    }
    substitutes
}

/// The smallest model within a model that is not refuted by it.
fn simplest<'a>(attribution: &'a ModelPosterior, model: &'a Model) -> &'a Model {
    let mut best = model;
    while let Some(smaller) = attribution.models.iter().find(|other| {
        attribution.is_unknown(other) == attribution.is_unknown(best)
            && other.set.len() < best.set.len()
            && other.set.iter().all(|member| best.set.contains(member))
            && other.probability * REFUTED > best.probability
    }) {
        best = smaller;
    }
    best
}

fn same(one: &[Member], other: &[Member]) -> bool {
    one.len() == other.len() && one.iter().all(|member| other.contains(member))
}

/// Covariance of predictions from that of the coefficients (over the variance), row-major.
fn carried(columns: &[&[f64]], covariance: &[f64], variance: f64, count: usize) -> Vec<f64> {
    let width = columns.len();
    let map = DMatrix::from_fn(count, width, |row, column| columns[column][row]);
    let inner = DMatrix::from_row_slice(width, width, &covariance[..width * width]) * variance;
    let full = &map * inner * map.transpose();
    full.as_slice().to_vec()
}
