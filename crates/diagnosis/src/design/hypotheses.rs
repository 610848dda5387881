//! The explanations that are still possible and what each predicts for imagined touches.
//!
//! The most probable models of the attribution; where a model's candidate has equals in this session, each of them; and
//! what a report names as indistinguishable. Every explanation is fitted anew on rows that include the imagined ones, so
//! that a direction the session could not see is free there. Beside something unknown a touch is predicted no better
//! than the rival's own spread. Metres; covariances in m².

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use super::imagined::Imagined;
use super::information::Prediction;
use crate::attribution::{Attribution, Model};
use crate::candidate::Candidate;
use crate::effects::Variant;
use crate::evidence::{Products, add_scaled};
use crate::report::Effect;

/// Models beyond this share of the posterior are left out.
const COVERED: f64 = 0.995;
/// Equals that one candidate is spread over.
const EQUALS: usize = 4;
/// Trials of a shape when it stands in for a named effect.
const TRIALS: usize = 12;
/// Predictions closer than this share of the noise are the same: eight touches would not tell.
const NOTHING: f64 = 0.5;
/// A stand-in this far (natural log) behind counts no further.
const FAR_BEHIND: f64 = 20.0;
/// A larger set names more than a smaller one within it only when it is this many times as probable.
const REFUTED: f64 = 10.0;
/// Explanations above this share of their class's strongest speak for the class.
const STRONG: f64 = 0.05;
/// Name of what the vocabulary does not know.
pub(crate) const UNKNOWN: &str = "unknown";

/// All explanations with their predictions.
#[derive(Debug, Default)]
pub(crate) struct Posterior {
    /// One for each explanation; weights sum to 1.
    pub(crate) predictions: Vec<Prediction>,
    /// Effects of each class, sorted; [`UNKNOWN`] among them.
    pub(crate) classes: Vec<Vec<String>>,
    /// Effects that no candidate touch parts, pairwise.
    pub(crate) equals: Vec<[String; 2]>,
}

impl Posterior {
    /// Makes one class of those that differ in one effect and in some way predict the same for every candidate.
    fn merge_equals(&mut self) {
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
                let same = strong(class).any(|a| strong(other).any(|b| predict_the_same(a, b)));
                same.then_some((other, [one, two]))
            });
            if let Some((other, names)) = equal {
                self.equals.push(names);
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

fn predict_the_same(one: &Prediction, other: &Prediction) -> bool {
    let bound = NOTHING * one.noise.min(other.noise).sqrt();
    let apart = one.mean.iter().zip(&other.mean).map(|(a, b)| (a - b).abs());
    apart.fold(0.0, f64::max) < bound
}

/// A variant at a shape, with or without the second order.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Member {
    variant: usize,
    shape: f64,
    bends: bool,
}

/// What the explanations are made from.
pub(crate) struct Source<'a> {
    /// Rows taken and imagined.
    pub(crate) imagined: &'a Imagined,
    /// The library.
    pub(crate) variants: &'a [Variant],
    /// The attribution of the rows taken.
    pub(crate) attribution: &'a Attribution,
}

impl Source<'_> {
    /// At most about `most` explanations; `set` holds the candidates of the first of the named `effects`.
    pub(crate) fn posterior(&self, set: &[usize], effects: &[Effect], most: usize) -> Posterior {
        let mut table = Table {
            source: self,
            y: self.imagined.spread(&self.attribution.y, 0.0),
            active: self.imagined.spread(&self.attribution.active, false),
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
                table.beside_unknown(model);
            } else {
                table.spread_over_equals(model);
            }
        }
        table.stand_ins(set, effects);
        let total: f64 = (table.posterior.predictions.iter())
            .map(|own| own.weight)
            .sum();
        for own in &mut table.posterior.predictions {
            own.weight /= total;
        }
        table.posterior.merge_equals();
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

    fn member(&self, place: usize) -> Member {
        let candidate = &self.attribution.candidates[place];
        Member {
            variant: candidate.variant,
            shape: candidate.shape,
            bends: candidate.bends,
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
        let key = (member.variant, member.shape.to_bits(), member.bends);
        let make = || {
            let rows = &source.imagined.observations;
            if member.bends {
                Candidate::bent(rows, source.variants, member.variant, member.shape)
            } else {
                Candidate::new(rows, source.variants, member.variant, member.shape)
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
        let places: Vec<usize> = (0..members.len()).collect();
        let fit = Products::new(&views, &self.y, &self.active).fit(&places)?;
        let columns: Vec<&[f64]> = blocks
            .iter()
            .flatten()
            .map(|column| self.ahead(column))
            .collect();
        let count = self.source.imagined.wanted.len();
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

    /// The imagined part of a column.
    fn ahead<'c>(&self, column: &'c [f64]) -> &'c [f64] {
        let imagined = self.source.imagined;
        &column[imagined.first..imagined.first + imagined.wanted.len()]
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

    /// A model, and the models with the equals of its candidates in their place.
    fn spread_over_equals(&mut self, model: &Model) {
        let mut sets: Vec<Vec<Member>> = vec![Vec::new()];
        for &place in &model.set {
            let own = self.source.member(place);
            let equals = self.source.attribution.aliases[place]
                .iter()
                .take(EQUALS)
                .map(|alias| Member {
                    variant: alias.variant,
                    shape: alias.shape,
                    bends: alias.bends,
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
                .take(EQUALS * EQUALS)
                .collect();
        }
        let weight = model.probability / sets.len() as f64;
        let small = simplest(self.source.attribution, model);
        for members in sets {
            if let Some((_, prediction)) = self.fit(&members) {
                // An effect that is not sure enough to be named makes no explanation of its own.
                let named: Vec<Member> = (members.iter().zip(&model.set))
                    .filter(|(_, place)| small.set.contains(place))
                    .map(|(member, _)| *member)
                    .collect();
                self.push(members, &named, weight, prediction);
            }
        }
    }

    /// A model beside a rival: its effects go on, the rival's part is as uncertain as the rival is large.
    fn beside_unknown(&mut self, model: &Model) {
        let source = self.source;
        let (Some((place, power)), Some(fit)) = (model.rival, source.attribution.fit(model)) else {
            return;
        };
        let count = source.imagined.wanted.len();
        let mut columns: Vec<Vec<f64>> = Vec::new();
        for &member in &model.set {
            let candidate = &source.attribution.candidates[member];
            let variant = &source.variants[candidate.variant];
            let rows = variant.columns(&source.imagined.observations, candidate.shape);
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
        let rival = &source.attribution.rivals[place];
        let rows = rival.rows().max(1) as f64;
        let spread = power * rival.trace() / rows;
        let small = simplest(source.attribution, model);
        let members: Vec<Member> = small
            .set
            .iter()
            .map(|&place| source.member(place))
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

    /// What a report names as indistinguishable, where no model has it yet.
    fn stand_ins(&mut self, set: &[usize], effects: &[Effect]) {
        let source = self.source;
        let attribution = source.attribution;
        let whole: Vec<Member> = set.iter().map(|&place| source.member(place)).collect();
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
        for (place, effect) in effects.iter().take(set.len()).enumerate() {
            for name in &effect.indistinguishable_from {
                let mut names: Vec<String> = source.names(&whole);
                names.retain(|known| *known != effect.effect);
                names.push(name.clone());
                names.sort();
                names.dedup();
                if self.posterior.classes.contains(&names) {
                    continue;
                }
                let mut best: Option<(f64, Vec<Member>, Prediction)> = None;
                for member in offers(source.variants, attribution, name) {
                    let mut members = whole.clone();
                    members[place] = member;
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

/// Ways in which an effect could stand in: linear variants, shapes the attribution found, and a few trials.
fn offers(variants: &[Variant], attribution: &Attribution, name: &str) -> Vec<Member> {
    let mut offers = Vec::new();
    for (variant, own) in variants.iter().enumerate() {
        if own.effect != name {
            continue;
        }
        let mut offer = |shape: f64| {
            offers.push(Member {
                variant,
                shape,
                bends: false,
            });
        };
        let Some(shape) = &own.shape else {
            offer(0.0);
            continue;
        };
        let found = (attribution.candidates.iter()).filter(|found| found.variant == variant);
        for candidate in found {
            offer(candidate.shape);
        }
        let stride = shape.trials.len().div_ceil(TRIALS).max(1);
        for &value in shape.trials.iter().step_by(stride) {
            offer(value);
        }
    }
    offers
}

/// The smallest explanation within a model that is not refuted by it.
fn simplest<'a>(attribution: &'a Attribution, model: &'a Model) -> &'a Model {
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
