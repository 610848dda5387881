//! Parameters that cannot be negative: an effect that was fitted with such values is fitted again without them.
//!
//! A joint yields downwards, and no mass is negative. Least squares over poses that hardly tell the joints apart gives some of
//! them impossible values. As in non-negative least squares by active sets (Lawson and Hanson 1974, ch. 23), the negative
//! parameters are left out, and the whole diagnosis made again.

use std::collections::BTreeMap;

use effects::Variant;

use crate::report::Report;

/// Parameters that are left out, by effect.
#[derive(Debug, Default)]
pub(crate) struct ExcludedParameters(BTreeMap<String, Vec<String>>);

impl ExcludedParameters {
    /// The variants without the parameters that are left out; a variant of which none is left is not offered.
    pub(crate) fn left_out(&self, variants: Vec<Variant>) -> Vec<Variant> {
        let kept = |variant: Variant| {
            let Some(out) = self.0.get(&variant.effect).filter(|_| variant.nonnegative) else {
                return Some(variant);
            };
            let kept: Vec<usize> = (0..variant.parameters.len())
                .filter(|&one| !out.contains(&variant.parameters[one].name))
                .collect();
            (!kept.is_empty()).then(|| variant.with_only(&kept))
        };
        variants.into_iter().filter_map(kept).collect()
    }

    /// Leaves out the parameters of the effects of a report that are negative and cannot be; false without any.
    pub(crate) fn found_in(&mut self, report: &Report, variants: &[Variant]) -> bool {
        let mut found = false;
        for effect in &report.effects {
            let offered = variants
                .iter()
                .find(|variant| variant.effect == effect.effect);
            let Some(variant) = offered.filter(|variant| variant.nonnegative) else {
                continue;
            };
            let fitted = effect.parameters.iter().filter(|one| {
                one.value < 0.0 && variant.parameters.iter().any(|own| own.name == one.name)
            });
            let names: Vec<String> = fitted.map(|one| one.name.clone()).collect();
            found |= !names.is_empty();
            self.0
                .entry(effect.effect.clone())
                .or_default()
                .extend(names);
        }
        found
    }
}
