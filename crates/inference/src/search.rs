//! Search for probable sets of candidates.
//!
//! Beam search up to [`MOST_EFFECTS`]; at each level only the sets with the best estimates ([`crate::evidence_gain`]) are
//! solved. The prior halves with each effect and is uniform over the sets of one size, so that a larger library is paid for.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use crate::evidence::{Products, Variances};
use crate::evidence_gain::EvidenceGain;

/// Most effects in a set.
pub const MOST_EFFECTS: usize = 5;
/// Most effects in a set that grows one by one.
const MOST_AT_LENGTH: usize = 32;
/// Sets kept at each size.
const BEAM: usize = 24;
/// Candidates tried on each kept set.
const TRIED: usize = 14;
/// This many times as many are estimated after screening.
const ESTIMATED: usize = 2;
/// Candidates tried on a set that grows one by one.
const TRIED_AT_LENGTH: usize = 6;
/// Exchanges of a set that grows one by one, at most.
const EXCHANGES: usize = 12;
/// A level whose best log posterior is this far behind the best of all ends the search.
const HOPELESS: f64 = 25.0;

/// A set of candidates and its log posterior (not normalised).
#[derive(Debug, Clone)]
pub struct Scored {
    /// Candidates, ascending.
    pub set: Vec<usize>,
    /// Log evidence plus log prior.
    pub score: f64,
}

/// Prior probabilities of the candidates.
#[derive(Debug, Clone)]
pub struct Priors {
    /// Effect of each candidate, as a number: two of one effect never stand in a set.
    pub effect: Vec<usize>,
    /// Log prior of each candidate within its effect.
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
    products: &Products,
    priors: &Priors,
    beam: usize,
    known: &mut EvidenceCache,
) -> Vec<Scored> {
    let mut score = |set: Vec<usize>| {
        let variances =
            (known.entry(set.clone())).or_insert_with_key(|set| products.variances(set));
        let score = variances.log_evidence + priors.log_prior_of(&set);
        (Scored { set, score }, variances.clone())
    };
    let empty = score(Vec::new());
    let mut best = empty.0.score;
    let mut all = vec![empty.0.clone()];
    let mut level = vec![empty];
    for size in 1..=MOST_EFFECTS {
        let (tried, solved, kept) = match size {
            1 => (usize::MAX, usize::MAX, 2 * beam),
            _ => (TRIED, 2 * beam, beam),
        };
        let parents = level
            .iter()
            .map(|(parent, variances)| (&*parent.set, variances));
        let mut next: Vec<(Scored, Variances)> = (children(products, priors, parents, tried))
            .into_iter()
            .take(solved)
            .map(&mut score)
            .collect();
        next.sort_by(|a, b| b.0.score.total_cmp(&a.0.score));
        let Some(leader) = next.first().map(|(scored, _)| scored.score) else {
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
    all.sort_by(|a, b| b.score.total_cmp(&a.score));
    all
}

/// Sets of one candidate more than those of `parents`, best estimate first; at most `tried` of each parent.
fn children<'p>(
    products: &Products,
    priors: &Priors,
    parents: impl Iterator<Item = (&'p [usize], &'p Variances)>,
    tried: usize,
) -> Vec<Vec<usize>> {
    let mut estimated: Vec<(f64, Vec<usize>)> = Vec::new();
    let mut ranked: Vec<(f64, usize)> = Vec::new();
    for (set, variances) in parents {
        let Some(mut gain) = EvidenceGain::new(products, set, variances) else {
            continue;
        };
        let effects: Vec<usize> = set.iter().map(|&member| priors.effect[member]).collect();
        let prior = priors.log_prior_of_size(set.len() + 1) + priors.log_prior_of_members(set);
        let others = (0..products.spans.len())
            .filter(|&candidate| !effects.contains(&priors.effect[candidate]));
        ranked.clear();
        ranked.extend(others.map(|candidate| (gain.explained_share(candidate), candidate)));
        keep(&mut ranked, tried.saturating_mul(ESTIMATED));
        ranked.retain_mut(|(worth, candidate)| {
            let evidence = gain.log_evidence_with(*candidate);
            *worth = evidence.unwrap_or_default() + priors.log_prior[*candidate];
            evidence.is_some()
        });
        keep(&mut ranked, tried);
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

/// Keeps the best, in any order.
fn keep(ranked: &mut Vec<(f64, usize)>, most: usize) {
    if most < ranked.len() {
        ranked.select_nth_unstable_by(most, better);
        ranked.truncate(most);
    }
}

/// Larger first, then by index.
fn better(a: &(f64, usize), b: &(f64, usize)) -> Ordering {
    b.0.total_cmp(&a.0).then(a.1.cmp(&b.1))
}

/// The best of some sets, if it is better than `best`.
fn best_of(
    products: &Products,
    priors: &Priors,
    sets: impl Iterator<Item = Vec<usize>>,
    best: &Scored,
) -> Option<Scored> {
    sets.map(|set| Scored {
        score: products.log_evidence(&set) + priors.log_prior_of(&set),
        set,
    })
    .max_by(|a, b| a.score.total_cmp(&b.score))
    .filter(|next| next.score > best.score)
}

/// Forward selection: adds candidates to a set one by one while the posterior rises; `None` when none does.
pub fn extend(products: &Products, priors: &Priors, start: &[usize]) -> Option<Scored> {
    let first = products.log_evidence(start) + priors.log_prior_of(start);
    let mut best = Scored {
        set: start.to_vec(),
        score: first,
    };
    while best.set.len() < MOST_AT_LENGTH {
        let variances = products.variances(&best.set);
        let parent = std::iter::once((best.set.as_slice(), &variances));
        let longer = children(products, priors, parent, TRIED_AT_LENGTH);
        match best_of(products, priors, longer.into_iter(), &best) {
            Some(next) => best = next,
            None => break,
        }
    }
    (best.score > first).then_some(best)
}

/// Backward elimination: removes candidates of a set one by one while the posterior rises.
pub fn prune(products: &Products, priors: &Priors, mut best: Scored) -> Scored {
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
pub fn exchange(products: &Products, priors: &Priors, mut best: Scored) -> Scored {
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

/// Default width of the beam.
pub fn default_beam_width() -> usize {
    BEAM
}
