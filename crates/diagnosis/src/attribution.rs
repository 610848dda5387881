//! The model posterior: the posterior over sets of effects, with and without a discrepancy, of one session.
//!
//! Shapes (periods, time constants, instants) are scanned against the residuals of the best sets and refined continuously.
//! Every set is scored alone and with each promising discrepancy; probabilities are over all of these models. Outliers are
//! masked before; the second order of large displacements on curved surfaces is corrected from outside.

pub(crate) mod alternatives;
pub(crate) mod candidate_pool;
pub(crate) mod equivalence;
mod localised;
pub(crate) mod parameters;
mod restricted;
mod switching;
pub(crate) mod unsupported;
pub(crate) mod whitening;
mod with_discrepancy;

use std::collections::{BTreeMap, BTreeSet};
use std::iter;
use std::rc::Rc;

use effects::discrepancy::depends_on;
use effects::observation::Observations;
use inference::candidate::Candidate;
use inference::columns::{Rows, matrix_of};
use inference::cross_validation::TouchBlocks;
use inference::discrepancy::{Covariate, Discrepancy, Kind};
use inference::evidence::InnerProducts;
use inference::linear::{SPANNED, orthonormal, whitened};
use inference::posterior::{Model, ModelPosterior};
use inference::search::{MAX_EFFECTS, ScoredSet, default_beam_width, exchange, extend, prune};
use inference::whitened::Design;
use nalgebra::DMatrix;

use candidate_pool::{CandidatePool, Shapes};
use localised::TravelScan;
use switching::Switching;
use with_discrepancy::{UNKNOWN, powers, score_with_discrepancies, search_anew};

/// Prior probability of AR(1) touch noise.
const AR1_NOISE: f64 = 0.05;
/// Lag-1 correlations of the touch noise that are tried.
const CORRELATIONS: [f64; 5] = [0.2, 0.4, 0.6, 0.75, 0.85];
/// Correlated noise is tried where it is better than uncorrelated by so many standard deviations: a log likelihood ratio of half the square.
const CHANCE: f64 = 2.5;
/// Width of the search for the sets beside which shapes are scanned.
const PRELIMINARY_BEAM: usize = 8;
/// Rounds of shape scans beside the best sets.
const SCANS: usize = 2;
/// Rounds of forward selection beyond the depth of the beam search.
const EXTENSIONS: usize = 3;
/// Models that are kept.
const KEPT: usize = 400;
/// Rounds in which shapes are scanned beside something unknown.
const SCANS_BESIDE: usize = 2;
/// Rounds in which states or parts of the travel are estimated anew beside the best sets.
const ESTIMATIONS: usize = 2;

/// Explains weighted deviations `y` of the rows in `active`, starting from the attribution of almost the same deviations
/// where there is one.
pub(crate) fn attribute_with(
    shapes: &Shapes<'_>,
    y: &[f64],
    active: &[bool],
    before: Option<&ModelPosterior>,
) -> ModelPosterior {
    let white = with_noise(shapes, y, active, 0.0, before);
    let plain = white
        .models
        .iter()
        .find(|model| model.discrepancy.is_none());
    // What is unknown leaves correlated residuals too: beside it the noise may have another lag-1 correlation, or none.
    let beside = white.models.first().filter(|model| white.is_unknown(model));
    let models = plain.into_iter().chain(beside);
    let mut correlations: Vec<f64> = models
        .filter_map(|model| estimate_lag1(&white, model))
        .collect();
    correlations.dedup();
    let mut best = None;
    for lag1_correlation in correlations {
        let red = with_noise(shapes, y, active, lag1_correlation, Some(&white));
        let known = best.as_ref().unwrap_or(&white);
        if red.models[0].log_posterior > known.models[0].log_posterior {
            best = Some(red);
        }
    }
    best.unwrap_or(white)
}

/// The model posterior with noise of a given lag-1 correlation.
///
/// Shapes that were found `before` for almost the same deviations stay; only the residuals of the best sets are scanned anew.
fn with_noise(
    shapes: &Shapes<'_>,
    y: &[f64],
    active: &[bool],
    lag1_correlation: f64,
    before: Option<&ModelPosterior>,
) -> ModelPosterior {
    let mut pool = CandidatePool::new(shapes, y, active, lag1_correlation);
    let mut scanned = vec![Vec::new()];
    match before {
        Some(before) => pool.take_over(before),
        None => pool.scan(&[]),
    }
    let mut scored = pool.search(PRELIMINARY_BEAM);
    for _ in 0..if before.is_some() { 1 } else { SCANS } {
        let mut contexts = best_of_each_size(&scored, 3);
        let before = pool.candidates.len();
        // A set that was scanned before has the same residuals.
        contexts.retain(|context| !scanned.contains(context));
        for context in &contexts {
            pool.scan(context);
        }
        scanned.append(&mut contexts);
        pool.refine(&scored[0].set.clone());
        if pool.candidates.len() == before {
            break;
        }
        scored = pool.search(PRELIMINARY_BEAM);
    }
    scored = pool.search(default_beam_width());
    extend_best(&mut pool, &mut scored);
    finish(pool, &scored)
}

/// Lag-1 correlation of the touch noise that has the highest evidence with the effects and the discrepancy of a model; `None` where
/// uncorrelated noise is as good within [`CHANCE`].
fn estimate_lag1(white: &ModelPosterior, model: &Model) -> Option<f64> {
    let members = || model.set.iter().map(|&member| &white.candidates[member]);
    let blocks: Vec<&[Vec<f64>]> = members().map(|member| member.block.as_slice()).collect();
    let set: Vec<usize> = (0..blocks.len()).collect();
    let evidence = |lag1_correlation: f64| {
        let products = InnerProducts::with_lag1(
            &blocks,
            &white.y,
            &white.active,
            white.touches,
            lag1_correlation,
        );
        let Some((index, _)) = model.discrepancy else {
            return products.log_evidence(&set);
        };
        let rows = Rows {
            lag1_correlation,
            ..white.rows()
        };
        let discrepancy = white.discrepancies[index].whitened_for(&rows);
        let design = Design::new(members(), &white.y, &rows);
        let whitened = design.with_discrepancy(&discrepancy);
        (powers(&discrepancy).iter())
            .map(|&power| whitened.products(power, &products).log_evidence(&set))
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let least = evidence(0.0) + 0.5 * CHANCE * CHANCE;
    (CORRELATIONS.into_iter())
        .map(|lag1_correlation| (evidence(lag1_correlation), lag1_correlation))
        .filter(|&(evidence, _)| evidence > least)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, lag1_correlation)| lag1_correlation)
}

/// The best set of each size up to `most`, and the best of all.
fn best_of_each_size(scored: &[ScoredSet], most: usize) -> Vec<Vec<usize>> {
    let mut sets: Vec<Vec<usize>> = scored
        .first()
        .map(|best| best.set.clone())
        .into_iter()
        .collect();
    for size in 1..=most {
        if let Some(best) = scored.iter().find(|scored| scored.set.len() == size)
            && !sets.contains(&best.set)
        {
            sets.push(best.set.clone());
        }
    }
    sets
}

/// More effects than the depth of the search: adds them one by one, shapes scanned anew each round.
fn extend_best(pool: &mut CandidatePool<'_>, scored: &mut Vec<ScoredSet>) {
    let Some(mut best) = scored
        .first()
        .filter(|best| best.set.len() >= MAX_EFFECTS)
        .cloned()
    else {
        return;
    };
    for _ in 0..EXTENSIONS {
        pool.scan(&best.set);
        pool.refresh();
        let priors = pool.priors();
        let Some(longer) = extend(&pool.products, &priors, &best.set) else {
            break;
        };
        let exchanged = exchange(&pool.products, &priors, longer);
        best = prune(&pool.products, &priors, exchanged);
        scored.insert(0, best.clone());
    }
    // Sets without one member give the probability of each.
    let priors = pool.priors();
    for set in without_each(&best.set) {
        let log_posterior = pool.products.log_evidence(&set) + priors.log_prior_of(&set);
        scored.push(ScoredSet { set, log_posterior });
    }
    scored.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
}

fn finish(mut pool: CandidatePool<'_>, scored: &[ScoredSet]) -> ModelPosterior {
    let white = pool.lag1_correlation == 0.0;
    let mut discrepancies = unknown_to(&pool, &pool.shapes.discrepancies(pool.active));
    if !white {
        let rows = pool.rows();
        for discrepancy in &mut discrepancies {
            *discrepancy = Rc::new(discrepancy.whitened_for(&rows));
        }
    }
    let noise = if white {
        1.0 - AR1_NOISE
    } else {
        AR1_NOISE / CORRELATIONS.len() as f64
    };
    let mut models: Vec<Model> = scored
        .iter()
        .take(KEPT)
        .map(|scored| Model {
            set: scored.set.clone(),
            discrepancy: None,
            probability: 0.0,
            log_posterior: scored.log_posterior + (1.0 - UNKNOWN).ln() + noise.ln(),
        })
        .collect();
    let offered = score_with_discrepancies(&pool, scored, &discrepancies, 0, &models);
    models.extend(offered.into_iter().map(|model| noisy(model, noise)));
    let mut sets = vec![Vec::new()];
    sets.extend(best_of_each_size(scored, 3));
    let fits: Vec<Fitted> = sets.into_iter().map(Fitted::alone).collect();
    let all = (&mut discrepancies, &mut models);
    let travel = (&pool, &TravelScan::new(&pool));
    add_estimated(travel, scored, fits.clone(), all, noise);
    if white {
        let all = (&mut discrepancies, &mut models);
        add_switching(&pool, scored, fits, all, noise);
    }
    let restricted = restricted::restrict(&pool, &discrepancies, &mut models);
    normalise(&mut models);
    let mut attribution = attribution_of(&pool, discrepancies, models);
    // A field of restricted likelihood has a probability that a further search does not add to.
    for _ in 0..if restricted { 0 } else { SCANS_BESIDE } {
        if !scan_beside_unknown(&mut pool, scored, &mut attribution, noise) {
            break;
        }
    }
    attribution
}

/// Scans the shapes anew in what the unknown cause of the best model leaves, which may be far larger than an effect beside it, and
/// searches the library again beside that cause; false where the best model has none, or nothing better is found.
fn scan_beside_unknown(
    pool: &mut CandidatePool<'_>,
    scored: &[ScoredSet],
    attribution: &mut ModelPosterior,
    noise: f64,
) -> bool {
    let model = attribution.models[0].clone();
    let part = attribution.discrepancy_part(&model);
    let (Some(part), Some(unknown), true) =
        (part, model.discrepancy, attribution.is_unknown(&model))
    else {
        return false;
    };
    let left: Vec<f64> = (pool.y.iter().zip(part))
        .map(|(value, part)| value - part)
        .collect();
    if !pool.scan_beside(&model.set, &left) {
        return false;
    }
    pool.refresh();
    let mut models = std::mem::take(&mut attribution.models);
    let mut discrepancies = std::mem::take(&mut attribution.discrepancies);
    let found = search_anew(pool, &discrepancies, unknown);
    models.extend(found.into_iter().map(|model| noisy(model, noise)));
    let best = best_of(models.iter()).unwrap_or(&model).clone();
    let better = best.log_posterior > model.log_posterior;
    let kind = (best.discrepancy).map(|(index, _)| discrepancies[index].kind.clone());
    if let Some(kind) = kind.filter(|_| better) {
        // Its states or its part of the travel were those beside the shapes before.
        let fits = Fitted::around(&best);
        let all = (&mut discrepancies, &mut models);
        if Switching::is_own(&kind) {
            add_switching(pool, scored, fits, all, noise);
        } else if TravelScan::is_own(&kind) {
            add_estimated((pool, &TravelScan::new(pool)), scored, fits, all, noise);
        }
    }
    normalise(&mut models);
    *attribution = attribution_of(pool, discrepancies, models);
    better
}

/// Models by their log posteriors, each once, with their probabilities.
fn normalise(models: &mut Vec<Model>) {
    models.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
    let mut known = BTreeSet::new();
    models.retain(|model| {
        let unknown = (model.discrepancy).map(|(index, power)| (index, power.to_bits()));
        known.insert((model.set.clone(), unknown))
    });
    let best = models.first().map_or(0.0, |model| model.log_posterior);
    let total: f64 = models
        .iter()
        .map(|model| (model.log_posterior - best).exp())
        .sum();
    for model in models {
        model.probability = (model.log_posterior - best).exp() / total;
    }
}

/// The attribution of these models of a pool.
fn attribution_of(
    pool: &CandidatePool<'_>,
    discrepancies: Vec<Rc<Discrepancy>>,
    models: Vec<Model>,
) -> ModelPosterior {
    ModelPosterior {
        candidates: pool.candidates.clone(),
        aliases: pool.aliases.clone(),
        discrepancies,
        models,
        touches: pool.shapes.observations.touches(),
        products: pool.products.clone(),
        y: pool.y.to_vec(),
        active: pool.active.to_vec(),
        lag1_correlation: pool.lag1_correlation,
    }
}

/// A model whose log posterior counts the prior probability of its noise.
fn noisy(model: Model, noise: f64) -> Model {
    Model {
        log_posterior: model.log_posterior + noise.ln(),
        ..model
    }
}

/// A set of effects, fitted alone or beside a discrepancy: its number, and its variance over that of the noise.
#[derive(Debug, Clone, PartialEq)]
struct Fitted {
    set: Vec<usize>,
    beside: Option<(usize, f64)>,
}

impl Fitted {
    fn alone(set: Vec<usize>) -> Self {
        Self { set, beside: None }
    }

    /// The set of a model and the same without each of its effects, each fitted alone and beside the discrepancy of the model.
    fn around(model: &Model) -> Vec<Self> {
        let sets = || iter::once(model.set.clone()).chain(without_each(&model.set));
        let beside = sets().map(|set| Self {
            set,
            beside: model.discrepancy,
        });
        sets().map(Self::alone).chain(beside).collect()
    }
}

/// Discrepancies that are estimated from what sets of effects leave.
trait Estimator {
    /// True for the kinds of discrepancies that it estimates.
    fn is_own(kind: &Kind) -> bool;

    /// Discrepancies in what each of some sets leaves; `known` are all that there are already.
    fn beside(&self, fits: &[Fitted], known: &[Rc<Discrepancy>]) -> Vec<Rc<Discrepancy>>;

    /// Scores sets with estimated discrepancies, the first of which has the number that is given, against the models so far.
    fn scored(
        pool: &CandidatePool<'_>,
        beside: &[ScoredSet],
        found: &[Rc<Discrepancy>],
        first: usize,
        models: &[Model],
    ) -> Vec<Model>;
}

/// Number of kinds of discrepancies that are not estimated from what sets leave.
fn other_kinds(discrepancies: &[Rc<Discrepancy>]) -> usize {
    let kinds: BTreeSet<&Kind> = (discrepancies.iter())
        .map(|discrepancy| &discrepancy.kind)
        .filter(|kind| !Switching::is_own(kind) && !TravelScan::is_own(kind))
        .collect();
    kinds.len()
}

/// Models with discrepancies that are estimated beside some sets, then beside those of the best models.
fn add_estimated<E: Estimator>(
    (pool, estimator): (&CandidatePool<'_>, &E),
    scored: &[ScoredSet],
    mut fits: Vec<Fitted>,
    (discrepancies, models): (&mut Vec<Rc<Discrepancy>>, &mut Vec<Model>),
    noise: f64,
) {
    let is_own = |discrepancy: &Discrepancy| E::is_own(&discrepancy.kind);
    let mut known: Vec<Fitted> = Vec::new();
    for _ in 0..=ESTIMATIONS {
        fits.retain(|fit| !known.contains(fit));
        let found = estimator.beside(&fits, discrepancies);
        known.append(&mut fits);
        if found.is_empty() {
            break;
        }
        let first = discrepancies.len();
        // What they were estimated beside may be in no set that is good without them.
        let alone = known.iter().rev().filter(|fit| fit.beside.is_none());
        let beside = alone.map(|fit| ScoredSet {
            set: fit.set.clone(),
            log_posterior: pool.products.log_evidence(&fit.set),
        });
        let beside: Vec<ScoredSet> = beside.chain(scored.iter().cloned()).collect();
        let offered = E::scored(pool, &beside, &found, first, models);
        discrepancies.extend(found);
        models.extend(offered.into_iter().map(|model| noisy(model, noise)));
        let best = |own: bool| {
            let of = |model: &&Model| {
                (model.discrepancy).is_some_and(|(index, _)| is_own(&discrepancies[index]) == own)
            };
            best_of(models.iter().filter(of))
        };
        // An effect of the best set may stand for states, or a part of the travel, that are wrong; and the set fitted alone takes a
        // part of what it was fitted without.
        fits = best(true).map_or_else(Vec::new, Fitted::around);
        let other = best(false).map(|model| Fitted::alone(model.set.clone()));
        fits.extend(other.filter(|other| !fits.contains(other)));
    }
}

/// Models with something that switches between two states, and each place that may be its nominal one beside the best of them.
fn add_switching(
    pool: &CandidatePool<'_>,
    scored: &[ScoredSet],
    fits: Vec<Fitted>,
    (discrepancies, models): (&mut Vec<Rc<Discrepancy>>, &mut Vec<Model>),
    noise: f64,
) {
    let first_of_all = discrepancies.len();
    let all = (&mut *discrepancies, &mut *models);
    add_estimated((pool, &Switching(pool)), scored, fits, all, noise);
    // The nominal place was chosen beside sets that may lack what the search has found since.
    let found = best_of(models.iter()).and_then(|model| model.discrepancy);
    if let Some((index, power)) = found.filter(|&(index, _)| index >= first_of_all) {
        let alike = switching::same_states(index - first_of_all);
        for other in alike
            .map(|index| first_of_all + index)
            .filter(|&other| other != index)
        {
            let searched = search_anew(pool, discrepancies, (other, power));
            models.extend(searched.into_iter().map(|model| noisy(model, noise)));
        }
    }
}

/// A set without its first effect, without its second, and so on.
fn without_each(set: &[usize]) -> impl Iterator<Item = Vec<usize>> {
    (0..set.len()).map(|index| {
        let mut others = set.to_vec();
        others.remove(index);
        others
    })
}

/// The model of the highest log posterior.
fn best_of<'a>(models: impl Iterator<Item = &'a Model>) -> Option<&'a Model> {
    models.max_by(|one, other| one.log_posterior.total_cmp(&other.log_posterior))
}

/// Discrepancies orthogonal to the library: a dependence on a covariate competes with no effect that depends on it.
fn unknown_to(pool: &CandidatePool<'_>, discrepancies: &[Rc<Discrepancy>]) -> Vec<Rc<Discrepancy>> {
    let mut bases: BTreeMap<Covariate, DMatrix<f64>> = BTreeMap::new();
    let remaining = |discrepancy: &Rc<Discrepancy>| {
        let Kind::Covariate(covariate) = discrepancy.kind else {
            return Some(Rc::clone(discrepancy));
        };
        let basis = (bases.entry(covariate)).or_insert_with(|| basis_of_covariate(pool, covariate));
        if basis.ncols() == 0 {
            return Some(Rc::clone(discrepancy));
        }
        discrepancy.orthogonal_to(basis).map(Rc::new)
    };
    discrepancies.iter().filter_map(remaining).collect()
}

/// An orthonormal basis of what the effects that depend on a covariate can do, over the rows in use.
fn basis_of_covariate(pool: &CandidatePool<'_>, covariate: Covariate) -> DMatrix<f64> {
    let depends = |candidate: &&Candidate| {
        let effect = pool.shapes.variants[candidate.variant].effect.as_str();
        depends_on(effect, covariate)
    };
    let columns = (pool.candidates.iter().filter(depends))
        .flat_map(|candidate| &candidate.block)
        .map(|column| whitened(column, pool.active, 0, 0.0));
    let basis = orthonormal(columns, SPANNED);
    let rows = pool.active.iter().filter(|&&used| used).count();
    matrix_of(rows, &basis)
}

/// Blocks of the touches in use that judge a fit: runs of one feature at one index. References always train.
pub(crate) fn blocks(observations: &Observations, active: &[bool]) -> TouchBlocks {
    let rows = observations.rows.iter().zip(active);
    TouchBlocks::new(
        rows.map(|(row, &used)| (used && row.pose.is_some()).then_some((row.feature, row.index))),
    )
}
