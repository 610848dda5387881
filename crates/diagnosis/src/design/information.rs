//! How much touches say about explanations, each of which predicts them as Gaussian.
//!
//! Expected information after Box and Hill (1967), in the form that does not grow without bound once two explanations
//! are parted: the pairwise bound of Kolchinsky and Tracey (2017) on the entropy of a mixture with Bhattacharyya's
//! distances B, I(class) ≈ Σ pᵢ ln [Σ_{j in i's class} pⱼ e^{−Bᵢⱼ} / (p_class Σⱼ pⱼ e^{−Bᵢⱼ})], in nats. Touches are
//! chosen one by one, then exchanged. The chance to resolve is drawn from the explanations themselves with a fixed seed.

use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use crate::evidence::{cholesky, dot};

/// Weight of distances beyond what the information counts: a reserve against predictions that are not quite right.
const RESERVE: f64 = 1e-2;
/// Distances beyond this add nothing.
const FAR_APART: f64 = 25.0;
/// Seed of the drawn outcomes.
const SEED: u64 = 1967;
/// A posterior above this is sure.
pub(crate) const SURE: f64 = 0.95;

/// What one explanation predicts for all candidates.
#[derive(Debug, Clone)]
pub(crate) struct Prediction {
    /// Probability.
    pub(crate) weight: f64,
    /// Number of its class: explanations of one class need not be parted.
    pub(crate) class: usize,
    /// Expected deviations, m.
    pub(crate) mean: Vec<f64>,
    /// Covariance of the expectation, m², row-major.
    pub(crate) covariance: Vec<f64>,
    /// Variance of the noise of a touch, m².
    pub(crate) noise: f64,
}

impl Prediction {
    fn between(&self, one: usize, other: usize) -> f64 {
        self.covariance[one * self.mean.len() + other]
    }

    fn own(&self, place: usize) -> f64 {
        self.between(place, place) + self.noise
    }
}

/// A Gaussian over the chosen touches, grown one by one.
#[derive(Clone, Default)]
struct Grown {
    /// Rows of the Cholesky factor.
    rows: Vec<Vec<f64>>,
    log_determinant: f64,
}

impl Grown {
    /// The next row of the factor without its end, and the square of its end.
    fn next(&self, crossed: &[f64], own: f64) -> (Vec<f64>, f64) {
        let mut row = Vec::with_capacity(self.rows.len() + 1);
        for (known, cross) in self.rows.iter().zip(crossed) {
            let seen = dot(&known[..row.len()], &row);
            row.push((cross - seen) / known[row.len()]);
        }
        let rest = (own - dot(&row, &row)).max(1e-9 * own);
        (row, rest)
    }

    fn push(&mut self, mut row: Vec<f64>, rest: f64) {
        row.push(rest.sqrt());
        self.rows.push(row);
        self.log_determinant += rest.ln();
    }
}

/// Two explanations and how far apart they are by the chosen touches.
#[derive(Clone)]
struct Pair {
    one: usize,
    other: usize,
    grown: Grown,
    /// Whitened difference of the means.
    apart: Vec<f64>,
}

/// The state of a choice.
#[derive(Clone)]
struct Choice<'a> {
    predictions: &'a [Prediction],
    chosen: Vec<usize>,
    single: Vec<Grown>,
    pairs: Vec<Pair>,
}

impl<'a> Choice<'a> {
    fn new(predictions: &'a [Prediction]) -> Self {
        let mut pairs = Vec::new();
        for one in 0..predictions.len() {
            for other in one + 1..predictions.len() {
                pairs.push(Pair {
                    one,
                    other,
                    grown: Grown::default(),
                    apart: Vec::new(),
                });
            }
        }
        Self {
            predictions,
            chosen: Vec::new(),
            single: vec![Grown::default(); predictions.len()],
            pairs,
        }
    }

    fn crossed(&self, prediction: &Prediction, place: usize) -> Vec<f64> {
        self.chosen
            .iter()
            .map(|&known| prediction.between(known, place))
            .collect()
    }

    /// Information with one more touch.
    fn with(&self, place: usize) -> f64 {
        let singles: Vec<(Vec<f64>, f64)> = self
            .predictions
            .iter()
            .zip(&self.single)
            .map(|(prediction, grown)| {
                let crossed = self.crossed(prediction, place);
                let (_, rest) = grown.next(&crossed, prediction.own(place));
                (crossed, grown.log_determinant + rest.ln())
            })
            .collect();
        let distances = self.pairs.iter().map(|pair| {
            let (one, other) = (&singles[pair.one], &singles[pair.other]);
            let (a, b) = (&self.predictions[pair.one], &self.predictions[pair.other]);
            let crossed: Vec<f64> = (one.0.iter().zip(&other.0))
                .map(|(x, y)| 0.5 * (x + y))
                .collect();
            let (row, rest) = pair
                .grown
                .next(&crossed, 0.5 * (a.own(place) + b.own(place)));
            let apart = (a.mean[place] - b.mean[place] - dot(&row, &pair.apart)) / rest.sqrt();
            let far = dot(&pair.apart, &pair.apart) + apart * apart;
            let spread = pair.grown.log_determinant + rest.ln() - 0.5 * (one.1 + other.1);
            (far / 8.0 + 0.5 * spread).max(0.0)
        });
        information(self.predictions, &self.pairs, distances)
    }

    fn take(&mut self, place: usize) {
        let crossed: Vec<Vec<f64>> = self
            .predictions
            .iter()
            .map(|prediction| self.crossed(prediction, place))
            .collect();
        for ((grown, prediction), crossed) in
            self.single.iter_mut().zip(self.predictions).zip(&crossed)
        {
            let (row, rest) = grown.next(crossed, prediction.own(place));
            grown.push(row, rest);
        }
        for pair in &mut self.pairs {
            let (a, b) = (&self.predictions[pair.one], &self.predictions[pair.other]);
            let mixed: Vec<f64> = (crossed[pair.one].iter().zip(&crossed[pair.other]))
                .map(|(x, y)| 0.5 * (x + y))
                .collect();
            let (row, rest) = pair.grown.next(&mixed, 0.5 * (a.own(place) + b.own(place)));
            let apart = (a.mean[place] - b.mean[place] - dot(&row, &pair.apart)) / rest.sqrt();
            pair.apart.push(apart);
            pair.grown.push(row, rest);
        }
        self.chosen.push(place);
    }

    fn of(predictions: &'a [Prediction], chosen: &[usize]) -> Self {
        let mut choice = Self::new(predictions);
        for &place in chosen {
            choice.take(place);
        }
        choice
    }

    /// The best touch to add that is allowed and not yet taken twice; the first of equals.
    fn best(&self, allowed: &mut dyn FnMut(usize) -> bool) -> Option<(usize, f64)> {
        let count = self.predictions.first().map_or(0, |first| first.mean.len());
        let mut order: Vec<(f64, usize)> = (0..count)
            .filter(|place| self.chosen.iter().filter(|known| *known == place).count() < 2)
            .map(|place| (self.with(place), place))
            .collect();
        order.sort_by(|one, other| other.0.total_cmp(&one.0).then(one.1.cmp(&other.1)));
        order
            .into_iter()
            .find(|&(_, place)| allowed(place))
            .map(|(gain, place)| (place, gain))
    }
}

/// Expected information about the class, nats, from the distances of the pairs.
fn information(
    predictions: &[Prediction],
    pairs: &[Pair],
    distances: impl Iterator<Item = f64>,
) -> f64 {
    let mut all: Vec<f64> = predictions.iter().map(|own| own.weight).collect();
    let mut same = all.clone();
    let mut classes = all.clone();
    let mut beyond = 0.0;
    for (pair, distance) in pairs.iter().zip(distances) {
        let (a, b) = (&predictions[pair.one], &predictions[pair.other]);
        let near = (-distance).exp();
        all[pair.one] += b.weight * near;
        all[pair.other] += a.weight * near;
        if a.class == b.class {
            same[pair.one] += b.weight * near;
            same[pair.other] += a.weight * near;
            classes[pair.one] += b.weight;
            classes[pair.other] += a.weight;
        } else {
            beyond += a.weight * b.weight * distance.min(FAR_APART);
        }
    }
    let told: f64 = (predictions.iter().enumerate())
        .map(|(place, own)| own.weight * (same[place] / (classes[place] * all[place])).ln())
        .sum();
    told + RESERVE * beyond
}

/// Chooses up to `touches` candidates, in the order of choice; `exchanges` rounds look for a better one for each.
///
/// `allowed` is asked only for candidates that would be taken.
pub(crate) fn choose(
    predictions: &[Prediction],
    touches: usize,
    exchanges: usize,
    allowed: &mut dyn FnMut(usize) -> bool,
) -> Vec<usize> {
    let mut choice = Choice::new(predictions);
    let mut known = 0.0;
    for _ in 0..touches {
        match choice.best(allowed) {
            Some((place, gain)) if gain > known + 1e-6 => {
                choice.take(place);
                known = gain;
            }
            _ => break,
        }
    }
    for _ in 0..exchanges {
        let before = known;
        for place in 0..choice.chosen.len() {
            let mut others = choice.chosen.clone();
            others.remove(place);
            let without = Choice::of(predictions, &others);
            if let Some((better, gain)) = without.best(allowed)
                && gain > known + 1e-6
            {
                choice = without;
                choice.take(better);
                known = gain;
            }
        }
        if known <= before {
            break;
        }
    }
    choice.chosen
}

/// Probability that after these touches one class is sure, drawn `draws` times.
pub(crate) fn chance(predictions: &[Prediction], chosen: &[usize], draws: usize) -> f64 {
    let count = chosen.len();
    let factors: Vec<(Vec<f64>, f64)> = predictions
        .iter()
        .map(|own| {
            let mut matrix = vec![0.0; count * count];
            for (i, &a) in chosen.iter().enumerate() {
                for (k, &b) in chosen.iter().enumerate() {
                    matrix[i * count + k] = own.between(a, b);
                }
                matrix[i * count + i] += own.noise;
            }
            let log_determinant = cholesky(&mut matrix, count).unwrap_or(f64::INFINITY);
            (matrix, log_determinant)
        })
        .collect();
    let total: f64 = predictions.iter().map(|own| own.weight).sum();
    let classes = predictions.iter().map(|own| own.class + 1).max();
    let mut random = Pcg64Mcg::seed_from_u64(SEED);
    let mut sure = 0;
    for _ in 0..draws {
        let mut at = random.random_range(0.0..1.0) * total;
        let place = predictions.iter().position(|own| {
            at -= own.weight;
            at < 0.0
        });
        let place = place.unwrap_or(predictions.len() - 1);
        let fresh: Vec<f64> = (0..count).map(|_| random.sample(StandardNormal)).collect();
        let (factor, _) = &factors[place];
        let seen: Vec<f64> = (0..count)
            .map(|i| {
                let noise = dot(&factor[i * count..=i * count + i], &fresh[..=i]);
                predictions[place].mean[chosen[i]] + noise
            })
            .collect();
        let scores: Vec<f64> = (predictions.iter().zip(&factors))
            .map(|(own, (factor, log_determinant))| {
                let mut left: Vec<f64> = (seen.iter().zip(chosen))
                    .map(|(value, &place)| value - own.mean[place])
                    .collect();
                forward(factor, count, &mut left);
                own.weight.ln() - 0.5 * (dot(&left, &left) + log_determinant)
            })
            .collect();
        let best = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut shares = vec![0.0; classes.unwrap_or(0)];
        for (score, own) in scores.iter().zip(predictions) {
            shares[own.class] += (score - best).exp();
        }
        let all: f64 = shares.iter().sum();
        sure += usize::from(shares.iter().any(|share| *share > SURE * all));
    }
    sure as f64 / draws.max(1) as f64
}

/// Solves in place with the lower triangle of a Cholesky factor.
fn forward(factor: &[f64], n: usize, right: &mut [f64]) {
    for i in 0..n {
        let seen = dot(&factor[i * n..i * n + i], &right[..i]);
        right[i] = (right[i] - seen) / factor[i * n + i];
    }
}
