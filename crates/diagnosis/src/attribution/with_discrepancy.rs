//! Scores effect sets with an added discrepancy term: every explanation with something unknown in it.
//!
//! A set of effects leaves residuals; a Gaussian-process discrepancy (Kennedy and O'Hagan 2001; Rasmussen and Williams 2006, ch. 5
//! for the evidence) models what remains. Three passes, each over fewer discrepancies: screening at the prior variances that
//! the sets have without any, evidence of the best sets at neighbouring variances of the process, and a new search over the
//! library beside the best discrepancies. Metres.

use std::rc::Rc;

use effects::discrepancy::is_kin;
use inference::discrepancy::{Discrepancy, Kind};
use inference::evidence::Products;
use inference::posterior::Model;
use inference::search::{EvidenceCache, Priors, Scored, search};
use inference::whitened::Design;

use super::candidate_pool::CandidatePool;

/// Prior probability that something outside the vocabulary acts.
pub(crate) const UNKNOWN: f64 = 0.05;
/// Variances of a discrepancy over that of the noise that are tried.
const POWERS: [f64; 9] = [0.3, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0, 4096.0, 16384.0];
/// Largest variance ratio of a touch that is still noise: eight times the standard deviation of the others.
const NOISY: f64 = 64.0;
/// Discrepancies whose log score is this far behind the best are not searched further.
const FAR_BEHIND: f64 = 7.0;
/// Discrepancies whose log score after screening, where neither variances nor sets are optimal, is this far behind the best
/// are dropped.
const SCREENED_OUT: f64 = 16.0;
/// Discrepancies that pass the screening at most.
const SCREENED: usize = 10;
/// Discrepancies beside which the library is searched anew at most.
const SEARCHED: usize = 6;
/// Beam width of that search.
const SEARCH_BEAM: usize = 6;
/// Models of that search that are kept.
const SEARCH_KEPT: usize = 60;
/// Best sets that are scored with each discrepancy.
const SETS: usize = 12;
/// Sets that are screened, each of another size.
const SCREENING_SETS: usize = 5;

/// What an effect pays (natural log) beside a discrepancy of its own kind: either describes the same thing.
const KIN: f64 = 12.0;

/// Models of effect sets with each of the discrepancies; `best` is the log score of the best model without any.
pub(crate) fn score_with_discrepancies(
    pool: &CandidatePool<'_>,
    scored: &[Scored],
    discrepancies: &[Rc<Discrepancy>],
    priors: &Priors,
    mut best: f64,
) -> Vec<Model> {
    let scorer = Scorer {
        pool,
        discrepancies,
        priors,
    };
    let subset = CandidateSubset::new(pool, reduced_sets(scored));
    let mut models: Vec<Model> = Vec::new();
    let mut promising: Vec<(f64, usize, f64)> = Vec::new();
    for screened in scorer.screen(scored, best) {
        let found = scorer.evaluate(&subset, &screened);
        if let Some((score, power)) = best_power(&found) {
            best = best.max(score);
            promising.push((score, screened.index, power));
        }
        models.extend(found);
    }
    promising.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut design = None;
    for (score, index, power) in promising.into_iter().take(SEARCHED) {
        if score < best - FAR_BEHIND {
            break;
        }
        let design =
            design.get_or_insert_with(|| Design::new(pool.candidates.iter(), pool.y, pool.active));
        let found = scorer.search(design, index, power);
        best = found.iter().map(|model| model.score).fold(best, f64::max);
        models.extend(found);
    }
    models
}

/// Score and variance ratio of the best of some models with a discrepancy, the first of equals.
fn best_power(models: &[Model]) -> Option<(f64, f64)> {
    let mut best: Option<(f64, f64)> = None;
    for model in models {
        let (_, power) = model.discrepancy?;
        if best.is_none_or(|(score, _)| model.score > score) {
            best = Some((model.score, power));
        }
    }
    best
}

/// A discrepancy that passed the screening.
struct Screened {
    score: f64,
    index: usize,
    /// Index of its best variance among those that are tried.
    power: usize,
}

/// Scores sets with discrepancies.
struct Scorer<'a> {
    pool: &'a CandidatePool<'a>,
    discrepancies: &'a [Rc<Discrepancy>],
    priors: &'a Priors,
}

impl Scorer<'_> {
    /// Priors of the candidates beside a discrepancy.
    fn priors_with(&self, discrepancy: &Discrepancy) -> Priors {
        let mut priors = self.priors.clone();
        for (candidate, prior) in self.pool.candidates.iter().zip(&mut priors.log_prior) {
            let effect = &self.pool.shapes.variants[candidate.variant].effect;
            if is_kin(
                &self.pool.shapes.observations.chain,
                &discrepancy.kind,
                effect,
            ) {
                *prior -= KIN;
            }
        }
        priors
    }

    /// Discrepancies worth a closer look, best first: the best set of each size at the prior variances that it has without.
    fn screen(&self, scored: &[Scored], best: f64) -> Vec<Screened> {
        let mut sets: Vec<Vec<usize>> = Vec::new();
        for scored in scored {
            if sets.iter().all(|set| set.len() != scored.set.len()) {
                sets.push(scored.set.clone());
            }
            if sets.len() == SCREENING_SETS {
                break;
            }
        }
        let subset = CandidateSubset::new(self.pool, sets);
        let sets: Vec<(&FittedSet, f64)> = (subset.sets.iter())
            .map(|fitted| (fitted, self.priors.log_prior_of(&fitted.set)))
            .collect();
        let mut screened: Vec<Screened> = Vec::new();
        for (index, discrepancy) in self.discrepancies.iter().enumerate() {
            let whitened = subset.design.with_discrepancy(discrepancy);
            let mut best: Option<Screened> = None;
            for (power, &value) in powers(discrepancy).iter().enumerate() {
                let products = whitened.products(value, &subset.plain);
                for (fitted, prior) in &sets {
                    let score =
                        fitted.log_evidence(&products) + prior + log_prior_with(discrepancy);
                    if best.as_ref().is_none_or(|known| score > known.score) {
                        best = Some(Screened {
                            score,
                            index,
                            power,
                        });
                    }
                }
            }
            screened.extend(best);
        }
        screened.sort_by(|a, b| b.score.total_cmp(&a.score));
        let best = screened.first().map_or(best, |first| first.score.max(best));
        screened.truncate(SCREENED);
        screened.retain(|screened| screened.score > best - SCREENED_OUT);
        screened
    }

    /// Models of the best sets with a discrepancy, at the variance that screening found best and its neighbours.
    fn evaluate(&self, subset: &CandidateSubset, screened: &Screened) -> Vec<Model> {
        let discrepancy = &self.discrepancies[screened.index];
        let priors = self.priors_with(discrepancy);
        let whitened = subset.design.with_discrepancy(discrepancy);
        let powers = powers(discrepancy);
        let neighbours = screened.power.saturating_sub(1)..(screened.power + 2).min(powers.len());
        let mut models = Vec::new();
        for &power in &powers[neighbours] {
            let products = whitened.products(power, &subset.plain);
            // Only the best at the variances that they have without the discrepancy are solved.
            let mut estimates: Vec<(f64, &FittedSet)> = (subset.sets.iter())
                .map(|fitted| {
                    let prior = priors.log_prior_of(&fitted.set);
                    (fitted.log_evidence(&products) + prior, fitted)
                })
                .collect();
            estimates.sort_by(|a, b| b.0.total_cmp(&a.0));
            models.extend(estimates.into_iter().take(SETS).map(|(_, fitted)| Model {
                set: fitted.set.clone(),
                discrepancy: Some((screened.index, power)),
                probability: 0.0,
                score: products.log_evidence(&fitted.indices)
                    + priors.log_prior_of(&fitted.set)
                    + log_prior_with(discrepancy),
            }));
        }
        models
    }

    /// Models of a search over the whole library beside a discrepancy of variance `power` over the noise.
    fn search(&self, design: &Design, index: usize, power: f64) -> Vec<Model> {
        let discrepancy = &self.discrepancies[index];
        let products = design
            .with_discrepancy(discrepancy)
            .products(power, &self.pool.products);
        let priors = self.priors_with(discrepancy);
        search(&products, &priors, SEARCH_BEAM, &mut EvidenceCache::new())
            .into_iter()
            .take(SEARCH_KEPT)
            .map(|found| Model {
                set: found.set,
                discrepancy: Some((index, power)),
                probability: 0.0,
                score: found.score + log_prior_with(discrepancy),
            })
            .collect()
    }
}

/// The candidates of some sets only: projecting the whole library onto every discrepancy would cost too much.
struct CandidateSubset {
    design: Design,
    /// Products without a discrepancy.
    plain: Products,
    /// Those sets that can be solved.
    sets: Vec<FittedSet>,
}

impl CandidateSubset {
    fn new(pool: &CandidatePool<'_>, sets: Vec<Vec<usize>>) -> Self {
        let mut members: Vec<usize> = sets.iter().flatten().copied().collect();
        members.sort_unstable();
        members.dedup();
        let candidates = members.iter().map(|&member| &pool.candidates[member]);
        let plain = pool.products.subset(&members);
        let fitted = |set: Vec<usize>| {
            let indices: Vec<usize> = (set.iter())
                .map(|member| members.partition_point(|other| other < member))
                .collect();
            let prior_variances = plain.fit(&indices)?.prior_variances;
            Some(FittedSet {
                set,
                indices,
                prior_variances,
            })
        };
        Self {
            design: Design::new(candidates, pool.y, pool.active),
            sets: sets.into_iter().filter_map(fitted).collect(),
            plain,
        }
    }
}

/// A set with the prior variances that it has without a discrepancy.
struct FittedSet {
    set: Vec<usize>,
    /// Indices of its candidates within the subset.
    indices: Vec<usize>,
    prior_variances: Vec<f64>,
}

impl FittedSet {
    /// Log evidence at these prior variances.
    fn log_evidence(&self, products: &Products) -> f64 {
        products.log_evidence_at_variances(&self.indices, &self.prior_variances)
    }
}

/// Variances over the noise that are tried for a discrepancy.
fn powers(discrepancy: &Discrepancy) -> &'static [f64] {
    let tried = match discrepancy.kind {
        Kind::Noise => POWERS.iter().take_while(|&&power| power <= NOISY).count(),
        _ => POWERS.len(),
    };
    &POWERS[..tried]
}

/// Log prior of a discrepancy at one of the tried variances.
fn log_prior_with(discrepancy: &Discrepancy) -> f64 {
    let prior = match discrepancy.kind {
        // The readings themselves show the grid.
        Kind::Grid => 0.5_f64.ln(),
        Kind::Noise => discrepancy.log_prior,
        _ => discrepancy.log_prior + UNKNOWN.ln(),
    };
    prior - (POWERS.len() as f64).ln()
}

/// The empty set, the best sets, and each of these without one of its effects.
fn reduced_sets(scored: &[Scored]) -> Vec<Vec<usize>> {
    let mut sets: Vec<Vec<usize>> = vec![Vec::new()];
    for scored in scored.iter().take(SETS) {
        for removed in 0..=scored.set.len() {
            let mut reduced = scored.set.clone();
            if removed < reduced.len() {
                reduced.remove(removed);
            }
            if !sets.contains(&reduced) {
                sets.push(reduced);
            }
        }
    }
    sets
}
