//! Naming: which members of the best model a report names, with parameters, equivalence classes and cross-validation.
//!
//! Metres; parameters in the effects' own units.

use std::collections::BTreeSet;

use inference::candidate::Candidate;
use inference::cross_validation::HeldOut;
use inference::discrepancy::Kind;
use inference::posterior::Model;

use super::reporter::{REFUTED, Reporter, rms};
use crate::attribution::equivalence::{FittedMember, equivalence_class};
use crate::attribution::{alternatives, blocks, parameters};
use crate::report::Effect;

/// Beside an unknown cause an effect is named only when it is this probable.
const SURE_BESIDE_UNKNOWN: f64 = 0.99;
/// An effect that the others reproduce to within half the noise is named only when it is this probable.
const SURE_THOUGH_REPLACEABLE: f64 = 0.993;

/// In all other cases an effect is reported from this probability on.
const PROBABLE: f64 = 0.5;
/// Beside an unknown cause also one that is no more than that, where the held-out rms is below this share of that without it: a
/// sixteenth of its square.
const DOMINANT: f64 = 0.25;
/// The same beside a field over the part that many readings show: of what is this probable, a fifth of the square.
const BESIDE_FIELD: (f64, f64) = (0.9, 0.9);
/// So many readings show a field.
const MANY: usize = 500;
/// An effect that is named for all that are probable is at least this probable.
const LIKELY: f64 = 0.05;

/// Named effects in the order in which they close the gap.
pub(super) struct Named {
    pub(super) effects: Vec<Effect>,
    /// Their candidates.
    pub(super) set: Vec<usize>,
}

/// A member of a model, to be named or not.
struct Offered {
    member: usize,
    name: String,
    /// Probability that it or one of its equivalence class acts.
    probability: f64,
    equivalent: Vec<String>,
    /// Those of them that stand for it only together with others of them.
    together: Vec<String>,
    /// Root mean square of what it adds to the deviations, m.
    size: f64,
    /// Probable enough to be named by itself.
    sure: bool,
}

impl Reporter<'_> {
    /// Named effects in the order in which they close the gap, and their candidates.
    ///
    /// The `unsupported` members of the best model are not named.
    pub(super) fn name(
        &self,
        best: &Model,
        unsupported: &[usize],
        beside_unknown: bool,
        noise: f64,
    ) -> Named {
        let mut members = self.offered(best, unsupported, beside_unknown, noise);
        // Where no single effect is sure but some effect certainly acts, the best set stands for all that are probable.
        let stands_for_all =
            !beside_unknown && members.iter().all(|offered| !offered.sure) && self.something_acts();
        if stands_for_all {
            let others = self.other_sets(best);
            for offered in &mut members {
                let more = (others.iter()).filter(|other| !offered.equivalent.contains(other));
                let more: Vec<String> = more.cloned().collect();
                offered.equivalent.extend(more);
                let names = std::iter::once(&offered.name).chain(&offered.equivalent);
                offered.probability = self.probability(names);
            }
        }
        if beside_unknown {
            let field = self.kind_of(best) == Some(&Kind::Region);
            self.dominate(&mut members, field && self.observations.touches() >= MANY);
        }
        // What stands for all that are probable is not itself improbable, unless nothing else stands.
        let likely = members.iter().any(|offered| offered.probability > LIKELY);
        members.retain(|offered| {
            offered.sure || (stands_for_all && (offered.probability > LIKELY || !likely))
        });
        members.sort_by(|a, b| b.size.total_cmp(&a.size));
        self.describe(members, best.discrepancy)
    }

    /// Beside an unknown cause a member that is only probable is sure where the probable ones without it leave far more of the
    /// held-out touches: a process can have any size, so that one which is nearly a rigid displacement is hardly less probable
    /// than the displacement.
    fn dominate(&self, members: &mut [Offered], beside_field: bool) {
        let attribution = &self.explained.attribution;
        let blocks = blocks(self.observations, &attribution.active);
        let probable: Vec<usize> = (members.iter())
            .filter(|offered| offered.sure || offered.probability > PROBABLE)
            .map(|offered| offered.member)
            .collect();
        let held_out = |without: Option<usize>| {
            let kept = probable.iter().filter(|&&member| Some(member) != without);
            let set: Vec<&Candidate> = kept
                .map(|&member| &attribution.candidates[member])
                .collect();
            let residuals = blocks.residuals(&set, &attribution.y, &attribution.active);
            blocks.size(&residuals).rms
        };
        let whole = held_out(None);
        for offered in members.iter_mut().filter(|offered| !offered.sure) {
            let share = if beside_field && offered.probability > BESIDE_FIELD.0 {
                BESIDE_FIELD.1
            } else {
                DOMINANT
            };
            offered.sure = probable.contains(&offered.member)
                && whole < share * held_out(Some(offered.member));
        }
    }

    /// The members of a model that are not `unsupported`, each with its equivalence class.
    fn offered(
        &self,
        best: &Model,
        unsupported: &[usize],
        beside_unknown: bool,
        noise: f64,
    ) -> Vec<Offered> {
        let attribution = &self.explained.attribution;
        let Some(fit) = attribution.fit(best) else {
            return Vec::new();
        };
        let mut members = Vec::new();
        for (member, candidate, coefficients) in attribution.members(best, &fit) {
            if unsupported.contains(&member) {
                continue;
            }
            let fitted = FittedMember {
                set: &best.set,
                member,
                coefficients,
                noise,
            };
            let equivalent = equivalence_class(self.shapes, attribution, &fitted);
            let name = self.variants[candidate.variant].effect.clone();
            let alone = (equivalent.names.iter())
                .filter(|name| !equivalent.of_explanations.contains(*name));
            let names = std::iter::once(&name).chain(alone);
            let probability = self.probability_with(names, &equivalent.explanations);
            let least = match (beside_unknown, equivalent.replaceable) {
                (_, true) => SURE_THOUGH_REPLACEABLE,
                (true, false) => SURE_BESIDE_UNKNOWN,
                (false, false) => PROBABLE,
            };
            members.push(Offered {
                member,
                name,
                probability,
                equivalent: equivalent.names,
                together: equivalent.together,
                size: rms(candidate.signature(coefficients).into_iter()),
                sure: probability > least,
            });
        }
        members
    }

    /// Members to be named with their parameters, alternatives and cross-validation.
    ///
    /// `unknown` is the process beside them: its index and its variance over that of the noise.
    fn describe(&self, members: Vec<Offered>, unknown: Option<(usize, f64)>) -> Named {
        let attribution = &self.explained.attribution;
        let set: Vec<usize> = members.iter().map(|offered| offered.member).collect();
        let estimates = parameters::averaged(self.shapes, attribution, &set, unknown);
        let blocks = blocks(self.observations, &attribution.active);
        let held_out = |set: &[usize]| {
            let candidates: Vec<&Candidate> = set
                .iter()
                .map(|&member| &attribution.candidates[member])
                .collect();
            blocks.size(&blocks.residuals(&candidates, &attribution.y, &attribution.active))
        };
        let mut effects = Vec::new();
        for (index, offered) in members.into_iter().enumerate() {
            let after = held_out(&set[..=index]);
            let equivalent = offered.equivalent;
            let alone = equivalent.iter();
            let alone: Vec<String> = alone
                .filter(|name| !offered.together.contains(name))
                .cloned()
                .collect();
            effects.push(Effect {
                effect: offered.name,
                probability: offered.probability,
                parameters: estimates.get(index).cloned().unwrap_or_default(),
                rms_before: held_out(&set[..index]).rms,
                rms_after: after.rms,
                ci95_after: after.ci95,
                held_out: true,
                joint_zero: None,
                alternatives: alternatives::fit_alternatives(
                    self.shapes,
                    attribution,
                    (&set, unknown),
                    index,
                    &alone,
                ),
                indistinguishable_from: equivalent,
                group: Vec::new(),
                placebo_rms_after: self.placebo(&set, index, &held_out),
                sessions: Vec::new(),
            });
        }
        Named { effects, set }
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

    /// Held-out rms with another effect of as many parameters in place of a named one: the median over five of them.
    fn placebo(
        &self,
        set: &[usize],
        index: usize,
        held_out: &impl Fn(&[usize]) -> HeldOut,
    ) -> Option<f64> {
        let attribution = &self.explained.attribution;
        let width = attribution.candidates[set[index]].block.len();
        let mut sizes: Vec<f64> = (0..attribution.candidates.len())
            .filter(|other| {
                !set.contains(other) && attribution.candidates[*other].block.len() == width
            })
            .step_by(7)
            .take(5)
            .map(|other| {
                let mut wrong = set[..index].to_vec();
                wrong.push(other);
                held_out(&wrong).rms
            })
            .collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).copied()
    }

    /// Probability that at least one of the effects acts.
    pub(super) fn probability<'a>(&self, names: impl Iterator<Item = &'a String>) -> f64 {
        self.probability_with(names, &BTreeSet::new())
    }

    /// Probability that at least one of the effects, or one of these sets, acts.
    fn probability_with<'a>(
        &self,
        names: impl Iterator<Item = &'a String>,
        sets: &BTreeSet<Vec<usize>>,
    ) -> f64 {
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
        let models = (attribution.models.iter()).filter(|model| {
            sets.contains(&model.set) || model.set.iter().any(|&member| has[member])
        });
        models.map(|model| model.probability).sum::<f64>().min(1.0)
    }
}
