//! Declared effects in a report: taken over from it, and judged by it.

use effects::session::Session;
use effects::{DeclaredEffect, DeclaredParameter, Observations, ParameterEstimate, Promise};

use super::{Declared, Effect, Report, Sizes};
use crate::attribution::blocks;

/// Name of the parameter of a location error.
const MEMBER: &str = "e";

impl Report {
    /// An effect of this report as one of the declared model, with where and when it was found.
    pub fn declare(&self, effect: &Effect) -> DeclaredEffect {
        self.declare_with(effect, &effect.effect, &effect.parameters)
    }

    /// The same of each member of a family.
    pub fn declare_all(&self, effect: &Effect) -> Vec<DeclaredEffect> {
        if !effect.is_family() {
            return vec![self.declare(effect)];
        }
        let member = |one: &ParameterEstimate| {
            let error = ParameterEstimate {
                name: MEMBER.to_owned(),
                ..one.clone()
            };
            self.declare_with(effect, &one.name, &[error])
        };
        effect.parameters.iter().map(member).collect()
    }

    /// An effect under the name of another effect of its equivalence class; `None` where that class does not contain it.
    pub fn declare_as(&self, effect: &Effect, name: &str) -> Option<DeclaredEffect> {
        let parameters = if name == effect.effect {
            &effect.parameters
        } else {
            let alternatives = effect.alternatives.iter();
            &(alternatives.clone().find(|other| other.effect == name)?).parameters
        };
        let mut chosen = self.declare_with(effect, name, parameters);
        chosen.chosen_from = std::iter::once(&effect.effect)
            .chain(&effect.indistinguishable_from)
            .cloned()
            .collect();
        Some(chosen)
    }

    fn declare_with(
        &self,
        effect: &Effect,
        name: &str,
        parameters: &[ParameterEstimate],
    ) -> DeclaredEffect {
        let parameter = |one: &ParameterEstimate| DeclaredParameter {
            name: one.name.clone(),
            value: one.value,
            unit: one.unit.clone(),
            ci95: Some(one.ci95),
        };
        DeclaredEffect {
            effect: name.to_owned(),
            parameters: parameters.iter().map(parameter).collect(),
            chosen_from: Vec::new(),
            source: Some(self.bag.clone()),
            measured: self.measured.clone(),
            promised: Some(Promise {
                rms_before_m: effect.rms_before,
                rms_after_m: effect.rms_after,
                ci95_after_m: effect.ci95_after,
            }),
        }
    }
}

/// Report entries of the declared effects: the promised and the achieved reduction of the gap of each.
///
/// Each is evaluated, in their order, on the residuals of those before it. `active` marks the rows in use.
pub(crate) fn compare_with_promise(
    session: &Session,
    observations: &Observations,
    active: &[bool],
) -> Vec<Declared> {
    let blocks = blocks(observations, active);
    let mut left = observations.deviations.clone();
    for own in &observations.declared {
        add(&mut left, own, 1.0);
    }
    let size = |left: &[f64]| blocks.size(&left.iter().copied().map(Some).collect::<Vec<_>>());
    let mut entries = Vec::with_capacity(session.declared.len());
    for (effect, own) in session.declared.iter().zip(&observations.declared) {
        let before = size(&left);
        add(&mut left, own, -1.0);
        let after = size(&left);
        let achieved = Sizes {
            rms_before: before.rms,
            rms_after: after.rms,
            ci95_after: after.ci95,
        };
        entries.push(report_entry(effect, Some(achieved)));
    }
    // What one session showed was fitted together: only all of it together keeps a promise.
    for group in entries.chunk_by_mut(Declared::found_with) {
        let sizes = group
            .last()
            .and_then(|last| last.promised.as_ref().zip(last.achieved.as_ref()));
        let kept =
            sizes.map(|(promised, achieved)| achieved.ci95_after[0] <= promised.ci95_after[1]);
        for one in group {
            one.kept = kept;
        }
    }
    entries
}

/// Report entry of a declared effect with its achieved reduction of the gap, where that is evaluated.
pub(crate) fn report_entry(effect: &DeclaredEffect, achieved: Option<Sizes>) -> Declared {
    let estimate = |one: &DeclaredParameter| ParameterEstimate {
        name: one.name.clone(),
        value: one.value,
        unit: one.unit.clone(),
        ci95: one.ci95.unwrap_or([one.value, one.value]),
    };
    let promised = effect.promised.as_ref().map(|promise| Sizes {
        rms_before: promise.rms_before_m,
        rms_after: promise.rms_after_m,
        ci95_after: promise.ci95_after_m,
    });
    Declared {
        effect: effect.effect.clone(),
        parameters: effect.parameters.iter().map(estimate).collect(),
        chosen_from: effect.chosen_from.clone(),
        source: effect.source.clone(),
        measured: effect.measured.clone(),
        kept: None,
        promised,
        achieved,
    }
}

fn add(left: &mut [f64], part: &[f64], factor: f64) {
    for (value, part) in left.iter_mut().zip(part) {
        *value += factor * part;
    }
}
