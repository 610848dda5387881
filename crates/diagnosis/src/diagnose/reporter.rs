//! The report of an attribution: named effects, cross-validated reduction of the gap, localisation, next measurement.
//!
//! Names only what is probable enough, beside an unknown cause only what is nearly certain; reports equivalence classes, the
//! noise, and what the records show by themselves. Metres.

use std::collections::BTreeMap;

use effects::Variant;
use effects::observation::Observations;
use effects::session::Session;
use experiment::next::{Context, ProposalOptions, propose};
use experiment::proposal;
use inference::candidate::Candidate;
use inference::discrepancy::Kind;
use inference::linear::add_scaled;
use inference::posterior::Model;

use super::explain::{Explained, residuals};
use super::reported::Named;
use crate::attribution::blocks;
use crate::attribution::candidate_pool::Shapes;
use crate::attribution::unsupported::unsupported_effects;
use crate::report::residuals::{self, TouchResiduals};
use crate::report::{
    Effect, Gap, Level, Machine, NextMeasurement, Noise, Rejected, Report, SCHEMA, Unexplained,
    Verdict, declared, localisation, noise,
};

/// An unknown cause is reported only when it is this probable: the signatures are not exact either.
const SURELY_UNKNOWN: f64 = 0.9;
/// The same where at least two more effects would have to act together instead.
const PERHAPS_UNKNOWN: f64 = 0.2;
/// An effect is named only when its set is this many times as probable as the set without it.
pub(super) const REFUTED: f64 = 10.0;

/// The named effects leave more than the noise where the held-out rms is this many times as large.
const LEFT: f64 = 1.5;
/// Effects that are listed as rejected at most, those of a named group included.
const MAX_REJECTED: usize = 24;

/// The noise of the touches.
struct NoiseOf {
    /// Standard deviation, m.
    deviation: f64,
    /// By groups of touches.
    groups: Vec<Noise>,
}

/// A posterior and what its report needs.
pub(super) struct Reporter<'a> {
    pub(super) session: &'a Session,
    pub(super) next: ProposalOptions,
    pub(super) observations: &'a Observations,
    pub(super) variants: &'a [Variant],
    pub(super) shapes: &'a Shapes<'a>,
    pub(super) explained: &'a Explained,
    /// Rms below which a discrepancy may be the reference's own, m.
    pub(super) covered: f64,
}

impl Reporter<'_> {
    /// The candidates that are named, the report, and the residuals of every touch.
    pub(super) fn report(&self) -> (Vec<usize>, Report, TouchResiduals) {
        let attribution = &self.explained.attribution;
        let unknown: f64 = (0..attribution.models.len())
            .filter(|&model| self.is_unknown(model))
            .map(|model| attribution.models[model].probability)
            .sum();
        let touches = self.observations.deviations.iter();
        let gap = rms(touches.take(self.observations.touches()).copied());
        // A gap that the resolution alone makes has no other cause, and no stray touch: all of it is noise.
        let rounded = self.is_rounding(gap);
        let beside_unknown = !rounded && unknown > self.least_unknown();
        let best = self.best_model(beside_unknown).filter(|_| !rounded);
        let empty = Model {
            set: Vec::new(),
            discrepancy: None,
            probability: 0.0,
            log_posterior: 0.0,
        };
        let best = best.unwrap_or(&empty);
        let mut noise = self.noise(best);
        if rounded {
            noise.deviation = gap;
        }
        let (named, unsupported) = self.name_supported(best, beside_unknown, noise.deviation);
        let Named { mut effects, set } = named;
        // Where what is sure leaves far more than the noise, the rest is unknown, however unsure its kind.
        let left = effects.iter().rfind(|effect| effect.held_out);
        let unfinished = unknown > PERHAPS_UNKNOWN
            && left.is_some_and(|last| last.rms_after > LEFT * noise.deviation);
        let beside_unknown = beside_unknown || !unsupported.is_empty() || unfinished;
        let rounding = self.resolution(noise.deviation, &mut effects);
        self.records(noise.deviation, beside_unknown || rounded, &mut effects);
        let verdict = match (beside_unknown, effects.is_empty()) {
            (true, false) => Verdict::PartlyExplained,
            (true, true) => Verdict::Unexplained,
            (false, false) => Verdict::Explained,
            (false, true) => Verdict::NoGap,
        };
        let noise_floor = (noise.deviation.powi(2) - rounding * rounding)
            .max(0.0)
            .sqrt();
        let mut warnings = self.warnings();
        warnings.extend(noise::differing(&noise.groups));
        let report = Report {
            schema: SCHEMA.to_owned(),
            bag: self.session.name.clone(),
            fitted: Vec::new(),
            withheld: Vec::new(),
            measured: self.session.measured(),
            mount: None,
            machine: Some(Machine::of(
                &self.session.robot_description,
                self.observations.chain.name(),
            )),
            samples: self.observations.touches(),
            verdict,
            level: Level::default(),
            channel: "touch".to_owned(),
            gap: Gap {
                unit: "m".to_owned(),
                rms: gap,
                noise_floor,
                ratio: if noise_floor > 0.0 {
                    gap / noise_floor
                } else {
                    0.0
                },
            },
            noise: noise.groups,
            place: localisation::shares(
                self.observations,
                &self.observations.deviations,
                &attribution.active,
            ),
            unexplained: self.unexplained(beside_unknown, best, (&set, &unsupported), gap),
            rejected: self.rejected(&set),
            next_measurement: self.next_measurement(&set, &effects),
            declared: declared::compare_with_promise(
                self.session,
                self.observations,
                &attribution.active,
            ),
            effects,
            durations: None,
            measurements: None,
            warnings,
        };
        let residuals = self.residuals(&set);
        (
            set,
            report.with_joint_zeros(&self.observations.chain).finished(),
            residuals,
        )
    }

    /// The noise beside a model, of all touches and of groups of them.
    fn noise(&self, best: &Model) -> NoiseOf {
        let attribution = &self.explained.attribution;
        let fit = attribution.fit(best);
        let uneven = attribution.widening(best);
        let widened = uneven.as_ref().map_or(1.0, |of| rms(of.iter().copied()));
        let discrepancy = (best.discrepancy)
            .map(|(index, power)| attribution.discrepancies[index].effective_dof(power));
        let fitted = discrepancy.filter(|_| uneven.is_none()).unwrap_or(0.0)
            + (fit.as_ref()).map_or(0.0, |fit| fit.coefficients.len() as f64);
        let residuals = if uneven.is_some() {
            attribution
                .residuals(best)
                .unwrap_or_else(|| attribution.y.clone())
        } else {
            residuals(attribution, best)
        };
        NoiseOf {
            deviation: (fit.as_ref()).map_or(0.0, |fit| fit.variance.sqrt() * widened),
            groups: noise::floors(self.observations, &residuals, &attribution.active, fitted),
        }
    }

    /// Named effects, and the members of the best model that are rejected as unsupported.
    fn name_supported(
        &self,
        best: &Model,
        beside_unknown: bool,
        noise: f64,
    ) -> (Named, Vec<usize>) {
        let named = self.name(best, &[], beside_unknown, noise);
        // Beside an unknown cause cross-validation does not judge an effect.
        if beside_unknown {
            return (named, Vec::new());
        }
        let attribution = &self.explained.attribution;
        let mut set = named.set.clone();
        set.sort_unstable();
        let unsupported = unsupported_effects(self.observations, attribution, &set, noise);
        if unsupported.is_empty() {
            return (named, unsupported);
        }
        (self.name(best, &unsupported, true, noise), unsupported)
    }

    fn warnings(&self) -> Vec<String> {
        let skipped = self.observations.skipped.iter();
        let mut warnings: Vec<String> = skipped
            .map(|(sequence, why)| format!("event {sequence} not used: {why}"))
            .collect();
        let rejected = self.explained.rejected.len();
        if rejected > 0 {
            warnings.push(format!("{rejected} touches rejected as outliers"));
        }
        warnings
    }

    /// Held-out residuals of the touches without any effect and with the named ones.
    fn residuals(&self, set: &[usize]) -> TouchResiduals {
        let attribution = &self.explained.attribution;
        let blocks = blocks(self.observations, &attribution.active);
        let candidates: Vec<&Candidate> = (set.iter())
            .map(|&member| &attribution.candidates[member])
            .collect();
        let after = blocks.residuals(&candidates, &attribution.y, &attribution.active);
        let weight = |row: usize| self.observations.rows[row].weight;
        let touches = residuals::touches(
            self.observations,
            "touches against the model",
            vec![self.session.name.clone()],
            |_| Some(0),
            |row| attribution.y[row] / weight(row),
            |row| after[row].map(|value| value / weight(row)),
        );
        TouchResiduals {
            lag1_correlation: attribution.lag1_correlation,
            ..touches
        }
    }

    /// The sets with or without an unknown cause, whatever its kind and the noise: the probability of each, and its best model.
    fn sets(&self, unknown: bool) -> BTreeMap<&[usize], (f64, &Model)> {
        let models = &self.explained.attribution.models;
        let mut sets: BTreeMap<&[usize], (f64, &Model)> = BTreeMap::new();
        for (index, model) in models.iter().enumerate() {
            if self.is_unknown(index) == unknown {
                sets.entry(&model.set).or_insert((0.0, model)).0 += model.probability;
            }
        }
        sets
    }

    /// The best model of the most probable set, or of a smaller one that is not yet refuted by [`REFUTED`] against a larger: a
    /// false positive costs more than a false negative.
    fn best_model(&self, unknown: bool) -> Option<&Model> {
        let sets = self.sets(unknown);
        let mut best = (sets.values()).max_by(|a, b| a.0.total_cmp(&b.0))?;
        let smaller = |than: &(f64, &Model)| {
            let fewer = (sets.values()).filter(|other| other.1.set.len() < than.1.set.len());
            let likely = fewer.filter(|other| other.0 * REFUTED > than.0);
            likely.max_by(|a, b| a.0.total_cmp(&b.0))
        };
        while let Some(other) = smaller(best) {
            best = other;
        }
        Some(best.1)
    }

    /// Least probability at which an unknown cause is reported: lower where many effects are needed to imitate it.
    fn least_unknown(&self) -> f64 {
        let size = |unknown: bool| {
            let models = &self.explained.attribution.models;
            (0..models.len())
                .find(|&model| self.is_unknown(model) == unknown)
                .map_or(0, |model| models[model].set.len())
        };
        if size(false) > size(true) + 1 {
            PERHAPS_UNKNOWN
        } else {
            SURELY_UNKNOWN
        }
    }

    /// True for a model with a discrepancy that neither the vocabulary nor the uncertainty of the reference explains.
    fn is_unknown(&self, model: usize) -> bool {
        let attribution = &self.explained.attribution;
        if !attribution.is_unknown(&attribution.models[model]) {
            return false;
        }
        let covered = |(_, part): (Kind, Vec<f64>)| rms(part.into_iter()) <= self.covered;
        !(self.covered > 0.0
            && localisation::discrepancy_part(attribution, model).is_some_and(covered))
    }

    /// Kind of the discrepancy of a model.
    pub(super) fn kind_of(&self, model: &Model) -> Option<&Kind> {
        let (index, _) = model.discrepancy?;
        Some(&self.explained.attribution.discrepancies[index].kind)
    }

    fn next_measurement(&self, set: &[usize], effects: &[Effect]) -> Vec<NextMeasurement> {
        let known = Context {
            plan: self.session.plan.as_ref(),
            observations: self.observations,
            variants: self.variants,
            attribution: &self.explained.attribution,
        };
        let named: Vec<_> = effects.iter().map(named).collect();
        propose(&known, set, &named, self.next)
    }

    /// The unexplained part, at most the gap of `gap` (m): effects and discrepancy may cancel one another.
    fn unexplained(
        &self,
        beside_unknown: bool,
        best: &Model,
        (named, unsupported): (&[usize], &[usize]),
        gap: f64,
    ) -> Unexplained {
        let attribution = &self.explained.attribution;
        let touches = |part: &[f64]| {
            let touches = part.iter().take(self.observations.touches());
            rms(touches.copied()).min(gap)
        };
        if let Some(part) = self.part_of(best, unsupported) {
            return Unexplained {
                rms: touches(&part),
                place: localisation::of_part(self.observations, &part, &attribution.active),
                ladder: self.ladder(named, gap),
            };
        }
        if !beside_unknown {
            return Unexplained {
                rms: 0.0,
                place: Vec::new(),
                ladder: Vec::new(),
            };
        }
        let mut all = Vec::new();
        let mut size = 0.0;
        let mut kinds: Vec<Kind> = Vec::new();
        for (index, model) in attribution.models.iter().enumerate().take(200) {
            let Some((number, _)) = model.discrepancy else {
                continue;
            };
            let kind = attribution.discrepancies[number].kind.clone();
            if !attribution.is_unknown(model) || kinds.contains(&kind) {
                continue;
            }
            let share: f64 = attribution
                .models
                .iter()
                .filter(|model| {
                    model
                        .discrepancy
                        .is_some_and(|(index, _)| attribution.discrepancies[index].kind == kind)
                })
                .map(|model| model.probability)
                .sum();
            if share < 0.05 {
                continue;
            }
            if let Some((kind, part)) = localisation::discrepancy_part(attribution, index) {
                if kinds.is_empty() {
                    size = touches(&part);
                }
                all.extend(localisation::of_discrepancy(
                    self.observations,
                    &kind,
                    &part,
                    share,
                ));
                kinds.push(kind);
            }
        }
        Unexplained {
            rms: size,
            place: all,
            ladder: self.ladder(named, gap),
        }
    }

    /// Weighted deviations that some members of a model predict; `None` for no members.
    fn part_of(&self, model: &Model, members: &[usize]) -> Option<Vec<f64>> {
        let attribution = &self.explained.attribution;
        let fit = attribution.fit(model).filter(|_| !members.is_empty())?;
        let mut part = vec![0.0; attribution.y.len()];
        for (member, candidate, coefficients) in attribution.members(model, &fit) {
            if members.contains(&member) {
                add_scaled(&mut part, 1.0, &candidate.signature(coefficients));
            }
        }
        Some(part)
    }

    fn rejected(&self, named: &[usize]) -> Vec<Rejected> {
        let attribution = &self.explained.attribution;
        let names: Vec<&String> = named
            .iter()
            .map(|&member| &self.variants[attribution.candidates[member].variant].effect)
            .collect();
        let mut rejected: Vec<Rejected> = Vec::new();
        for variant in self.variants {
            if names.contains(&&variant.effect)
                || rejected.iter().any(|known| known.effect == variant.effect)
            {
                continue;
            }
            let probability = self.probability(std::iter::once(&variant.effect));
            rejected.push(Rejected {
                effect: variant.effect.clone(),
                probability,
                reason: None,
            });
        }
        rejected.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        rejected.truncate(MAX_REJECTED);
        rejected
    }
}

fn named(effect: &Effect) -> proposal::Named<'_> {
    proposal::Named {
        effect: &effect.effect,
        indistinguishable_from: &effect.indistinguishable_from,
    }
}

pub(super) fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| {
        (sum + value * value, count + 1.0)
    });
    if count > 0.0 {
        (sum / count).sqrt()
    } else {
        0.0
    }
}
