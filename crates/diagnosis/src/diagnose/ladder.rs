//! How far effects of the vocabulary could explain what stays unexplained: forward selection by held-out touches.
//!
//! A process that follows anything is the better explanation where it is the more probable one; an expert still wants to know
//! how small the gap would be if it were known effects. Each rung is the effect that leaves least on touches that were not
//! used to fit. Since it is chosen by what it leaves, it is no proof. Metres.

use inference::candidate::Candidate;
use inference::evidence_gain::EvidenceGainEstimator;

use super::reporter::Reporter;
use crate::attribution::blocks;
use crate::attribution::unsupported::least_share;
use crate::report::Rung;

/// Rungs at most.
const RUNGS: usize = 6;
/// Effects whose held-out rms is computed for each rung: those with the highest evidence.
const TRIED: usize = 8;

impl Reporter<'_> {
    /// Effects that could be added to the named ones, in the order in which they close a gap of rms `gap` (m).
    pub(super) fn ladder(&self, named: &[usize], gap: f64) -> Vec<Rung> {
        let attribution = &self.explained.attribution;
        let blocks = blocks(self.observations, &attribution.active);
        let held_out = |set: &[usize]| {
            let candidates: Vec<&Candidate> = (set.iter())
                .map(|&member| &attribution.candidates[member])
                .collect();
            let residuals = blocks.residuals(&candidates, &attribution.y, &attribution.active);
            blocks.size(&residuals).rms
        };
        let mut set = named.to_vec();
        set.sort_unstable();
        let share = least_share(attribution);
        let mut ladder: Vec<Rung> = Vec::new();
        let mut before = held_out(&set);
        while ladder.len() < RUNGS {
            let best = (self.promising(&set).into_iter())
                .map(|candidate| {
                    let mut more = set.clone();
                    more.insert(set.partition_point(|&member| member < candidate), candidate);
                    (held_out(&more), candidate, more)
                })
                .min_by(|one, other| one.0.total_cmp(&other.0));
            let Some((after, candidate, more)) = best else {
                break;
            };
            if after * (1.0 + share) > before {
                break;
            }
            ladder.push(Rung {
                effect: self.effect_of(candidate).to_owned(),
                rms_before: before.min(gap),
                rms_after: after,
            });
            (set, before) = (more, after);
        }
        ladder
    }

    /// The candidate of each effect with the highest evidence beside a set, the best effects first.
    fn promising(&self, set: &[usize]) -> Vec<usize> {
        let products = &self.explained.attribution.products;
        let variances = products.variances(set);
        let Some(mut gain) = EvidenceGainEstimator::new(products, set, &variances) else {
            return Vec::new();
        };
        let known: Vec<&str> = set.iter().map(|&member| self.effect_of(member)).collect();
        let mut ranked: Vec<(f64, usize)> = (0..products.spans.len())
            .filter(|&candidate| !known.contains(&self.effect_of(candidate)))
            .filter_map(|candidate| Some((gain.log_evidence_with(candidate)?, candidate)))
            .collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut effects: Vec<&str> = Vec::new();
        ranked.retain(|&(_, candidate)| {
            let effect = self.effect_of(candidate);
            let first = !effects.contains(&effect);
            effects.push(effect);
            first
        });
        ranked.truncate(TRIED);
        ranked.into_iter().map(|(_, candidate)| candidate).collect()
    }

    fn effect_of(&self, candidate: usize) -> &str {
        &self.variants[self.explained.attribution.candidates[candidate].variant].effect
    }
}
