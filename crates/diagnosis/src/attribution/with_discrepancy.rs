//! Scores effect sets with an added discrepancy term: every explanation with something unknown in it.
//!
//! A set of effects leaves residuals; a Gaussian-process discrepancy (Kennedy and O'Hagan 2001; Rasmussen and Williams 2006, ch. 5
//! for the evidence) models what remains. Three passes, each over fewer discrepancies: screening with the sizes that the sets
//! have without any, evidence of the best sets at all variances of the process, and a new search over the library beside the
//! best discrepancies, at the variance that is best for what the search found. Metres.

use std::iter;
use std::rc::Rc;

use effects::discrepancy::is_kin;
use inference::discrepancy::{Discrepancy, Kind};
use inference::evidence::InnerProducts;
use inference::posterior::Model;
use inference::search::{EvidenceCache, Priors, ScoredSet, exchange_best, search};
use inference::whitened::Design;
use nalgebra::DMatrix;

use super::candidate_pool::CandidatePool;
use super::without_each;

/// Prior probability that something outside the vocabulary acts.
pub(crate) const UNKNOWN: f64 = 0.05;
/// Variances of a discrepancy over that of the noise that are tried.
const POWERS: [f64; 9] = [0.3, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0, 4096.0, 16384.0];
/// Largest variance ratio of a touch that is still noise: eight times the standard deviation of the others.
const NOISY: f64 = 64.0;
/// Discrepancies whose log posterior is this far behind the best are not searched further.
const FAR_BEHIND: f64 = 7.0;
/// Discrepancies whose log posterior after screening, where neither variances nor sets are optimal, is this far behind the best
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
/// Best sets that are scored with each discrepancy at the variance that screening found best and its neighbours.
const SETS: usize = 12;
/// The same at the other variances.
const SETS_ELSEWHERE: usize = 4;
/// Variances at which a search is made for one discrepancy, at most.
const POWERS_SEARCHED: usize = 3;
/// Sets that are screened, each of another size.
const SCREENING_SETS: usize = 5;

/// What an effect pays (natural log) beside a discrepancy of its own kind, since either describes the same thing: about as much again as
/// its choice from the library.
const KIN: f64 = 5.0;

/// Models of effect sets with each of the discrepancies, whose numbers begin at `first`; `known` are scored already.
pub(crate) fn score_with_discrepancies(
    pool: &CandidatePool<'_>,
    scored: &[ScoredSet],
    discrepancies: &[Rc<Discrepancy>],
    first: usize,
    known: &[Model],
) -> Vec<Model> {
    let mut best = (known.iter())
        .map(|model| model.log_posterior)
        .fold(f64::NEG_INFINITY, f64::max);
    let scorer = Scorer::new(pool, discrepancies);
    let subset = CandidateSubset::new(pool, reduced_sets(scored));
    let mut models: Vec<Model> = Vec::new();
    let mut promising: Vec<(f64, usize, f64)> = Vec::new();
    for screened in scorer.screen(scored, best) {
        let found = scorer.evaluate(&subset, &screened);
        if let Some((log_posterior, power)) = best_power(&found) {
            best = best.max(log_posterior);
            promising.push((log_posterior, screened.index, power));
        }
        models.extend(found);
    }
    promising.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut design = None;
    for (log_posterior, index, power) in promising.into_iter().take(SEARCHED) {
        if log_posterior < best - FAR_BEHIND {
            break;
        }
        let design =
            design.get_or_insert_with(|| Design::new(pool.candidates.iter(), pool.y, &pool.rows()));
        let found = scorer.search(design, index, power);
        best = found
            .iter()
            .map(|model| model.log_posterior)
            .fold(best, f64::max);
        models.extend(found);
    }
    number_from(first, &mut models);
    models
}

/// Models of a search over the whole library, whose columns are the design, beside a discrepancy of this index, at one variance
/// over that of the noise.
pub(super) fn search_beside(
    pool: &CandidatePool<'_>,
    design: &Design,
    discrepancy: &Rc<Discrepancy>,
    (index, power): (usize, f64),
) -> Vec<Model> {
    let scorer = Scorer::new(pool, std::slice::from_ref(discrepancy));
    let priors = scorer.priors_with(discrepancy);
    let products = (design.with_discrepancy(discrepancy)).products(power, &pool.products);
    let mut found = search(&products, &priors, SEARCH_BEAM, &mut EvidenceCache::new());
    exchange_best(&products, &priors, &mut found);
    let model = |found: ScoredSet| Model {
        set: found.set,
        discrepancy: Some((index, power)),
        probability: 0.0,
        log_posterior: found.log_posterior,
    };
    found.into_iter().take(SEARCH_KEPT).map(model).collect()
}

/// Models of a search over the whole library beside one of some discrepancies, at first of this variance over that of the noise.
pub(super) fn search_anew(
    pool: &CandidatePool<'_>,
    discrepancies: &[Rc<Discrepancy>],
    (index, power): (usize, f64),
) -> Vec<Model> {
    let scorer = Scorer::new(pool, discrepancies);
    let design = Design::new(pool.candidates.iter(), pool.y, &pool.rows());
    scorer.search(&design, index, power)
}

/// Models of searches over the whole library beside the best of some discrepancies, whose numbers begin at `first`, however far
/// they are behind all others before: what hides an effect is found with it.
pub(super) fn search_beside_each(
    pool: &CandidatePool<'_>,
    scored: &[ScoredSet],
    discrepancies: &[Rc<Discrepancy>],
    first: usize,
) -> Vec<Model> {
    let scorer = Scorer::new(pool, discrepancies);
    let design = Design::new(pool.candidates.iter(), pool.y, &pool.rows());
    let mut models = Vec::new();
    for screened in scorer
        .screen(scored, f64::NEG_INFINITY)
        .into_iter()
        .take(SEARCHED)
    {
        let power = powers(&discrepancies[screened.index])[screened.power];
        models.extend(scorer.search(&design, screened.index, power));
    }
    number_from(first, &mut models);
    models
}

/// The largest of `count` values that rise and then fall, and its index: from the best of every third to its neighbours.
fn climb(count: usize, mut value: impl FnMut(usize) -> f64) -> (f64, usize) {
    let mut known: Vec<Option<f64>> = vec![None; count];
    let mut at = |index: usize| *known[index].get_or_insert_with(|| value(index));
    let mut best = (f64::NEG_INFINITY, 0);
    for index in (1..count).step_by(3) {
        let own = at(index);
        if own > best.0 {
            best = (own, index);
        }
    }
    loop {
        let neighbours = best.1.saturating_sub(1)..(best.1 + 2).min(count);
        let next = neighbours
            .map(|index| (at(index), index))
            .fold(
                best,
                |best, other| if other.0 > best.0 { other } else { best },
            );
        if next.1 == best.1 {
            return next;
        }
        best = next;
    }
}

/// Counts the discrepancies of some models from `first`.
fn number_from(first: usize, models: &mut [Model]) {
    for model in models {
        if let Some((index, _)) = &mut model.discrepancy {
            *index += first;
        }
    }
}

/// Log posterior and variance ratio of the best of some models with a discrepancy, the first of equals.
fn best_power(models: &[Model]) -> Option<(f64, f64)> {
    let mut best: Option<(f64, f64)> = None;
    for model in models {
        let (_, power) = model.discrepancy?;
        if best.is_none_or(|(log_posterior, _)| model.log_posterior > log_posterior) {
            best = Some((model.log_posterior, power));
        }
    }
    best
}

/// A discrepancy that passed the screening.
struct Screened {
    log_posterior: f64,
    index: usize,
    /// Index of its best variance among those that are tried.
    power: usize,
}

/// Scores sets with discrepancies.
struct Scorer<'a> {
    pool: &'a CandidatePool<'a>,
    discrepancies: &'a [Rc<Discrepancy>],
    priors: Priors,
}

impl<'a> Scorer<'a> {
    fn new(pool: &'a CandidatePool<'a>, discrepancies: &'a [Rc<Discrepancy>]) -> Self {
        Self {
            pool,
            discrepancies,
            priors: pool.priors(),
        }
    }

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

    /// Discrepancies worth a closer look, best first: the best set of each size with the sizes that it has without. Where there is a `best`
    /// log posterior so far, those whose score is positive in the residuals of none of these sets are left out.
    fn screen(&self, scored: &[ScoredSet], best: f64) -> Vec<Screened> {
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
        let residuals = subset.standardised_residuals();
        let shows = |discrepancy: &Discrepancy| {
            best == f64::NEG_INFINITY
                || (discrepancy.scores(&residuals).into_iter()).any(|score| score > 0.0)
        };
        let mut screened: Vec<Screened> = Vec::new();
        for (index, discrepancy) in self.discrepancies.iter().enumerate() {
            if !shows(discrepancy) {
                continue;
            }
            let whitened = subset.design.with_discrepancy(discrepancy);
            let powers = powers(discrepancy);
            let (log_posterior, power) = climb(powers.len(), |power| {
                let products = whitened.products(powers[power], &subset.plain);
                (sets.iter())
                    .map(|(fitted, prior)| fitted.log_evidence(&products) + prior)
                    .fold(f64::NEG_INFINITY, f64::max)
            });
            screened.push(Screened {
                log_posterior: log_posterior + log_prior_with(discrepancy),
                index,
                power,
            });
        }
        screened.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
        let best = screened
            .first()
            .map_or(best, |first| first.log_posterior.max(best));
        screened.truncate(SCREENED);
        screened.retain(|screened| screened.log_posterior > best - SCREENED_OUT);
        screened
    }

    /// Models of the best sets with a discrepancy, at all variances.
    fn evaluate(&self, subset: &CandidateSubset, screened: &Screened) -> Vec<Model> {
        let discrepancy = &self.discrepancies[screened.index];
        let priors = self.priors_with(discrepancy);
        let whitened = subset.design.with_discrepancy(discrepancy);
        let powers = powers(discrepancy);
        let mut models = Vec::new();
        for (number, &power) in powers.iter().enumerate() {
            let near = number.abs_diff(screened.power) <= 1;
            let most = if near { SETS } else { SETS_ELSEWHERE };
            let products = whitened.products(power, &subset.plain);
            // Only the best at the sizes that they have without the discrepancy are solved.
            let mut estimates: Vec<(f64, &FittedSet)> = (subset.sets.iter())
                .map(|fitted| {
                    let prior = priors.log_prior_of(&fitted.set);
                    (fitted.log_evidence(&products) + prior, fitted)
                })
                .collect();
            estimates.sort_by(|a, b| b.0.total_cmp(&a.0));
            models.extend(estimates.into_iter().take(most).map(|(_, fitted)| Model {
                set: fitted.set.clone(),
                discrepancy: Some((screened.index, power)),
                probability: 0.0,
                log_posterior: products.log_evidence(&fitted.indices)
                    + priors.log_prior_of(&fitted.set)
                    + log_prior_with(discrepancy),
            }));
        }
        models
    }

    /// Models of a search over the whole library beside a discrepancy, at first of variance `power` over the noise, then at
    /// the variance that is best for the set that was found.
    fn search(&self, design: &Design, index: usize, mut power: f64) -> Vec<Model> {
        let discrepancy = &self.discrepancies[index];
        let whitened = design.with_discrepancy(discrepancy);
        let priors = self.priors_with(discrepancy);
        let mut models: Vec<Model> = Vec::new();
        let mut searched: Vec<f64> = Vec::new();
        while searched.len() < POWERS_SEARCHED && !searched.contains(&power) {
            searched.push(power);
            let products = whitened.products(power, &self.pool.products);
            let mut found = search(&products, &priors, SEARCH_BEAM, &mut EvidenceCache::new());
            exchange_best(&products, &priors, &mut found);
            let model = |found: &ScoredSet, power: f64, log_posterior: f64| Model {
                set: found.set.clone(),
                discrepancy: Some((index, power)),
                probability: 0.0,
                log_posterior: log_posterior + log_prior_with(discrepancy),
            };
            let kept = found.iter().take(SEARCH_KEPT);
            models.extend(kept.map(|found| model(found, power, found.log_posterior)));
            let Some(best) = found.first() else {
                break;
            };
            let subset = CandidateSubset::new(self.pool, vec![best.set.clone()]);
            let [fitted] = subset.sets.as_slice() else {
                break;
            };
            let whitened = subset.design.with_discrepancy(discrepancy);
            let prior = priors.log_prior_of(&best.set);
            let (mut highest, searched_at) = (best.log_posterior, power);
            let others = powers(discrepancy).iter();
            for &other in others.filter(|&&other| other != searched_at) {
                let products = whitened.products(other, &subset.plain);
                let log_posterior = products.log_evidence(&fitted.indices) + prior;
                models.push(model(best, other, log_posterior));
                if log_posterior > highest {
                    highest = log_posterior;
                    power = other;
                }
            }
        }
        models
    }
}

/// The candidates of some sets only: projecting the whole library onto every discrepancy would cost too much.
struct CandidateSubset {
    design: Design,
    /// Inner products without a discrepancy.
    plain: InnerProducts,
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
            let fit = plain.fit(&indices)?;
            let sizes = fit.prior_variances.iter();
            Some(FittedSet {
                set,
                indices,
                sizes: sizes.map(|size| size * fit.variance).collect(),
                variance: fit.variance,
                coefficients: fit.coefficients,
            })
        };
        Self {
            design: Design::new(candidates, pool.y, &pool.rows()),
            sets: sets.into_iter().filter_map(fitted).collect(),
            plain,
        }
    }

    /// What each set leaves over the rows in use, a column for each, over the standard deviation of the noise.
    fn standardised_residuals(&self) -> DMatrix<f64> {
        let mut standardised = DMatrix::zeros(self.design.rows(), self.sets.len());
        for (mut column, fitted) in standardised.column_iter_mut().zip(&self.sets) {
            let spans = fitted.indices.iter().map(|&index| self.plain.spans[index]);
            let columns = spans.flat_map(|(first, width)| first..first + width);
            let terms = columns.zip(fitted.coefficients.iter().copied());
            column.copy_from(&(self.design.residuals(terms) / fitted.variance.sqrt()));
        }
        standardised
    }
}

/// A set with the sizes that it has without a discrepancy.
struct FittedSet {
    set: Vec<usize>,
    /// Indices of its candidates within the subset.
    indices: Vec<usize>,
    /// Variances of the coefficients of its blocks, m².
    sizes: Vec<f64>,
    /// Variance of the noise, m².
    variance: f64,
    /// Coefficients of its columns, m.
    coefficients: Vec<f64>,
}

impl FittedSet {
    /// Log evidence at these sizes.
    fn log_evidence(&self, products: &InnerProducts) -> f64 {
        products.log_evidence_at_sizes(&self.indices, &self.sizes, self.variance)
    }
}

/// Variances over the noise that are tried for a discrepancy.
pub(super) fn powers(discrepancy: &Discrepancy) -> &'static [f64] {
    let tried = match discrepancy.kind {
        Kind::Noise => POWERS.iter().take_while(|&&power| power <= NOISY).count(),
        _ => POWERS.len(),
    };
    &POWERS[..tried]
}

/// Log prior of a discrepancy at one of the tried variances.
fn log_prior_with(discrepancy: &Discrepancy) -> f64 {
    let prior = match discrepancy.kind {
        Kind::Noise => discrepancy.log_prior,
        _ => discrepancy.log_prior + UNKNOWN.ln(),
    };
    prior - (POWERS.len() as f64).ln()
}

/// The empty set, the best sets, and each of these without one of its effects.
fn reduced_sets(scored: &[ScoredSet]) -> Vec<Vec<usize>> {
    let mut sets: Vec<Vec<usize>> = vec![Vec::new()];
    for scored in scored.iter().take(SETS) {
        for reduced in without_each(&scored.set).chain(iter::once(scored.set.clone())) {
            if !sets.contains(&reduced) {
                sets.push(reduced);
            }
        }
    }
    sets
}

#[cfg(test)]
mod tests {
    use super::climb;

    /// Wherever the summit of a single hill is, it is found, and most of the values are not asked for.
    #[test]
    fn the_summit_of_a_single_hill_is_found() {
        for count in [1, 2, 7, 9] {
            for summit in 0..count {
                let mut asked = 0;
                let value = |index: usize| {
                    asked += 1;
                    -(index as f64 - summit as f64).abs()
                };
                assert_eq!(climb(count, value), (0.0, summit), "of {count}");
                assert!(asked <= count.min(6), "{asked} of {count}");
            }
        }
        assert_eq!(climb(0, |_| 0.0).0, f64::NEG_INFINITY);
    }
}
