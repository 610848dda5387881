//! The search over sets of candidates: which sets are probable, none tried by hand.
//!
//! Beam search up to five effects, each level screened by what a candidate would still explain. The prior halves with
//! each effect and is spread evenly over the sets of that size, so that a larger library is paid for.

use std::collections::{BTreeMap, BTreeSet};

use crate::evidence::{Products, cholesky, forward};

/// Most effects in a set.
pub const MOST_EFFECTS: usize = 5;
/// Most effects in a set that grows one by one.
const MOST_AT_LENGTH: usize = 32;
/// Sets kept at each size.
const BEAM: usize = 24;
/// Candidates tried on each kept set.
const TRIED: usize = 14;
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
        let size = set.len() as f64;
        let mut choices = 0.0;
        for k in 0..set.len() {
            choices += ((self.effects.max(set.len()) - k) as f64 / (k + 1) as f64).ln();
        }
        -std::f64::consts::LN_2 * (size + 1.0) - choices
            + set.iter().map(|&j| self.log_prior[j]).sum::<f64>()
    }
}

/// Log evidence of the sets that were looked at already.
pub(crate) type Known = BTreeMap<Vec<usize>, f64>;

/// Scored sets, best first; what is `known` of the same products is not computed again.
pub(crate) fn search(
    products: &Products,
    priors: &Priors,
    beam: usize,
    known: &mut Known,
) -> Vec<Scored> {
    let empty = Scored {
        set: Vec::new(),
        score: products.log_evidence(&[]) + priors.of(&[]),
    };
    let mut best = empty.score;
    let mut all = vec![empty.clone()];
    let mut level = vec![empty];
    let mut seen = BTreeSet::new();
    for size in 1..=MOST_EFFECTS {
        let mut next: Vec<Scored> = Vec::new();
        let tried = if size == 1 { usize::MAX } else { TRIED };
        for parent in &level {
            for candidate in promising(products, priors, &parent.set, tried) {
                let mut set = parent.set.clone();
                set.push(candidate);
                set.sort_unstable();
                if seen.insert(set.clone()) {
                    let evidence = *(known.entry(set.clone()))
                        .or_insert_with_key(|set| products.log_evidence(set));
                    let score = evidence + priors.of(&set);
                    next.push(Scored { set, score });
                }
            }
        }
        next.sort_by(|one, other| other.score.total_cmp(&one.score));
        let Some(leader) = next.first().map(|scored| scored.score) else {
            break;
        };
        best = best.max(leader);
        all.extend(next.iter().take(4 * beam.max(BEAM)).cloned());
        next.truncate(if size == 1 { 2 * beam } else { beam });
        level = next;
        if size > 1 && leader < best - HOPELESS {
            break;
        }
    }
    all.sort_by(|one, other| other.score.total_cmp(&one.score));
    all
}

/// Adds candidates to a set one by one while the posterior rises; `None` when none does.
pub fn extend(products: &Products, priors: &Priors, start: &[usize]) -> Option<Scored> {
    let score = |set: &[usize]| products.log_evidence(set) + priors.of(set);
    let first = score(start);
    let mut best = Scored {
        set: start.to_vec(),
        score: first,
    };
    while best.set.len() < MOST_AT_LENGTH {
        let trials = promising(products, priors, &best.set, TRIED_AT_LENGTH)
            .into_iter()
            .map(|candidate| {
                let mut set = best.set.clone();
                set.push(candidate);
                set.sort_unstable();
                let score = score(&set);
                Scored { set, score }
            });
        match trials.max_by(|one, other| one.score.total_cmp(&other.score)) {
            Some(next) if next.score > best.score => best = next,
            _ => break,
        }
    }
    (best.score > first).then_some(best)
}

/// Takes candidates out of a set one by one while the posterior rises.
pub fn prune(products: &Products, priors: &Priors, mut best: Scored) -> Scored {
    loop {
        let trials = (0..best.set.len()).map(|place| {
            let mut set = best.set.clone();
            set.remove(place);
            let score = products.log_evidence(&set) + priors.of(&set);
            Scored { set, score }
        });
        match trials.max_by(|one, other| one.score.total_cmp(&other.score)) {
            Some(next) if next.score > best.score => best = next,
            _ => return best,
        }
    }
}

/// Exchanges candidates of a set one by one while the posterior rises: what came in early may have stood for another.
pub fn exchange(products: &Products, priors: &Priors, mut best: Scored) -> Scored {
    for _ in 0..EXCHANGES {
        let trials = (0..best.set.len()).flat_map(|place| {
            let mut rest = best.set.clone();
            rest.remove(place);
            let others = promising(products, priors, &rest, TRIED).into_iter();
            others.map(move |candidate| {
                let mut set = rest.clone();
                set.push(candidate);
                set.sort_unstable();
                let score = products.log_evidence(&set) + priors.of(&set);
                Scored { set, score }
            })
        });
        match trials.max_by(|one, other| one.score.total_cmp(&other.score)) {
            Some(next) if next.score > best.score => best = next,
            _ => break,
        }
    }
    best
}

/// The usual width of the search.
pub fn usual_beam() -> usize {
    BEAM
}

/// Candidates that would explain most of what the set leaves, best first.
fn promising(products: &Products, priors: &Priors, set: &[usize], most: usize) -> Vec<usize> {
    let count = products.qy.len();
    let columns: Vec<usize> = set
        .iter()
        .flat_map(|&j| products.spans[j].0..products.spans[j].0 + products.spans[j].1)
        .collect();
    let n = columns.len();
    let mut factor = vec![0.0; n * n];
    for (i, &a) in columns.iter().enumerate() {
        for (k, &b) in columns.iter().enumerate() {
            factor[i * n + k] = products.qq[a * count + b];
        }
        factor[i * n + i] += 1e-6;
    }
    if cholesky(&mut factor, n).is_none() {
        return Vec::new();
    }
    // With the factor L of the set's products: what the set leaves of a column c is c·c − |L⁻¹c|², of y against it
    // c·y − (L⁻¹c)·(L⁻¹y).
    let mut seen: Vec<f64> = columns.iter().map(|&a| products.qy[a]).collect();
    forward(&factor, n, &mut seen);
    let mut ranked: Vec<(f64, usize)> = Vec::new();
    let mut cross = vec![0.0; n];
    for candidate in 0..products.spans.len() {
        if set
            .iter()
            .any(|&member| priors.effect[member] == priors.effect[candidate])
        {
            continue;
        }
        let (first, width) = products.spans[candidate];
        let mut gain = 0.0;
        for column in first..first + width {
            for (value, &a) in cross.iter_mut().zip(&columns) {
                *value = products.qq[column * count + a];
            }
            forward(&factor, n, &mut cross);
            let left =
                products.qy[column] - cross.iter().zip(&seen).map(|(x, y)| x * y).sum::<f64>();
            let free =
                products.qq[column * count + column] - cross.iter().map(|x| x * x).sum::<f64>();
            if free > 1e-5 {
                gain += left * left / free;
            }
        }
        ranked.push((gain, candidate));
    }
    ranked.sort_by(|one, other| other.0.total_cmp(&one.0).then(one.1.cmp(&other.1)));
    ranked
        .into_iter()
        .take(most)
        .map(|(_, candidate)| candidate)
        .collect()
}
