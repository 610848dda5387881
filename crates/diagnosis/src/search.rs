//! The search over sets of candidates: which sets are probable, none tried by hand.
//!
//! Beam search up to five effects; of each level only the best are solved, after a look at all ([`crate::growth`]). The
//! prior halves with each effect and is spread evenly over the sets of that size, so that a larger library is paid for.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use crate::evidence::{Products, Sized};
use crate::growth::Growth;

/// Most effects in a set.
pub const MOST_EFFECTS: usize = 5;
/// Most effects in a set that grows one by one.
const MOST_AT_LENGTH: usize = 32;
/// Sets kept at each size.
const BEAM: usize = 24;
/// Candidates tried on each kept set.
const TRIED: usize = 14;
/// So many times as many are looked at more closely.
const LOOKED: usize = 2;
/// Candidates tried on a set that grows one by one.
const TRIED_AT_LENGTH: usize = 6;
/// Exchanges of a set that grows one by one, at most.
const EXCHANGES: usize = 12;
/// A level whose best set lies this far (natural log) behind the best of all ends the search.
const HOPELESS: f64 = 25.0;

/// A set of candidates and its log posterior (not normalised).
#[derive(Debug, Clone)]
pub struct Scored {
    /// Candidates, ascending.
    pub set: Vec<usize>,
    /// Log evidence plus log prior.
    pub score: f64,
}

/// What the search needs to know of the candidates.
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
    pub fn of(&self, set: &[usize]) -> f64 {
        self.of_size(set.len()) + self.of_members(set)
    }

    /// Log prior probability of one set of `size` effects.
    fn of_size(&self, size: usize) -> f64 {
        let choices: f64 = (0..size)
            .map(|k| ((self.effects.max(size) - k) as f64 / (k + 1) as f64).ln())
            .sum();
        -std::f64::consts::LN_2 * (size as f64 + 1.0) - choices
    }

    /// Log prior probability of the members within their effects.
    fn of_members(&self, set: &[usize]) -> f64 {
        set.iter().map(|&member| self.log_prior[member]).sum()
    }
}

/// What the sets that were looked at already are worth.
pub(crate) type Known = BTreeMap<Vec<usize>, Sized>;

/// Scored sets, best first; what is `known` of the same products is not computed again.
pub(crate) fn search(
    products: &Products,
    priors: &Priors,
    beam: usize,
    known: &mut Known,
) -> Vec<Scored> {
    let mut score = |set: Vec<usize>| {
        let sized = (known.entry(set.clone())).or_insert_with_key(|set| products.sized(set));
        let score = sized.log_evidence + priors.of(&set);
        (Scored { set, score }, sized.clone())
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
        let parents = level.iter().map(|(parent, sized)| (&*parent.set, sized));
        let mut next: Vec<(Scored, Sized)> = (children(products, priors, parents, tried))
            .into_iter()
            .take(solved)
            .map(&mut score)
            .collect();
        next.sort_by(|one, other| other.0.score.total_cmp(&one.0.score));
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
    all.sort_by(|one, other| other.score.total_cmp(&one.score));
    all
}

/// Sets of one candidate more than those of `parents`, best first by a look at each; `tried` of each parent at most.
fn children<'p>(
    products: &Products,
    priors: &Priors,
    parents: impl Iterator<Item = (&'p [usize], &'p Sized)>,
    tried: usize,
) -> Vec<Vec<usize>> {
    let mut looked: Vec<(f64, Vec<usize>)> = Vec::new();
    let mut ranked: Vec<(f64, usize)> = Vec::new();
    for (set, sized) in parents {
        let Some(mut growth) = Growth::new(products, set, sized) else {
            continue;
        };
        let effects: Vec<usize> = set.iter().map(|&member| priors.effect[member]).collect();
        let prior = priors.of_size(set.len() + 1) + priors.of_members(set);
        let others = (0..products.spans.len())
            .filter(|&candidate| !effects.contains(&priors.effect[candidate]));
        ranked.clear();
        ranked.extend(others.map(|candidate| (growth.share(candidate), candidate)));
        keep(&mut ranked, tried.saturating_mul(LOOKED));
        ranked.retain_mut(|(worth, candidate)| {
            let evidence = growth.with(*candidate);
            *worth = evidence.unwrap_or_default() + priors.log_prior[*candidate];
            evidence.is_some()
        });
        keep(&mut ranked, tried);
        looked.extend(ranked.iter().map(|&(worth, candidate)| {
            let mut child = Vec::with_capacity(set.len() + 1);
            child.extend_from_slice(set);
            child.insert(set.partition_point(|&member| member < candidate), candidate);
            (prior + worth, child)
        }));
    }
    // The same set from several parents is looked at from each.
    looked.sort_by(|one, other| one.1.cmp(&other.1).then(other.0.total_cmp(&one.0)));
    looked.dedup_by(|one, other| one.1 == other.1);
    looked.sort_by(|one, other| other.0.total_cmp(&one.0).then_with(|| one.1.cmp(&other.1)));
    looked.into_iter().map(|(_, set)| set).collect()
}

/// Keeps the best, in any order.
fn keep(ranked: &mut Vec<(f64, usize)>, most: usize) {
    if most < ranked.len() {
        ranked.select_nth_unstable_by(most, better);
        ranked.truncate(most);
    }
}

/// Larger first, then by place.
fn better(one: &(f64, usize), other: &(f64, usize)) -> Ordering {
    other.0.total_cmp(&one.0).then(one.1.cmp(&other.1))
}

/// The best of some sets, if it is better than `best`.
fn best_of(
    products: &Products,
    priors: &Priors,
    sets: impl Iterator<Item = Vec<usize>>,
    best: &Scored,
) -> Option<Scored> {
    sets.map(|set| Scored {
        score: products.log_evidence(&set) + priors.of(&set),
        set,
    })
    .max_by(|one, other| one.score.total_cmp(&other.score))
    .filter(|next| next.score > best.score)
}

/// Adds candidates to a set one by one while the posterior rises; `None` when none does.
pub fn extend(products: &Products, priors: &Priors, start: &[usize]) -> Option<Scored> {
    let first = products.log_evidence(start) + priors.of(start);
    let mut best = Scored {
        set: start.to_vec(),
        score: first,
    };
    while best.set.len() < MOST_AT_LENGTH {
        let sized = products.sized(&best.set);
        let parent = std::iter::once((best.set.as_slice(), &sized));
        let longer = children(products, priors, parent, TRIED_AT_LENGTH);
        match best_of(products, priors, longer.into_iter(), &best) {
            Some(next) => best = next,
            None => break,
        }
    }
    (best.score > first).then_some(best)
}

/// Takes candidates out of a set one by one while the posterior rises.
pub fn prune(products: &Products, priors: &Priors, mut best: Scored) -> Scored {
    while let Some(next) = best_of(products, priors, shorter(&best.set), &best) {
        best = next;
    }
    best
}

/// A set less each of its candidates.
fn shorter(set: &[usize]) -> impl Iterator<Item = Vec<usize>> {
    (0..set.len()).map(|place| [&set[..place], &set[place + 1..]].concat())
}

/// Exchanges candidates of a set one by one while the posterior rises: what came in early may have stood for another.
pub fn exchange(products: &Products, priors: &Priors, mut best: Scored) -> Scored {
    for _ in 0..EXCHANGES {
        let rests: Vec<(Vec<usize>, Sized)> = (shorter(&best.set))
            .map(|rest| {
                let sized = products.sized(&rest);
                (rest, sized)
            })
            .collect();
        let parents = rests.iter().map(|(rest, sized)| (rest.as_slice(), sized));
        let others = children(products, priors, parents, TRIED).into_iter();
        let most = TRIED_AT_LENGTH * best.set.len();
        match best_of(products, priors, others.take(most), &best) {
            Some(next) => best = next,
            None => break,
        }
    }
    best
}

/// The usual width of the search.
pub fn usual_beam() -> usize {
    BEAM
}
