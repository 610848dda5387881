//! The report of an explanation: what is named, how far the gap shrinks, where it lies, what to measure next.
//!
//! Names only what is probable enough, beside something unknown only what is nearly certain; tells what cannot be told
//! apart, the noise, and what the records show by themselves. Metres.

use std::collections::BTreeMap;

use super::{Explained, residuals};
use crate::alternatives;
use crate::attribution::{Attribution, Model};
use crate::candidate::Candidate;
use crate::declared;
use crate::effects::Variant;
use crate::evidence::add_scaled;
use crate::groups::{indistinguishable, signature};
use crate::next::{Known, Wish, propose};
use crate::observation::Observations;
use crate::pool::Shapes;
use crate::report::{
    Effect, Gap, Machine, NextMeasurement, ParameterEstimate, Rejected, Report, SCHEMA,
    Unexplained, Verdict,
};
use crate::residuals::{self, TouchResiduals};
use crate::rivals::Kind;
use crate::session::Session;
use crate::shrinkage::Blocks;
use crate::{noise, parameters, places, support, timing};

/// Beside something unknown an effect is named only when it is this probable.
const SURE_BESIDE_UNKNOWN: f64 = 0.99;
/// Something unknown is told of only when it is this probable: the signatures are not exact either.
const SURELY_UNKNOWN: f64 = 0.9;
/// The same where at least two more effects would have to act together in its place.
const PERHAPS_UNKNOWN: f64 = 0.2;
/// An effect that the others can replace to within half the noise is named only when it is this probable.
const SURE_THOUGH_REPLACEABLE: f64 = 0.993;
/// An effect is named only when its set is this many times as probable as the set without it.
const REFUTED: f64 = 10.0;
/// A grid is named when it makes at least this share of the noise variance.
const GRID_SHARE: f64 = 0.2;

/// A member of an explanation, to be named or not.
struct Offered {
    member: usize,
    name: String,
    /// That it or one of its equals acts.
    probability: f64,
    equals: Vec<String>,
    /// Root mean square of what it adds to the deviations, m.
    size: f64,
    /// Probable enough to be named by itself.
    sure: bool,
}

/// An explanation and what it is of.
pub(super) struct Reporter<'a> {
    pub(super) session: &'a Session,
    pub(super) next: Wish,
    pub(super) observations: &'a Observations,
    pub(super) variants: &'a [Variant],
    pub(super) shapes: &'a Shapes<'a>,
    pub(super) explained: &'a Explained,
    /// Rms below which a discrepancy may be the reference's own, m.
    pub(super) covered: f64,
}

impl Reporter<'_> {
    /// The report, and what every touch misses the model by.
    pub(super) fn report(&self) -> (Report, TouchResiduals) {
        let attribution = &self.explained.attribution;
        let unknown: f64 = (0..attribution.models.len())
            .filter(|&model| self.is_unknown(model))
            .map(|model| attribution.models[model].probability)
            .sum();
        let beside_unknown = unknown > self.least_unknown();
        let best = self.most_probable(beside_unknown);
        let empty = Model {
            set: Vec::new(),
            rival: None,
            probability: 0.0,
            score: 0.0,
        };
        let best = simplest(attribution, best.unwrap_or(&empty));
        let fit = attribution.fit(best);
        let uneven = attribution.widening(best);
        let widened = uneven.as_ref().map_or(1.0, |of| rms(of.iter().copied()));
        let noise = (fit.as_ref()).map_or(0.0, |fit| fit.variance.sqrt() * widened);
        let (mut effects, mut set) = self.effects(best, &[], beside_unknown, noise);
        // Beside something unknown the touches cannot tell what an effect is worth.
        let mut doubted = Vec::new();
        if !beside_unknown {
            let mut named = set.clone();
            named.sort_unstable();
            doubted = support::doubted(self.observations, attribution, &named, noise);
        }
        let beside_unknown = beside_unknown || !doubted.is_empty();
        if !doubted.is_empty() {
            (effects, set) = self.effects(best, &doubted, beside_unknown, noise);
        }
        let grid = self.grid(best, noise, &mut effects);
        self.records(noise, beside_unknown, &mut effects);
        let named = !effects.is_empty();
        let verdict = match (beside_unknown, named) {
            (true, true) => Verdict::PartlyExplained,
            (true, false) => Verdict::Unexplained,
            (false, true) => Verdict::Explained,
            (false, false) => Verdict::NoGap,
        };
        let rms = rms(self
            .observations
            .deviations
            .iter()
            .take(self.observations.touches())
            .copied());
        let noise_floor = (noise * noise - grid * grid).max(0.0).sqrt();
        let mut warnings: Vec<String> = self
            .observations
            .skipped
            .iter()
            .map(|(sequence, why)| format!("event {sequence} not used: {why}"))
            .collect();
        if !self.explained.stray.is_empty() {
            warnings.push(format!(
                "{} touches set aside as stray",
                self.explained.stray.len()
            ));
        }
        let of_rival = (best.rival).map(|(place, power)| attribution.rivals[place].taken(power));
        let taken = of_rival.filter(|_| uneven.is_none()).unwrap_or(0.0)
            + (fit.as_ref()).map_or(0.0, |fit| fit.coefficients.len() as f64);
        let left = if uneven.is_some() {
            attribution
                .left(best)
                .unwrap_or_else(|| attribution.y.clone())
        } else {
            residuals(attribution, best)
        };
        let noise_of = noise::floors(self.observations, &left, &attribution.active, taken);
        warnings.extend(noise::differing(&noise_of));
        let report = Report {
            schema: SCHEMA.to_owned(),
            bag: self.session.name.clone(),
            fitted: Vec::new(),
            withheld: Vec::new(),
            measured: self.session.measured(),
            machine: Some(Machine::of(
                &self.session.robot_description,
                self.observations.chain.name(),
            )),
            samples: self.observations.touches(),
            verdict,
            gap: Gap {
                unit: "m".to_owned(),
                rms,
                noise_floor,
                ratio: if noise_floor > 0.0 {
                    rms / noise_floor
                } else {
                    0.0
                },
            },
            noise: noise_of,
            place: places::shares(
                self.observations,
                &self.observations.deviations,
                &attribution.active,
            ),
            unexplained: self.unexplained(beside_unknown, best, &doubted, rms),
            rejected: self.rejected(&set),
            next_measurement: self.next_measurement(&set, &effects),
            declared: declared::told(self.session, self.observations, &attribution.active),
            effects,
            warnings,
        };
        (report, self.residuals(&set))
    }

    /// Held-out residuals of the touches without any effect and with the named ones.
    fn residuals(&self, set: &[usize]) -> TouchResiduals {
        let attribution = &self.explained.attribution;
        let blocks = Blocks::new(self.observations, &attribution.active);
        let candidates: Vec<&Candidate> = (set.iter())
            .map(|&member| &attribution.candidates[member])
            .collect();
        let after = blocks.residuals(&candidates, &attribution.y, &attribution.active);
        let weight = |row: usize| self.observations.rows[row].weight;
        residuals::touches(
            self.observations,
            "touches against the model",
            vec![self.session.name.clone()],
            |_| Some(0),
            |row| attribution.y[row] / weight(row),
            |row| after[row].map(|value| value / weight(row)),
        )
    }

    /// The best model of the set that is most probable, whatever the noise, among those with or without something unknown.
    fn most_probable(&self, unknown: bool) -> Option<&Model> {
        let models = &self.explained.attribution.models;
        let mut sets: BTreeMap<&[usize], (f64, &Model)> = BTreeMap::new();
        for (place, model) in models.iter().enumerate() {
            if self.is_unknown(place) == unknown {
                sets.entry(&model.set).or_insert((0.0, model)).0 += model.probability;
            }
        }
        (sets.into_values())
            .max_by(|one, other| one.0.total_cmp(&other.0))
            .map(|(_, model)| model)
    }

    /// True where it is improbable that nothing acts.
    fn something_acts(&self) -> bool {
        let models = self.explained.attribution.models.iter();
        let nothing: f64 = models
            .filter(|model| model.set.is_empty())
            .map(|model| model.probability)
            .sum();
        nothing * REFUTED < 1.0
    }

    /// How probable something unknown must be to be told of: where it takes many effects to imitate it, less is enough.
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

    /// True for a model beside something that neither the vocabulary nor the reference's own uncertainty explains.
    fn is_unknown(&self, model: usize) -> bool {
        let attribution = &self.explained.attribution;
        if !attribution.is_unknown(&attribution.models[model]) {
            return false;
        }
        let covered = |(_, part): (Kind, Vec<f64>)| rms(part.into_iter()) <= self.covered;
        !(self.covered > 0.0 && places::rival_part(attribution, model).is_some_and(covered))
    }

    /// What a model is beside.
    fn kind_of(&self, model: &Model) -> Option<&Kind> {
        let (place, _) = model.rival?;
        Some(&self.explained.attribution.rivals[place].kind)
    }

    fn next_measurement(&self, set: &[usize], effects: &[Effect]) -> Vec<NextMeasurement> {
        let known = Known {
            plan: self.session.plan.as_ref(),
            observations: self.observations,
            variants: self.variants,
            attribution: &self.explained.attribution,
        };
        propose(&known, set, effects, self.next)
    }

    /// Named effects in the order in which they close the gap, and their candidates.
    ///
    /// What is `doubted` of the best explanation is left unnamed.
    fn effects(
        &self,
        best: &Model,
        doubted: &[usize],
        beside_unknown: bool,
        noise: f64,
    ) -> (Vec<Effect>, Vec<usize>) {
        let attribution = &self.explained.attribution;
        let Some(fit) = attribution.fit(best) else {
            return (Vec::new(), Vec::new());
        };
        let mut members = Vec::new();
        let mut start = 0;
        for &member in &best.set {
            let candidate = &attribution.candidates[member];
            let own = &fit.coefficients[start..start + candidate.block.len()];
            start += candidate.block.len();
            if doubted.contains(&member) {
                continue;
            }
            let equals = indistinguishable(self.shapes, attribution, &best.set, member, own, noise);
            let name = self.variants[candidate.variant].effect.clone();
            let probability = self.probability(std::iter::once(&name).chain(&equals.names));
            let least = match (beside_unknown, equals.replaceable) {
                (_, true) => SURE_THOUGH_REPLACEABLE,
                (true, false) => SURE_BESIDE_UNKNOWN,
                (false, false) => 0.5,
            };
            members.push(Offered {
                member,
                name,
                probability,
                equals: equals.names,
                size: rms(signature(candidate, own).into_iter()),
                sure: probability > least,
            });
        }
        // A gap that none of them makes for sure is made all the same: the best set stands for all that are probable.
        let stands_for_all =
            !beside_unknown && members.iter().all(|offered| !offered.sure) && self.something_acts();
        if stands_for_all {
            let others = self.other_sets(best);
            for offered in &mut members {
                let more = (others.iter()).filter(|other| !offered.equals.contains(other));
                let more: Vec<String> = more.cloned().collect();
                offered.equals.extend(more);
                let names = std::iter::once(&offered.name).chain(&offered.equals);
                offered.probability = self.probability(names);
            }
        }
        members.retain(|offered| offered.sure || stands_for_all);
        members.sort_by(|one, other| other.size.total_cmp(&one.size));
        let set: Vec<usize> = members.iter().map(|offered| offered.member).collect();
        let estimates = parameters::estimates(self.shapes, attribution, &set);
        let blocks = Blocks::new(self.observations, &attribution.active);
        let held_out = |set: &[usize]| {
            let candidates: Vec<&Candidate> = set
                .iter()
                .map(|&member| &attribution.candidates[member])
                .collect();
            blocks.size(&blocks.residuals(&candidates, &attribution.y, &attribution.active))
        };
        let mut effects = Vec::new();
        for (place, offered) in members.into_iter().enumerate() {
            let after = held_out(&set[..=place]);
            let equals = offered.equals;
            effects.push(Effect {
                effect: offered.name,
                probability: offered.probability,
                parameters: estimates.get(place).cloned().unwrap_or_default(),
                rms_before: held_out(&set[..place]).rms,
                rms_after: after.rms,
                ci95_after: after.ci95,
                held_out: true,
                alternatives: alternatives::of(self.shapes, attribution, &set, place, &equals),
                indistinguishable_from: equals,
                placebo_rms_after: self.placebo(&set, place, &held_out),
                sessions: Vec::new(),
            });
        }
        (effects, set)
    }

    /// Effects of other sets that are not much less probable than that of a model, in the order of the library.
    fn other_sets(&self, best: &Model) -> Vec<String> {
        let attribution = &self.explained.attribution;
        let of = |model: &Model| -> Vec<usize> {
            let variant = |&member: &usize| attribution.candidates[member].variant;
            model.set.iter().map(variant).collect()
        };
        let named = |variants: &[usize], name: &str| {
            let mut effects = variants
                .iter()
                .map(|&variant| &self.variants[variant].effect);
            effects.any(|effect| effect == name)
        };
        let own = of(best);
        let probable = attribution.models.iter().filter(|model| {
            !attribution.is_unknown(model) && model.probability * REFUTED > best.probability
        });
        let others: Vec<usize> = probable.flat_map(of).collect();
        let mut names: Vec<String> = Vec::new();
        for variant in self.variants {
            let name = &variant.effect;
            if named(&others, name) && !named(&own, name) && !names.contains(name) {
                names.push(name.clone());
            }
        }
        names
    }

    /// Held-out rms with a wrong effect of as many parameters in the place of a named one: the median over them.
    fn placebo(
        &self,
        set: &[usize],
        place: usize,
        held_out: &impl Fn(&[usize]) -> crate::shrinkage::HeldOut,
    ) -> Option<f64> {
        let attribution = &self.explained.attribution;
        let width = attribution.candidates[set[place]].block.len();
        let mut sizes: Vec<f64> = (0..attribution.candidates.len())
            .filter(|other| {
                !set.contains(other) && attribution.candidates[*other].block.len() == width
            })
            .step_by(7)
            .take(5)
            .map(|other| {
                let mut wrong = set[..place].to_vec();
                wrong.push(other);
                held_out(&wrong).rms
            })
            .collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).copied()
    }

    /// Probability that at least one of the effects acts.
    fn probability<'a>(&self, names: impl Iterator<Item = &'a String>) -> f64 {
        let attribution = &self.explained.attribution;
        let names: Vec<&String> = names.collect();
        let has = |member: usize| {
            let own = &self.variants[attribution.candidates[member].variant].effect;
            names.contains(&own)
                || attribution.aliases[member]
                    .iter()
                    .any(|alias| names.contains(&&self.variants[alias.variant].effect))
        };
        let has: Vec<bool> = (0..attribution.candidates.len()).map(has).collect();
        let models =
            (attribution.models.iter()).filter(|model| model.set.iter().any(|&member| has[member]));
        models.map(|model| model.probability).sum::<f64>().min(1.0)
    }

    /// What remains, no more than the gap of `gap` (m): what effects and something unknown cancel is in no touch.
    fn unexplained(
        &self,
        beside_unknown: bool,
        best: &Model,
        doubted: &[usize],
        gap: f64,
    ) -> Unexplained {
        let attribution = &self.explained.attribution;
        let touches = |part: &[f64]| {
            let touches = part.iter().take(self.observations.touches());
            rms(touches.copied()).min(gap)
        };
        if let Some(part) = self.part_of(best, doubted) {
            return Unexplained {
                rms: touches(&part),
                place: places::of_part(self.observations, &part, &attribution.active),
            };
        }
        if !beside_unknown {
            return Unexplained {
                rms: 0.0,
                place: Vec::new(),
            };
        }
        let mut all = Vec::new();
        let mut size = 0.0;
        let mut kinds: Vec<crate::rivals::Kind> = Vec::new();
        for (index, model) in attribution.models.iter().enumerate().take(200) {
            let Some((place, _)) = model.rival else {
                continue;
            };
            let kind = attribution.rivals[place].kind.clone();
            if !attribution.is_unknown(model) || kinds.contains(&kind) {
                continue;
            }
            let share: f64 = attribution
                .models
                .iter()
                .filter(|model| {
                    model
                        .rival
                        .is_some_and(|(place, _)| attribution.rivals[place].kind == kind)
                })
                .map(|model| model.probability)
                .sum();
            if share < 0.05 {
                continue;
            }
            if let Some((kind, part)) = places::rival_part(attribution, index) {
                if kinds.is_empty() {
                    size = touches(&part);
                }
                all.extend(places::of_rival(self.observations, &kind, &part, share));
                kinds.push(kind);
            }
        }
        Unexplained {
            rms: size,
            place: all,
        }
    }

    /// What some members of a model add to the weighted deviations; `None` for no members.
    fn part_of(&self, model: &Model, members: &[usize]) -> Option<Vec<f64>> {
        let attribution = &self.explained.attribution;
        let fit = attribution.fit(model).filter(|_| !members.is_empty())?;
        let mut part = vec![0.0; attribution.y.len()];
        let mut start = 0;
        for &member in &model.set {
            let candidate = &attribution.candidates[member];
            let own = &fit.coefficients[start..start + candidate.block.len()];
            start += candidate.block.len();
            if members.contains(&member) {
                add_scaled(&mut part, 1.0, &signature(candidate, own));
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
            });
        }
        rejected.sort_by(|one, other| other.probability.total_cmp(&one.probability));
        rejected.truncate(12);
        rejected
    }

    /// Names a coarse grid; gives the part of the noise that is its rounding, m.
    fn grid(&self, best: &Model, noise: f64, effects: &mut Vec<Effect>) -> f64 {
        let Some(step) = self.observations.grid else {
            return 0.0;
        };
        // A rounding that depends on the cell stands apart from the noise already.
        let apart = self.kind_of(best) == Some(&Kind::Grid);
        let own = step / 12.0_f64.sqrt();
        if !apart && own * own < GRID_SHARE * noise * noise {
            return 0.0;
        }
        let before = if apart { noise.hypot(own) } else { noise };
        effects.push(plain(
            "data.quantisation",
            1.0,
            vec![fixed("step", step, "m", 0.0)],
            before,
            noise,
        ));
        if apart { 0.0 } else { own }
    }

    /// Names what the records themselves show: stray touches, shifted clocks.
    ///
    /// Beside something unknown a stray touch may be a part of it: then it is only set aside.
    fn records(&self, noise: f64, beside_unknown: bool, effects: &mut Vec<Effect>) {
        let stray = &self.explained.stray;
        if !stray.is_empty() && !beside_unknown {
            let left = residuals(
                &self.explained.attribution,
                &self.explained.attribution.models[0],
            );
            let values = stray.iter().flat_map(|&row| {
                let number = self.observations.rows[row].sequence.unwrap_or_default() as f64;
                [
                    fixed("index", number, "1", 0.0),
                    fixed("value", left[row], "m", 1.96 * noise),
                ]
            });
            let all = rms(self.observations.deviations.iter().copied());
            effects.push(plain("data.outliers", 1.0, values.collect(), all, noise));
        }
        if let Some(clock) = timing::clock_offset(self.session).filter(|clock| clock.certain) {
            let parameters = vec![fixed("dt", clock.offset, "s", 1.96 * clock.uncertainty)];
            effects.push(plain(
                "time.clock_offset",
                1.0,
                parameters,
                clock.rms.0,
                clock.rms.1,
            ));
        }
    }
}

/// The smallest explanation that is not yet refuted by [`REFUTED`] against a larger one: a false name costs more than
/// one left out.
fn simplest<'a>(attribution: &'a Attribution, model: &'a Model) -> &'a Model {
    let mut best = model;
    while let Some(smaller) = attribution.models.iter().find(|other| {
        attribution.is_unknown(other) == attribution.is_unknown(best)
            && other.set.len() < best.set.len()
            && other.probability * REFUTED > best.probability
    }) {
        best = smaller;
    }
    best
}

fn fixed(name: &str, value: f64, unit: &str, half: f64) -> ParameterEstimate {
    ParameterEstimate {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
        ci95: [value - half, value + half],
    }
}

fn plain(
    effect: &str,
    probability: f64,
    parameters: Vec<ParameterEstimate>,
    before: f64,
    after: f64,
) -> Effect {
    Effect {
        effect: effect.to_owned(),
        probability,
        parameters,
        rms_before: before,
        rms_after: after,
        ci95_after: [after, after],
        held_out: false,
        indistinguishable_from: Vec::new(),
        alternatives: Vec::new(),
        placebo_rms_after: None,
        sessions: Vec::new(),
    }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| {
        (sum + value * value, count + 1.0)
    });
    if count > 0.0 {
        (sum / count).sqrt()
    } else {
        0.0
    }
}
