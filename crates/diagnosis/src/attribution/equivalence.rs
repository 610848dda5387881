//! Equivalence classes of effects: effects that a session cannot distinguish from a fitted one.
//!
//! Another effect is indistinguishable when, beside the rest of the set, it reproduces the effect's fitted signature to
//! within half the noise and, however many touches there are, within five standard deviations, or when the posterior with it in place
//! is not much lower. So are those of another explanation that is not much less probable, where they reproduce it together. What depends
//! on time, and is measured in the order of the places, looks like what depends on the place: there two effects together may stand for
//! one, with no more parameters than it has. The class is a list of identifiers.

use std::collections::BTreeSet;

use effects::effect::Coordinate;
use effects::registry::acts_on;
use inference::candidate::Candidate;
use inference::posterior::ModelPosterior;
use inference::trial::Trial;

use super::candidate_pool::{ScannedResiduals, Shapes};

/// Two signatures whose rms difference is below this share of the noise are the same.
const HALF: f64 = 0.5;
/// Signatures that differ by more than this many standard deviations, over all touches together, are told apart also where the rms
/// difference is small: of 500 touches, half the noise would be eleven.
const TOLD_APART: f64 = 5.0;
/// A substitute whose log posterior is lower by less than this is not excluded.
const NOT_EXCLUDED: f64 = 4.6;
/// The first of two effects that stand for one explains at least this share of its energy.
const MAX_OF_IT: f64 = 0.4;
/// Effects that stand for one together leave at most this share of its energy.
const LEFT_OF_IT: f64 = 0.05;
/// Trial values of a shape that are compared with a signature.
const TRIALS: usize = 160;

/// Effects that are indistinguishable from a fitted one.
#[derive(Debug, Clone)]
pub(crate) struct EquivalenceClass {
    /// Their identifiers, in the order of the library, without the fitted effect.
    pub(crate) names: Vec<String>,
    /// Those of them that stand for the effect only together with others of them.
    pub(crate) together: Vec<String>,
    /// Sets of other explanations that reproduce the effect by several of their members together.
    pub(crate) explanations: BTreeSet<Vec<usize>>,
    /// Effects that are in the class for these alone.
    pub(crate) of_explanations: BTreeSet<String>,
    /// True where the rest of the set reproduces the effect to within half the noise.
    pub(crate) replaceable: bool,
}

/// A fitted member of a set of candidates.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FittedMember<'a> {
    /// All candidates of the set.
    pub(crate) set: &'a [usize],
    /// The member, one of the set.
    pub(crate) member: usize,
    /// Coefficients of its block's columns, m.
    pub(crate) coefficients: &'a [f64],
    /// Standard deviation of the noise, m.
    pub(crate) noise: f64,
}

/// Sum of squares (m²) up to which the difference of two signatures on `touches` is none.
fn same_within(noise: f64, touches: usize) -> f64 {
    noise.powi(2) * (HALF.powi(2) * touches as f64).min(TOLD_APART.powi(2))
}

/// The equivalence class of a member of a set.
pub(crate) fn equivalence_class(
    shapes: &Shapes<'_>,
    attribution: &ModelPosterior,
    fitted: &FittedMember<'_>,
) -> EquivalenceClass {
    let others = (fitted.set.iter().copied())
        .filter(|&other| other != fitted.member)
        .collect();
    let substitution = Substitution {
        shapes,
        attribution,
        fitted,
        others,
    };
    let mut found: BTreeSet<&str> = substitution.effects_of(fitted.member).skip(1).collect();
    let replaceable = substitution.by_signature(&mut found);
    substitution.by_posterior(&mut found);
    let mut together = BTreeSet::new();
    if !replaceable && substitution.depends_on_time() {
        substitution.by_two(&found, &mut together);
    }
    let (explanations, mut joint) = if replaceable {
        Default::default()
    } else {
        substitution.by_explanations()
    };
    joint.retain(|name| !found.contains(name) && !together.contains(name));
    for &member in fitted.set {
        found.remove(substitution.effect(member));
        together.remove(substitution.effect(member));
        joint.remove(substitution.effect(member));
    }
    let together_or_joint = together.union(&joint);
    let mut class = EquivalenceClass {
        names: Vec::new(),
        together: together_or_joint.map(|&name| name.to_owned()).collect(),
        explanations,
        of_explanations: joint.iter().map(|&name| name.to_owned()).collect(),
        replaceable,
    };
    found.append(&mut together);
    found.append(&mut joint);
    for variant in shapes.variants {
        if found.remove(variant.effect.as_str()) {
            class.names.push(variant.effect.clone());
        }
    }
    class
}

/// Candidates in the place of one member of a set.
struct Substitution<'a> {
    shapes: &'a Shapes<'a>,
    attribution: &'a ModelPosterior,
    fitted: &'a FittedMember<'a>,
    /// The rest of the set.
    others: Vec<usize>,
}

impl<'a> Substitution<'a> {
    fn effect(&self, candidate: usize) -> &'a str {
        &self.shapes.variants[self.attribution.candidates[candidate].variant].effect
    }

    /// The effect of a candidate, then those whose span is the same.
    fn effects_of(&self, candidate: usize) -> impl Iterator<Item = &'a str> {
        let variants = self.shapes.variants;
        let aliases = self.attribution.aliases[candidate].iter();
        std::iter::once(self.effect(candidate))
            .chain(aliases.map(|alias| variants[alias.variant].effect.as_str()))
    }

    /// Adds the effects that reproduce the fitted signature beside the rest of the set.
    ///
    /// True where the rest alone reproduces it: then any effect would, and nothing is added.
    fn by_signature(&self, found: &mut BTreeSet<&'a str>) -> bool {
        let (shapes, attribution) = (self.shapes, self.attribution);
        let candidates = &attribution.candidates;
        let FittedMember {
            member,
            coefficients,
            noise,
            ..
        } = *self.fitted;
        let rest = self.others.iter().map(|&other| &candidates[other]);
        let signature = candidates[member].signature(coefficients);
        let residuals = ScannedResiduals::new(shapes, &attribution.active, &signature, rest);
        let energy = residuals.energy();
        let bound = same_within(noise, shapes.sample.len());
        if energy <= bound {
            return true;
        }
        let reproduces = |trial: &Trial| energy - residuals.explained_by(trial) <= bound;
        for (index, candidate) in candidates.iter().enumerate() {
            if index != member && reproduces(&self.as_trial(candidate)) {
                found.extend(self.effects_of(index));
            }
        }
        for (index, variant) in shapes.variants.iter().enumerate() {
            if found.contains(variant.effect.as_str()) {
                continue;
            }
            let trials = shapes.trials(index);
            let stride = trials.len().div_ceil(TRIALS).max(1);
            if trials.iter().step_by(stride).any(reproduces) {
                found.insert(&variant.effect);
            }
        }
        false
    }

    fn depends_on_time(&self) -> bool {
        let acts = acts_on(self.effect(self.fitted.member));
        acts.is_some_and(|acts| acts.smooth_in.contains(&Coordinate::Time))
    }

    /// The sets of other explanations that are not much less probable and reproduce the fitted signature together beside the rest of the
    /// set, and those of their effects that are needed for it.
    fn by_explanations(&self) -> (BTreeSet<Vec<usize>>, BTreeSet<&'a str>) {
        let attribution = self.attribution;
        let FittedMember {
            set,
            member,
            coefficients,
            noise,
        } = *self.fitted;
        let signature = attribution.candidates[member].signature(coefficients);
        let energy_beside = |substitutes: &[usize]| {
            let rest = self.others.iter().chain(substitutes);
            let rest = rest.map(|&other| &attribution.candidates[other]);
            ScannedResiduals::new(self.shapes, &attribution.active, &signature, rest).energy()
        };
        let whole = energy_beside(&[]);
        let bound = same_within(noise, self.shapes.sample.len()).min(LEFT_OF_IT * whole);
        let reproduced_by = |substitutes: &[usize]| energy_beside(substitutes) <= bound;
        let best = attribution.models.first();
        let probable = (attribution.models.iter()).take_while(|model| {
            best.is_some_and(|best| model.log_posterior > best.log_posterior - NOT_EXCLUDED)
        });
        let (mut explanations, mut effects) = (BTreeSet::new(), BTreeSet::new());
        let mut known: BTreeSet<&[usize]> = BTreeSet::new();
        for model in probable.filter(|model| known.insert(&model.set)) {
            let same = |&other: &usize| self.effect(other) == self.effect(member);
            let new = model.set.iter().copied();
            let mut substitutes: Vec<usize> = new.filter(|other| !set.contains(other)).collect();
            if model.set.iter().any(same) || !reproduced_by(&substitutes) {
                continue;
            }
            for substitute in substitutes.clone() {
                let fewer = substitutes.iter().copied();
                let fewer: Vec<usize> = fewer.filter(|&other| other != substitute).collect();
                if reproduced_by(&fewer) {
                    substitutes = fewer;
                }
            }
            effects.extend(substitutes.into_iter().flat_map(|own| self.effects_of(own)));
            explanations.insert(model.set.clone());
        }
        (explanations, effects)
    }

    /// Adds effects that are not among `alone`, of which two together reproduce the fitted signature beside the rest of the set with
    /// no more columns than it has.
    fn by_two(&self, alone: &BTreeSet<&'a str>, found: &mut BTreeSet<&'a str>) {
        let (shapes, attribution) = (self.shapes, self.attribution);
        let candidates = &attribution.candidates;
        let member = &candidates[self.fitted.member];
        let signature = member.signature(self.fitted.coefficients);
        let beside = |first: Option<usize>| {
            let rest = self.others.iter().copied().chain(first);
            let rest = rest.map(|other| &candidates[other]);
            ScannedResiduals::new(shapes, &attribution.active, &signature, rest)
        };
        let bound = same_within(self.fitted.noise, shapes.sample.len());
        let whole = beside(None);
        let offered: Vec<(usize, Trial)> = (0..candidates.len())
            .filter(|&index| {
                let narrow = candidates[index].block.len() < member.block.len();
                narrow && self.effects_of(index).all(|name| !alone.contains(name))
            })
            .map(|index| (index, self.as_trial(&candidates[index])))
            .collect();
        for (first, trial) in &offered {
            if whole.explained_by(trial) < MAX_OF_IT * whole.energy() {
                continue;
            }
            let left = beside(Some(*first));
            let columns = member.block.len() - candidates[*first].block.len();
            for (second, trial) in &offered {
                let fits = candidates[*second].block.len() <= columns
                    && self.effect(*second) != self.effect(*first)
                    && left.energy() - left.explained_by(trial) <= bound;
                if fits {
                    found.extend(self.effects_of(*first).chain(self.effects_of(*second)));
                }
            }
        }
    }

    fn as_trial(&self, candidate: &Candidate) -> Trial {
        let columns = candidate.block.iter();
        let columns = columns.map(|column| self.shapes.scanned(column, &self.attribution.active));
        Trial::new(candidate.shape, columns.collect())
    }

    /// Adds the effects with which in the member's place a model without a discrepancy is not much less probable.
    fn by_posterior(&self, found: &mut BTreeSet<&'a str>) {
        let models =
            || (self.attribution.models.iter()).filter(|model| model.discrepancy.is_none());
        let set = self.fitted.set;
        let Some(best) = models().find(|model| model.set == set) else {
            return;
        };
        for model in models() {
            let substituted = model.set.len() == set.len()
                && !model.set.contains(&self.fitted.member)
                && self.others.iter().all(|other| model.set.contains(other))
                && model.log_posterior > best.log_posterior - NOT_EXCLUDED;
            let substitute = model.set.iter().find(|own| !self.others.contains(own));
            if let (true, Some(&substitute)) = (substituted, substitute) {
                found.extend(self.effects_of(substitute));
            }
        }
    }
}
