//! Search for probable sets of candidates.
//!
//! Beam search up to [`MAX_EFFECTS`]; at each level only the sets with the best estimates ([`crate::evidence_gain`]) are
//! solved. The prior halves with each effect and is uniform over the sets of one size, so that a larger library is paid for.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use crate::evidence::{InnerProducts, Variances};
use crate::evidence_gain::EvidenceGainEstimator;

/// Most effects in a set.
pub const MAX_EFFECTS: usize = 5;
/// Most effects in a set that grows one by one.
const MAX_AT_LENGTH: usize = 32;
/// Sets kept at each size.
const BEAM: usize = 24;
/// Candidates tried on each kept set.
const TRIED: usize = 14;
/// Candidates of one effect that are tried on a set.
const OF_ONE_EFFECT: usize = 3;
/// This many times as many are estimated after screening.
const ESTIMATED: usize = 2;
/// Candidates tried on a set that grows one by one.
const TRIED_AT_LENGTH: usize = 6;
/// Best sets of a search that are improved by exchanges.
const EXCHANGED: usize = 2;
/// Exchanges of a set, at most.
const EXCHANGES: usize = 12;
/// A level whose best log posterior is this far behind the best of all ends the search.
const HOPELESS: f64 = 16.0;

/// A set of candidates and its log posterior (not normalised).
#[derive(Debug, Clone)]
pub struct ScoredSet {
    /// Candidates, ascending.
    pub set: Vec<usize>,
    /// Log evidence plus log prior.
    pub log_posterior: f64,
}

/// Prior probabilities of the candidates.
#[derive(Debug, Clone)]
pub struct Priors {
    /// Effect of each candidate, in the order of the products, as a number: two of one effect never stand in a set.
    pub effect: Vec<usize>,
    /// Natural logarithm of the prior of each candidate within its effect, in the order of [`Self::effect`] and as many.
    pub log_prior: Vec<f64>,
    /// Number of effects in the library.
    pub effects: usize,
}

impl Priors {
    /// Log prior probability of a set.
    pub fn log_prior_of(&self, set: &[usize]) -> f64 {
        self.log_prior_of_size(set.len()) + self.log_prior_of_members(set)
    }

    /// Log prior probability of one set of `size` effects.
    fn log_prior_of_size(&self, size: usize) -> f64 {
        let choices: f64 = (0..size)
            .map(|k| ((self.effects.max(size) - k) as f64 / (k + 1) as f64).ln())
            .sum();
        -std::f64::consts::LN_2 * (size as f64 + 1.0) - choices
    }

    /// Log prior probability of the members within their effects.
    fn log_prior_of_members(&self, set: &[usize]) -> f64 {
        set.iter().map(|&member| self.log_prior[member]).sum()
    }
}

/// Evidence of the sets that were solved already.
pub type EvidenceCache = BTreeMap<Vec<usize>, Variances>;

/// Scored sets, best first; what is `known` of the same products is not computed again.
pub fn search(
    products: &InnerProducts,
    priors: &Priors,
    beam: usize,
    known: &mut EvidenceCache,
) -> Vec<ScoredSet> {
    let mut scored = |set: Vec<usize>| {
        let variances =
            (known.entry(set.clone())).or_insert_with_key(|set| products.variances(set));
        let log_posterior = variances.log_evidence + priors.log_prior_of(&set);
        (ScoredSet { set, log_posterior }, variances.clone())
    };
    let empty = scored(Vec::new());
    let mut best = empty.0.log_posterior;
    let mut all = vec![empty.0.clone()];
    let mut level = vec![empty];
    for size in 1..=MAX_EFFECTS {
        let (tried, solved, kept) = match size {
            1 => (usize::MAX, usize::MAX, 2 * beam),
            _ => (TRIED, 2 * beam, beam),
        };
        let parents = level
            .iter()
            .map(|(parent, variances)| (&*parent.set, variances));
        let mut next: Vec<(ScoredSet, Variances)> = (children(products, priors, parents, tried))
            .into_iter()
            .take(solved)
            .map(&mut scored)
            .collect();
        next.sort_by(|a, b| b.0.log_posterior.total_cmp(&a.0.log_posterior));
        let Some(leader) = next.first().map(|(scored, _)| scored.log_posterior) else {
            break;
        };
        best = best.max(leader);
        all.extend(next.iter().map(|(scored, _)| scored.clone()));
        next.truncate(kept);
        level = next;
        if size > 1 && leader < best - HOPELESS {
            break;
        }
    }
    all.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
    all
}

/// Sets of one candidate more than those of `parents`, best estimate first; at most `tried` of each parent.
fn children<'p>(
    products: &InnerProducts,
    priors: &Priors,
    parents: impl Iterator<Item = (&'p [usize], &'p Variances)>,
    tried: usize,
) -> Vec<Vec<usize>> {
    let mut estimated: Vec<(f64, Vec<usize>)> = Vec::new();
    let mut ranked: Vec<(f64, usize)> = Vec::new();
    for (set, variances) in parents {
        let Some(mut gain) = EvidenceGainEstimator::new(products, set, variances) else {
            continue;
        };
        let effects: Vec<usize> = set.iter().map(|&member| priors.effect[member]).collect();
        let prior = priors.log_prior_of_size(set.len() + 1) + priors.log_prior_of_members(set);
        let others = (0..products.spans.len())
            .filter(|&candidate| !effects.contains(&priors.effect[candidate]));
        ranked.clear();
        ranked.extend(others.map(|candidate| (gain.explained_share(candidate), candidate)));
        keep_of_each(&mut ranked, priors, tried.saturating_mul(ESTIMATED));
        ranked.retain_mut(|(worth, candidate)| {
            let evidence = gain.log_evidence_with(*candidate);
            *worth = evidence.unwrap_or_default() + priors.log_prior[*candidate];
            evidence.is_some()
        });
        keep_of_each(&mut ranked, priors, tried);
        estimated.extend(ranked.iter().map(|&(worth, candidate)| {
            let mut child = Vec::with_capacity(set.len() + 1);
            child.extend_from_slice(set);
            child.insert(set.partition_point(|&member| member < candidate), candidate);
            (prior + worth, child)
        }));
    }
    // The same set has an estimate from each of its parents.
    estimated.sort_by(|a, b| a.1.cmp(&b.1).then(b.0.total_cmp(&a.0)));
    estimated.dedup_by(|a, b| a.1 == b.1);
    estimated.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
    estimated.into_iter().map(|(_, set)| set).collect()
}

/// Keeps the best, and no more of one effect than [`OF_ONE_EFFECT`]: its shapes next to one another are near-duplicates.
fn keep_of_each(ranked: &mut Vec<(f64, usize)>, priors: &Priors, most: usize) {
    if most >= ranked.len() {
        return;
    }
    let kept = most.saturating_mul(OF_ONE_EFFECT);
    if kept < ranked.len() {
        ranked.select_nth_unstable_by(kept, better);
        ranked.truncate(kept);
    }
    ranked.sort_unstable_by(better);
    let mut counts = vec![0_usize; priors.effects];
    ranked.retain(|&(_, candidate)| {
        let count = &mut counts[priors.effect[candidate]];
        *count += 1;
        *count <= OF_ONE_EFFECT
    });
    ranked.truncate(most);
}

/// Larger first, then by index.
fn better(a: &(f64, usize), b: &(f64, usize)) -> Ordering {
    b.0.total_cmp(&a.0).then(a.1.cmp(&b.1))
}

/// The best of some sets, if it is better than `best`.
fn best_of(
    products: &InnerProducts,
    priors: &Priors,
    sets: impl Iterator<Item = Vec<usize>>,
    best: &ScoredSet,
) -> Option<ScoredSet> {
    sets.map(|set| ScoredSet {
        log_posterior: products.log_evidence(&set) + priors.log_prior_of(&set),
        set,
    })
    .max_by(|a, b| a.log_posterior.total_cmp(&b.log_posterior))
    .filter(|next| next.log_posterior > best.log_posterior)
}

/// Forward selection: adds candidates to a set one by one while the posterior rises; `None` when none does.
pub fn extend(products: &InnerProducts, priors: &Priors, start: &[usize]) -> Option<ScoredSet> {
    let first = products.log_evidence(start) + priors.log_prior_of(start);
    let mut best = ScoredSet {
        set: start.to_vec(),
        log_posterior: first,
    };
    while best.set.len() < MAX_AT_LENGTH {
        let variances = products.variances(&best.set);
        let parent = std::iter::once((best.set.as_slice(), &variances));
        let longer = children(products, priors, parent, TRIED_AT_LENGTH);
        match best_of(products, priors, longer.into_iter(), &best) {
            Some(next) => best = next,
            None => break,
        }
    }
    (best.log_posterior > first).then_some(best)
}

/// Backward elimination: removes candidates of a set one by one while the posterior rises.
pub fn prune(products: &InnerProducts, priors: &Priors, mut best: ScoredSet) -> ScoredSet {
    while let Some(next) = best_of(products, priors, shorter(&best.set), &best) {
        best = next;
    }
    best
}

/// A set without each of its candidates in turn.
fn shorter(set: &[usize]) -> impl Iterator<Item = Vec<usize>> {
    (0..set.len()).map(|index| [&set[..index], &set[index + 1..]].concat())
}

/// Exchanges candidates of a set one by one while the posterior rises: an early one may have stood for another.
pub fn exchange(products: &InnerProducts, priors: &Priors, mut best: ScoredSet) -> ScoredSet {
    for _ in 0..EXCHANGES {
        let rests: Vec<(Vec<usize>, Variances)> = (shorter(&best.set))
            .map(|rest| {
                let variances = products.variances(&rest);
                (rest, variances)
            })
            .collect();
        let parents = rests
            .iter()
            .map(|(rest, variances)| (rest.as_slice(), variances));
        let others = children(products, priors, parents, TRIED).into_iter();
        let most = TRIED_AT_LENGTH * best.set.len();
        match best_of(products, priors, others.take(most), &best) {
            Some(next) => best = next,
            None => break,
        }
    }
    best
}

/// Improves the best sets of a search by exchanging single candidates; best first again.
pub fn exchange_best(products: &InnerProducts, priors: &Priors, scored: &mut Vec<ScoredSet>) {
    let best: Vec<ScoredSet> = scored.iter().take(EXCHANGED).cloned().collect();
    for start in best {
        let before = start.log_posterior;
        let better = exchange(products, priors, start);
        if better.log_posterior > before && scored.iter().all(|known| known.set != better.set) {
            scored.push(better);
        }
    }
    scored.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
}

/// Default width of the beam.
pub fn default_beam_width() -> usize {
    BEAM
}

#[cfg(test)]
mod tests {
    use rand::seq::index::sample;
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    const ROWS: usize = 100;

    /// Forty effects that share a third of their columns' power with their neighbours, some of them with near-duplicates: the
    /// shapes next to one another of a scan. One to four act. The true set is planted: the search, which does not know it,
    /// answers with one that is no less probable.
    #[test]
    fn the_answer_is_no_worse_than_the_set_that_acts() {
        let mut random = Pcg64Mcg::seed_from_u64(496);
        for trial in 0..40 {
            let mut blocks: Vec<Vec<Vec<f64>>> = Vec::new();
            let mut effect = Vec::new();
            let mut last = column(&mut random);
            for number in 0..40 {
                let fresh = column(&mut random);
                let mixed: Vec<f64> = (last.iter().zip(&fresh))
                    .map(|(last, fresh)| 0.58 * last + 0.81 * fresh)
                    .collect();
                for _ in 0..if number % 4 == 0 { 6 } else { 0 } {
                    let apart = column(&mut random);
                    let near = mixed
                        .iter()
                        .zip(&apart)
                        .map(|(one, other)| one + 0.05 * other);
                    blocks.push(vec![near.collect()]);
                    effect.push(number);
                }
                blocks.push(vec![mixed.clone()]);
                effect.push(number);
                last = mixed;
            }
            let acting = sample(&mut random, 40, 1 + trial % 4);
            let mut planted: Vec<usize> = (acting.iter())
                .map(|number| {
                    effect
                        .iter()
                        .rposition(|own| *own == number)
                        .expect("one each")
                })
                .collect();
            planted.sort_unstable();
            let mut y: Vec<f64> = (0..ROWS)
                .map(|_| 1e-6 * random.sample::<f64, _>(StandardNormal))
                .collect();
            for &member in &planted {
                let size = 1e-6 * random.random_range(40.0..300.0);
                for (y, value) in y.iter_mut().zip(&blocks[member][0]) {
                    *y += size * value;
                }
            }
            let views: Vec<&[Vec<f64>]> = blocks.iter().map(Vec::as_slice).collect();
            let products = InnerProducts::new(&views, &y, &[true; ROWS]);
            let priors = Priors {
                log_prior: effect
                    .iter()
                    .map(|own| if own % 4 == 0 { -(7.0_f64.ln()) } else { 0.0 })
                    .collect(),
                effect,
                effects: 40,
            };
            let mut found = search(
                &products,
                &priors,
                default_beam_width(),
                &mut EvidenceCache::new(),
            );
            exchange_best(&products, &priors, &mut found);
            let of_planted = products.log_evidence(&planted) + priors.log_prior_of(&planted);
            assert!(
                found[0].log_posterior > of_planted - 1e-9,
                "{trial}: {planted:?} at {of_planted} is better than {:?}",
                found[0]
            );
        }
    }

    /// A column of unit length.
    fn column(random: &mut Pcg64Mcg) -> Vec<f64> {
        let values = (0..ROWS).map(|_| random.sample::<f64, _>(StandardNormal));
        values.map(|value| value / (ROWS as f64).sqrt()).collect()
    }
}
