//! Which effects: candidates, their shapes, the search, and the rivals, put together into one posterior over sets.
//!
//! Shapes (periods, time constants, instants) are scanned against what the best sets leave and refined continuously.
//! Every set stands alone and beside each promising rival; probabilities are over all of them. Outliers are masked
//! before; the second order of large displacements on curved surfaces is corrected from outside.

use std::rc::Rc;

use crate::beside::{Seen, UNKNOWN, challenge};
use crate::candidate::{Alias, Candidate};
use crate::effects::Variant;
use crate::evidence::{Fit, Products, add_scaled, whitened};
use crate::observation::Observations;
use crate::pool::{Pool, Shapes, orthonormal};
use crate::rivals::{Kind, Rival, grid};
use crate::search::{MOST_EFFECTS, Scored, exchange, extend, prune};

/// Prior probability that the noise remembers the touch before.
const REMEMBERS: f64 = 0.05;
/// Correlations of one touch's noise with the next one's that are tried.
const CORRELATIONS: [f64; 5] = [0.2, 0.4, 0.6, 0.75, 0.85];
/// Correlations under so many standard deviations are chance.
const CHANCE: f64 = 2.5;
/// Rounds of scans beside the best sets.
const SCANS: usize = 2;
/// Rounds of growth beyond the search's depth.
const GROWTHS: usize = 3;
/// Models that are kept.
const KEPT: usize = 400;

/// One explanation: a set of candidates, with or without a rival.
#[derive(Debug, Clone)]
pub struct Model {
    /// Candidates, ascending.
    pub set: Vec<usize>,
    /// Rival and the variance of its process over that of the noise.
    pub rival: Option<(usize, f64)>,
    /// Probability among all models.
    pub probability: f64,
    /// Log evidence plus log prior.
    pub score: f64,
}

/// All explanations of a session.
#[derive(Debug)]
pub struct Attribution {
    /// Candidates in use.
    pub candidates: Vec<Candidate>,
    /// What of other effects has the same signature as each candidate.
    pub aliases: Vec<Vec<Alias>>,
    /// Rivals.
    pub rivals: Vec<Rc<Rival>>,
    /// Models, most probable first.
    pub models: Vec<Model>,
    /// Products over the active rows.
    pub products: Products,
    /// Weighted deviations of all rows.
    pub y: Vec<f64>,
    /// Rows in use.
    pub active: Vec<bool>,
    /// Share of a touch's noise that the next one remembers.
    pub correlation: f64,
}

/// Explains weighted deviations `y` of the rows in `active`.
pub fn attribute(
    observations: &Observations,
    variants: &[Variant],
    y: &[f64],
    active: &[bool],
) -> Attribution {
    attribute_with(&Shapes::new(observations, variants), y, active, None)
}

/// The same with what the library offers at hand, and with what was found for almost the same deviations.
pub(crate) fn attribute_with(
    shapes: &Shapes<'_>,
    y: &[f64],
    active: &[bool],
    before: Option<&Attribution>,
) -> Attribution {
    let white = with_noise(shapes, y, active, 0.0, before);
    let Some(correlation) = remembered(shapes.observations, &white) else {
        return white;
    };
    let red = with_noise(shapes, y, active, correlation, Some(&white));
    let score = |attribution: &Attribution| attribution.models[0].score;
    if score(&red) > score(&white) {
        red
    } else {
        white
    }
}

/// Attribution with noise that remembers a share `correlation` of the touch before.
///
/// Shapes that were found `before` for almost the same deviations stay; only what the best sets leave is scanned anew.
fn with_noise(
    shapes: &Shapes<'_>,
    y: &[f64],
    active: &[bool],
    correlation: f64,
    before: Option<&Attribution>,
) -> Attribution {
    let mut pool = Pool::new(shapes, y, active, correlation);
    let mut scanned = vec![Vec::new()];
    match before {
        Some(before) => pool.take(before),
        None => pool.scan(&[]),
    }
    let mut scored = pool.search();
    for _ in 0..if before.is_some() { 1 } else { SCANS } {
        let mut contexts = best_of_each_size(&scored, 3);
        let before = pool.candidates.len();
        // What a set leaves is what it left before.
        contexts.retain(|context| !scanned.contains(context));
        for context in &contexts {
            pool.scan(context);
        }
        scanned.append(&mut contexts);
        pool.refine(&scored[0].set.clone());
        if pool.candidates.len() == before {
            break;
        }
        scored = pool.search();
    }
    grow(&mut pool, &mut scored);
    finish(pool, &scored)
}

/// The correlation of neighbouring touches that what no effect explains asks for, if any.
fn remembered(observations: &Observations, white: &Attribution) -> Option<f64> {
    let plain = white.models.iter().find(|model| model.rival.is_none())?;
    let left = white.left(plain)?;
    let used: Vec<f64> = (left.iter().zip(&white.active))
        .take(observations.touches())
        .filter(|&(_, &used)| used)
        .map(|(&value, _)| value)
        .collect();
    let power: f64 = used.iter().map(|value| value * value).sum();
    let along: f64 = used.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let correlation = along / power.max(f64::MIN_POSITIVE);
    if correlation < CHANCE / (used.len() as f64).sqrt() {
        return None;
    }
    let blocks: Vec<&[Vec<f64>]> = plain
        .set
        .iter()
        .map(|&member| white.candidates[member].block.as_slice())
        .collect();
    let set: Vec<usize> = (0..blocks.len()).collect();
    let evidence = |correlation: f64| {
        let touches = observations.touches();
        Products::correlated(&blocks, &white.y, &white.active, touches, correlation)
            .log_evidence(&set)
    };
    CORRELATIONS
        .into_iter()
        .max_by(|&one, &other| evidence(one).total_cmp(&evidence(other)))
}

/// The best set of each size up to `most`, and the best of all.
fn best_of_each_size(scored: &[Scored], most: usize) -> Vec<Vec<usize>> {
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

/// A machine with more wrong than the search's depth: adds effects one by one, shapes scanned anew each round.
fn grow(pool: &mut Pool<'_>, scored: &mut Vec<Scored>) {
    let Some(mut best) = scored
        .first()
        .filter(|best| best.set.len() >= MOST_EFFECTS)
        .cloned()
    else {
        return;
    };
    for _ in 0..GROWTHS {
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
    // Neighbours of the long set tell how sure each member is.
    let priors = pool.priors();
    for place in 0..best.set.len() {
        let mut set = best.set.clone();
        set.remove(place);
        let score = pool.products.log_evidence(&set) + priors.of(&set);
        scored.push(Scored { set, score });
    }
    scored.sort_by(|one, other| other.score.total_cmp(&one.score));
}

fn finish(pool: Pool<'_>, scored: &[Scored]) -> Attribution {
    let priors = pool.priors();
    let white = pool.correlation == 0.0;
    let mut challengers = Vec::new();
    if white {
        challengers = unknown_to(&pool, &pool.shapes.rivals(pool.active));
        challengers.extend(grid(pool.shapes.observations, pool.active).map(Rc::new));
    }
    let noise = if white {
        1.0 - REMEMBERS
    } else {
        REMEMBERS / CORRELATIONS.len() as f64
    };
    let mut models: Vec<Model> = scored
        .iter()
        .take(KEPT)
        .map(|scored| Model {
            set: scored.set.clone(),
            rival: None,
            probability: 0.0,
            score: scored.score + (1.0 - UNKNOWN).ln() + noise.ln(),
        })
        .collect();
    challenge(&pool, scored, &challengers, &priors, &mut models);
    models.sort_by(|one, other| other.score.total_cmp(&one.score));
    models.dedup_by(|one, other| one.set == other.set && one.rival == other.rival);
    let best = models.first().map_or(0.0, |model| model.score);
    let total: f64 = models.iter().map(|model| (model.score - best).exp()).sum();
    for model in &mut models {
        model.probability = (model.score - best).exp() / total;
    }
    Attribution {
        candidates: pool.candidates,
        aliases: pool.aliases,
        rivals: challengers,
        models,
        products: pool.products,
        y: pool.y.to_vec(),
        active: pool.active.to_vec(),
        correlation: pool.correlation,
    }
}

/// Rivals less what the library already has: a dependence on a covariate is no rival of the effects that have it.
fn unknown_to(pool: &Pool<'_>, rivals: &[Rc<Rival>]) -> Vec<Rc<Rival>> {
    let own = |rival: &Rc<Rival>| {
        let Kind::Covariate(covariate) = rival.kind else {
            return Some(Rc::clone(rival));
        };
        let known = |candidate: &&Candidate| {
            let effect = pool.shapes.variants[candidate.variant].effect.as_str();
            covariate.known().contains(&effect)
        };
        let columns = (pool.candidates.iter().filter(known))
            .flat_map(|candidate| &candidate.block)
            .map(|column| whitened(column, pool.active, 0, 0.0));
        let basis = orthonormal(columns);
        if basis.is_empty() {
            return Some(Rc::clone(rival));
        }
        rival.beside(&basis).map(Rc::new)
    };
    rivals.iter().filter_map(own).collect()
}

impl Attribution {
    /// True where a model needs something outside the vocabulary.
    pub fn is_unknown(&self, model: &Model) -> bool {
        (model.rival)
            .is_some_and(|(place, _)| !matches!(self.rivals[place].kind, Kind::Grid | Kind::Noise))
    }

    /// Where noise is larger for some touches: by how much the standard deviation of each active row is larger.
    pub fn widening(&self, model: &Model) -> Option<Vec<f64>> {
        let (place, power) = model.rival?;
        let rival = &self.rivals[place];
        (rival.kind == Kind::Noise).then(|| rival.widening(power))?
    }

    /// What the effects of a model leave of the weighted deviations of all rows; `None` where it cannot be fitted.
    pub fn left(&self, model: &Model) -> Option<Vec<f64>> {
        let fit = self.fit(model)?;
        let mut left = self.y.clone();
        let columns = (model.set.iter()).flat_map(|&member| &self.candidates[member].block);
        for (column, coefficient) in columns.zip(&fit.coefficients) {
            add_scaled(&mut left, -coefficient, column);
        }
        Some(left)
    }

    /// Fit of a model's set on the active rows, beside its rival.
    pub fn fit(&self, model: &Model) -> Option<Fit> {
        match model.rival {
            None => self.products.fit(&model.set),
            Some((place, power)) => {
                let members = model.set.iter().map(|&member| &self.candidates[member]);
                let places: Vec<usize> = (0..model.set.len()).collect();
                Seen::new(members, &self.y, &self.active)
                    .beside(&self.rivals[place])
                    .products(power, &self.products.part(&model.set))
                    .fit(&places)
            }
        }
    }
}
