//! Rivals beside sets of effects: every explanation with something unknown in it.
//!
//! A first look at fixed sizes tells which rivals are worth more; those stand beside the best sets, and the best of them
//! have the library searched anew beside them. Metres.

use std::rc::Rc;

use nalgebra::DMatrix;

use crate::attribution::Model;
use crate::candidate::Candidate;
use crate::columns::{Rows, side_by_side};
use crate::evidence::Products;
use crate::observation::Observations;
use crate::pool::Pool;
use crate::rivals::{Kind, Met, Rival};
use crate::search::{Known, Priors, Scored, search};

/// Prior probability that something outside the vocabulary acts.
pub(crate) const UNKNOWN: f64 = 0.05;
/// Variances of a rival over that of the noise that are tried.
const POWERS: [f64; 9] = [0.3, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0, 4096.0, 16384.0];
/// Largest variance over that of the others that is still noise: eight times their standard deviation.
const NOISY: f64 = 64.0;
/// A rival this far (natural log) behind the best is not searched further.
const FAR_BEHIND: f64 = 7.0;
/// At a first look, sizes and set are not the best: a rival this far behind is not looked at again.
const OUT_OF_SIGHT: f64 = 16.0;
/// Rivals that are looked at again, and those beside which the library is searched.
const SECOND_LOOK: usize = 10;
const SEARCHED: usize = 6;
/// Best sets beside which a rival is set.
const SETS: usize = 12;
/// Sets of a first look.
const FIRST_SETS: usize = 5;

/// What an effect pays (natural log) beside a rival of its own kind: either describes the same thing.
const KIN: f64 = 12.0;

/// Effects that could be a part of what a rival stands for.
fn kin(observations: &Observations, rival: &Rival, effect: &str) -> bool {
    match &rival.kind {
        Kind::Axis(axis) => {
            let own = format!("axis.{}.", observations.chain.axis(*axis).name);
            let smooth = [
                "straightness",
                "angular",
                "cyclic",
                "indexing",
                "error_motion",
            ];
            effect
                .strip_prefix(&own)
                .is_some_and(|kind| smooth.contains(&kind))
        }
        Kind::Time => ["thermal.drift", "thermal.spindle_growth"].contains(&effect),
        Kind::Direction => effect == "probe.pretravel_lobing",
        Kind::Region
        | Kind::Feature
        | Kind::Index
        | Kind::Covariate(_)
        | Kind::Grid
        | Kind::Noise => false,
    }
}

/// Priors of the candidates beside a rival.
fn beside(pool: &Pool<'_>, rival: &Rival, priors: &Priors) -> Priors {
    let mut priors = priors.clone();
    for (candidate, prior) in pool.candidates.iter().zip(&mut priors.log_prior) {
        let effect = &pool.shapes.variants[candidate.variant].effect;
        if kin(pool.shapes.observations, rival, effect) {
            *prior -= KIN;
        }
    }
    priors
}

/// Sets every rival beside the best sets, and searches anew beside those that do well.
pub(crate) fn challenge(
    pool: &Pool<'_>,
    scored: &[Scored],
    rivals: &[Rc<Rival>],
    priors: &Priors,
    models: &mut Vec<Model>,
) {
    let few = Few::new(pool, sets_of(scored));
    let mut best = models
        .iter()
        .map(|model| model.score)
        .fold(f64::NEG_INFINITY, f64::max);
    let looks = first_look(pool, rivals, priors, scored, best);
    let mut promising: Vec<(f64, usize, f64)> = Vec::new();
    for (_, place, middle) in looks {
        let rival = &rivals[place];
        let priors = beside(pool, rival, priors);
        let beside = few.seen.beside(rival);
        let mut own: Option<(f64, f64)> = None;
        let powers = powers(rival);
        let near = middle.saturating_sub(1)..(middle + 2).min(powers.len());
        for &power in &powers[near] {
            let price = price(rival);
            let whitened = beside.products(power, &few.plain);
            // At the sizes that they have without the rival, only the best are worth more.
            let mut looked: Vec<(f64, &Fitted)> = (few.sets.iter())
                .map(|fitted| (fitted.look(&whitened) + priors.of(&fitted.set), fitted))
                .collect();
            looked.sort_by(|one, other| other.0.total_cmp(&one.0));
            for (_, Fitted { set, places, .. }) in looked.into_iter().take(SETS) {
                let score = whitened.log_evidence(places) + priors.of(set) + price;
                models.push(Model {
                    set: set.clone(),
                    rival: Some((place, power)),
                    probability: 0.0,
                    score,
                });
                if own.is_none_or(|(known, _)| score > known) {
                    own = Some((score, power));
                }
            }
        }
        if let Some((score, power)) = own {
            best = best.max(score);
            promising.push((score, place, power));
        }
    }
    promising.sort_by(|one, other| other.0.total_cmp(&one.0));
    let mut all = None;
    for (score, place, power) in promising.into_iter().take(SEARCHED) {
        if score < best - FAR_BEHIND {
            break;
        }
        let rival = &rivals[place];
        let all = all.get_or_insert_with(|| Seen::new(pool.candidates.iter(), pool.y, pool.active));
        let whitened = all.beside(rival).products(power, &pool.products);
        let priors = beside(pool, rival, priors);
        for found in search(&whitened, &priors, 6, &mut Known::new())
            .into_iter()
            .take(60)
        {
            best = best.max(found.score + price(rival));
            models.push(Model {
                set: found.set,
                rival: Some((place, power)),
                probability: 0.0,
                score: found.score + price(rival),
            });
        }
    }
}

/// Some sets, with what of their candidates is set beside every rival: the whole library would cost too much.
struct Few {
    seen: Seen,
    /// Products without a rival.
    plain: Products,
    /// Those that can be solved.
    sets: Vec<Fitted>,
}

impl Few {
    fn new(pool: &Pool<'_>, sets: Vec<Vec<usize>>) -> Self {
        let mut members: Vec<usize> = sets.iter().flatten().copied().collect();
        members.sort_unstable();
        members.dedup();
        let candidates = members.iter().map(|&member| &pool.candidates[member]);
        let plain = pool.products.part(&members);
        let fitted = |set: Vec<usize>| {
            let places = set
                .iter()
                .map(|member| members.partition_point(|other| other < member));
            let places: Vec<usize> = places.collect();
            let sizes = plain.fit(&places)?.sizes;
            Some(Fitted { set, places, sizes })
        };
        Self {
            seen: Seen::new(candidates, pool.y, pool.active),
            sets: sets.into_iter().filter_map(fitted).collect(),
            plain,
        }
    }
}

/// A set with the sizes that it has without a rival.
struct Fitted {
    set: Vec<usize>,
    /// Places of its candidates among those that are set beside every rival.
    places: Vec<usize>,
    sizes: Vec<f64>,
}

impl Fitted {
    /// Log evidence beside a rival at these sizes.
    fn look(&self, whitened: &Products) -> f64 {
        whitened.log_evidence_at(&self.places, &self.sizes)
    }
}

/// Variances that are tried for a rival.
fn powers(rival: &Rival) -> &'static [f64] {
    let tried = match rival.kind {
        Kind::Noise => POWERS.iter().take_while(|&&power| power <= NOISY).count(),
        _ => POWERS.len(),
    };
    &POWERS[..tried]
}

fn price(rival: &Rival) -> f64 {
    let prior = match rival.kind {
        // The readings themselves show the grid.
        Kind::Grid => 0.5_f64.ln(),
        Kind::Noise => rival.log_prior,
        _ => rival.log_prior + UNKNOWN.ln(),
    };
    prior - (POWERS.len() as f64).ln()
}

/// The best sets, each of them less one of its effects, and nothing.
fn sets_of(scored: &[Scored]) -> Vec<Vec<usize>> {
    let mut sets: Vec<Vec<usize>> = vec![Vec::new()];
    for scored in scored.iter().take(SETS) {
        for size in 0..=scored.set.len() {
            let mut part = scored.set.clone();
            if size < part.len() {
                part.remove(size);
            }
            if !sets.contains(&part) {
                sets.push(part);
            }
        }
    }
    sets
}

/// Rivals worth a second look, best first, with the place of their best power.
fn first_look(
    pool: &Pool<'_>,
    rivals: &[Rc<Rival>],
    priors: &Priors,
    scored: &[Scored],
    best: f64,
) -> Vec<(f64, usize, usize)> {
    let mut sets: Vec<Vec<usize>> = Vec::new();
    for scored in scored {
        if sets.iter().all(|known| known.len() != scored.set.len()) {
            sets.push(scored.set.clone());
        }
        if sets.len() == FIRST_SETS {
            break;
        }
    }
    let few = Few::new(pool, sets);
    let sets: Vec<(&Fitted, f64)> = (few.sets.iter())
        .map(|fitted| (fitted, priors.of(&fitted.set)))
        .collect();
    let mut looks: Vec<(f64, usize, usize)> = Vec::new();
    for (place, rival) in rivals.iter().enumerate() {
        let beside = few.seen.beside(rival);
        let mut own: Option<(f64, usize, usize)> = None;
        for (number, &power) in powers(rival).iter().enumerate() {
            let whitened = beside.products(power, &few.plain);
            for (fitted, prior) in &sets {
                let score = fitted.look(&whitened) + prior + price(rival);
                if own.is_none_or(|(known, _, _)| score > known) {
                    own = Some((score, place, number));
                }
            }
        }
        looks.extend(own);
    }
    looks.sort_by(|one, other| other.0.total_cmp(&one.0));
    let best = looks.first().map_or(best, |look| look.0.max(best));
    looks.truncate(SECOND_LOOK);
    looks.retain(|look| look.0 > best - OUT_OF_SIGHT);
    looks
}

/// Columns of some candidates and, as the last, the deviations, over the rows in use.
pub(crate) struct Seen(DMatrix<f64>);

impl Seen {
    pub(crate) fn new<'c>(
        candidates: impl Iterator<Item = &'c Candidate>,
        y: &[f64],
        active: &[bool],
    ) -> Self {
        let rows = Rows::plain(active);
        let y = [y.to_vec()];
        let blocks = candidates.map(|candidate| candidate.block.as_slice());
        Self(side_by_side(&rows, blocks.chain([y.as_slice()]), 0).0)
    }

    /// Them beside a rival over the same rows.
    pub(crate) fn beside<'a>(&'a self, rival: &'a Rival) -> Beside<'a> {
        Beside(rival.meet(&self.0))
    }
}

/// The candidates and the deviations beside a rival.
pub(crate) struct Beside<'a>(Met<'a>);

impl Beside<'_> {
    /// The products with the rival's part of the rows whitened, for a variance over that of the noise.
    pub(crate) fn products(&self, power: f64, plain: &Products) -> Products {
        let (known, log_determinant) = self.0.had(power);
        let count = plain.qy.len();
        let mut whitened = plain.clone();
        for (column, known) in known.column_iter().take(count).enumerate() {
            let own = &mut whitened.qq[column * count..(column + 1) * count];
            for (value, known) in own.iter_mut().zip(&known) {
                *value -= known;
            }
            whitened.qy[column] -= known[count];
        }
        whitened.yy -= known[(count, count)];
        whitened.offset += 0.5 * log_determinant;
        whitened
    }
}
