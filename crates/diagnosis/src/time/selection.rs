//! Which limits are others than declared: search over sets of candidates, linearised about the best model so far.

use std::collections::BTreeMap;

use effects::motion::Scale;
use inference::candidate::Candidate;
use inference::evidence::InnerProducts;
use inference::search::{
    EvidenceCache, Priors, ScoredSet, default_beam_width, exchange_best, search,
};
use metrology::statistics::median;
use nalgebra::DMatrix;

use super::fit::{Fitted, STAMP, fit};
use super::{Rows, Setting};

/// A second in the unit of the inference, whose absolute defaults are lengths: a stamp is then as fine as a good scale.
const SECOND: f64 = 1e-3;
/// Rounds of linearisation, at most.
const ROUNDS: usize = 8;
/// Largest coefficient of a candidate at a definite value of a limit, over that value's own effect.
const PLAUSIBLE: f64 = 2.0;
/// Share of the time of a move that the motion model is not finer than.
const FINEST: f64 = 1e-3;
/// Log evidence by which an exchange may be worse whose set is then tried with one member less.
const CLOSE: f64 = 3.0;
/// A row that is farther off than this many robust standard deviations does not count: somebody held the machine.
const STRAY: f64 = 7.0;
/// Share of the rows that may be left out so.
const MAX_STRAY: f64 = 0.1;

/// The most probable set and how probable each effect is.
pub(super) struct Selected {
    pub(super) fitted: Fitted,
    /// Rows in use.
    pub(super) active: Vec<bool>,
    /// Probability of each effect of the library, by identifier.
    pub(super) probabilities: BTreeMap<String, f64>,
}

/// The most probable set of limits that are others than declared.
pub(super) fn select(rows: &Rows<'_>) -> Selected {
    let mut active = vec![true; rows.measured.len()];
    let mut selected = settle(rows, &active);
    for _ in 0..3 {
        let strays = strays(&rows.residuals(&selected.fitted.settings), &active);
        if strays.is_empty() {
            break;
        }
        for row in strays {
            active[row] = false;
        }
        selected = settle(rows, &active);
    }
    selected
}

/// Rows in use that no model of the rest would give.
fn strays(residuals: &[f64], active: &[bool]) -> Vec<usize> {
    let used: Vec<usize> = (0..active.len()).filter(|row| active[*row]).collect();
    let out = active.len() - used.len();
    let room = ((active.len() as f64 * MAX_STRAY) as usize).saturating_sub(out);
    let middle = median(&used.iter().map(|row| residuals[*row]).collect::<Vec<_>>());
    let off = |row: &usize| (residuals[*row] - middle).abs();
    let scale = 1.4826 * median(&used.iter().map(off).collect::<Vec<_>>());
    let scale = scale.max(STAMP);
    let mut strays: Vec<usize> = used
        .into_iter()
        .filter(|row| off(row) > STRAY * scale)
        .collect();
    strays.sort_by(|a, b| off(b).total_cmp(&off(a)));
    strays.truncate(room);
    strays
}

/// Search and fit in turn, until the set stands.
fn settle(rows: &Rows<'_>, active: &[bool]) -> Selected {
    let mut fitted = fit(rows, active, &[]);
    let mut best: Option<(f64, Fitted)> = None;
    let mut pool = Pool::about(rows, &fitted.settings);
    let mut found = pool.search(active);
    for _ in 0..ROUNDS {
        let next: Vec<Setting> = found
            .first()
            .map(|best| {
                best.set
                    .iter()
                    .map(|&member| pool.settings[member])
                    .collect()
            })
            .unwrap_or_default();
        let limits = |settings: &[Setting]| settings.iter().map(|one| one.0).collect::<Vec<_>>();
        let stands = limits(&next) == limits(&fitted.settings);
        fitted = fit(rows, active, &next);
        let score = score(rows, active, &fitted);
        if best.as_ref().is_none_or(|(known, _)| score > *known) {
            best = Some((score, fitted.clone()));
        }
        pool = Pool::about(rows, &fitted.settings);
        found = pool.search(active);
        if stands {
            break;
        }
    }
    let fitted = improved(rows, active, best.map_or(fitted, |(_, fitted)| fitted));
    let pool = Pool::about(rows, &fitted.settings);
    let found = pool.search(active);
    Selected {
        probabilities: pool.probabilities(rows, &found),
        fitted,
        active: active.to_vec(),
    }
}

/// The set after all single removals, exchanges and additions that improve it by its own fit: what linear columns cannot
/// tell of a model that is not linear.
fn improved(rows: &Rows<'_>, active: &[bool], start: Fitted) -> Fitted {
    let mut best = start;
    for _ in 0..ROUNDS {
        let members = best.settings.clone();
        let mut tried: Vec<Fitted> = Vec::new();
        for member in &members {
            let others: Vec<Setting> = members
                .iter()
                .copied()
                .filter(|one| one.0 != member.0)
                .collect();
            let exchanged = replaced(rows, active, &others, &rows.limits[member.0].effect);
            tried.extend(exchanged.into_iter().map(|(_, fitted)| fitted));
            tried.push(fit(rows, active, &others));
        }
        tried.extend(
            replaced(rows, active, &members, "")
                .into_iter()
                .map(|(_, fitted)| fitted),
        );
        let best_score = score(rows, active, &best);
        // An exchange that changes nothing may make another member idle.
        let close: Vec<Fitted> = (tried.iter())
            .filter(|one| {
                let exchanged = one.settings.len() == members.len();
                exchanged && score(rows, active, one) > best_score - CLOSE
            })
            .cloned()
            .collect();
        for one in close {
            for member in &one.settings {
                let others: Vec<Setting> = one
                    .settings
                    .iter()
                    .copied()
                    .filter(|other| other.0 != member.0)
                    .collect();
                tried.push(fit(rows, active, &others));
            }
        }
        let next = tried
            .into_iter()
            .max_by(|a, b| score(rows, active, a).total_cmp(&score(rows, active, b)));
        match next {
            Some(next) if score(rows, active, &next) > best_score + 1e-6 => best = next,
            _ => break,
        }
    }
    best
}

/// A set with one limit more, each of the library but those of effects that are in it and of `but`, fitted.
pub(super) fn replaced(
    rows: &Rows<'_>,
    active: &[bool],
    others: &[Setting],
    but: &str,
) -> Vec<(usize, Fitted)> {
    let effect = |limit: usize| rows.limits[limit].effect.as_str();
    let mut found = Vec::new();
    for limit in 0..rows.limits.len() {
        let taken = others.iter().any(|one| effect(one.0) == effect(limit));
        if taken || effect(limit) == but {
            continue;
        }
        let squares = |value: f64| {
            let mut settings = others.to_vec();
            settings.push((limit, value));
            let residuals = rows.residuals(&settings);
            let used = residuals.iter().zip(active).filter(|(_, used)| **used);
            used.map(|(s, _)| s * s).sum::<f64>()
        };
        let tried = rows.limits[limit].tried.iter().copied();
        let starts = tried.map(|value| (squares(value), value));
        if let Some((_, start)) = starts.min_by(|a, b| a.0.total_cmp(&b.0)) {
            let mut settings = others.to_vec();
            settings.push((limit, start));
            found.push((limit, fit(rows, active, &settings)));
        }
    }
    found
}

/// Log evidence of a set by its own fit (Schwarz 1978), with a price for the choice, and of the feed that the recorded axes show.
/// Differences of [`FINEST`] of a move count as noise: the motion model is no better.
pub(super) fn score(rows: &Rows<'_>, active: &[bool], fitted: &Fitted) -> f64 {
    let used = || active.iter().zip(&rows.measured).filter(|(used, _)| **used);
    let count = used().count() as f64;
    let finest = FINEST * FINEST * used().map(|(_, s)| s * s).sum::<f64>();
    let members = fitted.settings.len() as f64;
    let library = rows.limits.len() as f64;
    let feed = rows.feed_off(&fitted.settings);
    -0.5 * count * (fitted.squares + finest).ln()
        - members * (0.5 * count.ln() + library.ln())
        - 0.5 * feed * feed
}

/// Candidates about a model.
struct Pool {
    settings: Vec<Setting>,
    candidates: Vec<Candidate>,
    priors: Priors,
    /// Measured less modelled with the effects of the model's members added, in the unit of the inference.
    y: Vec<f64>,
}

impl Pool {
    fn about(rows: &Rows<'_>, model: &[Setting]) -> Self {
        let mut y = rows.residuals(model);
        let mut pool = Self {
            settings: Vec::new(),
            candidates: Vec::new(),
            priors: Priors {
                effect: Vec::new(),
                log_prior: Vec::new(),
                effects: 0,
            },
            y: Vec::new(),
        };
        let effect = |limit: usize| rows.limits[limit].effect.as_str();
        let mut numbers: BTreeMap<&str, usize> = BTreeMap::new();
        for limit in 0..rows.limits.len() {
            let next = numbers.len();
            numbers.entry(effect(limit)).or_insert(next);
        }
        pool.priors.effects = numbers.len();
        for limit in 0..rows.limits.len() {
            let without: Vec<Setting> = (model.iter().copied())
                .filter(|&(member, _)| effect(member) != effect(limit))
                .collect();
            let before = rows.durations(&without);
            let own = model.iter().find(|one| one.0 == limit);
            let mut tried = rows.limits[limit].tried.clone();
            if let Some(&(_, value)) = own {
                if rows.limits[limit].scale == Scale::Linear {
                    tried.clear();
                }
                tried.push(value);
            }
            let of_effect = (0..rows.limits.len()).filter(|other| effect(*other) == effect(limit));
            let price = (of_effect.count() * tried.len()) as f64;
            for value in tried {
                let mut settings = without.clone();
                settings.push((limit, value));
                let after = rows.durations(&settings);
                let longer = after
                    .iter()
                    .zip(&before)
                    .map(|(after, before)| after - before);
                let column: Vec<f64> = longer.collect();
                if own.is_some_and(|own| own.1 == value) {
                    for (sum, part) in y.iter_mut().zip(&column) {
                        *sum += part;
                    }
                }
                let scaled = DMatrix::from_iterator(
                    column.len(),
                    1,
                    column.iter().map(|s| s * SECOND * PLAUSIBLE),
                );
                let candidate = Candidate::from_scaled(
                    (limit, value),
                    &scaled,
                    &[PLAUSIBLE],
                    -price.ln(),
                    None,
                );
                if let Some(candidate) = candidate {
                    pool.settings.push((limit, value));
                    pool.priors.effect.push(numbers[effect(limit)]);
                    pool.priors.log_prior.push(candidate.log_prior);
                    pool.candidates.push(candidate);
                }
            }
        }
        pool.y = y.iter().map(|s| s * SECOND).collect();
        pool
    }

    fn search(&self, active: &[bool]) -> Vec<ScoredSet> {
        let blocks: Vec<&[Vec<f64>]> = self
            .candidates
            .iter()
            .map(|one| one.block.as_slice())
            .collect();
        let plausible = self.candidates.iter().flat_map(|one| &one.plausible);
        let products = InnerProducts::new(&blocks, &self.y, active).capped(plausible);
        let mut known = EvidenceCache::new();
        let mut found = search(&products, &self.priors, default_beam_width(), &mut known);
        exchange_best(&products, &self.priors, &mut found);
        found
    }

    /// Share of the probability of all sets found that holds each effect.
    fn probabilities(&self, rows: &Rows<'_>, found: &[ScoredSet]) -> BTreeMap<String, f64> {
        let best = found.first().map_or(0.0, |best| best.log_posterior);
        let weight = |set: &ScoredSet| (set.log_posterior - best).exp();
        let total: f64 = found.iter().map(weight).sum();
        let mut shares = BTreeMap::new();
        for limit in &rows.limits {
            shares.entry(limit.effect.clone()).or_insert(0.0);
        }
        for set in found {
            for &member in &set.set {
                let effect = &rows.limits[self.settings[member].0].effect;
                if let Some(share) = shares.get_mut(effect) {
                    *share += weight(set) / total;
                }
            }
        }
        shares
    }
}
