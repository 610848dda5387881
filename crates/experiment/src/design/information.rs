//! Expected information of touches about explanations with Gaussian predictions.
//!
//! After Box and Hill (1967), in the form that does not grow without bound once two explanations
//! are discriminated: the pairwise bound of Kolchinsky and Tracey (2017) on the entropy of a mixture with Bhattacharyya's
//! distances B, I(class) ≈ Σ pᵢ ln [Σ_{j in i's class} pⱼ e^{−Bᵢⱼ} / (p_class Σⱼ pⱼ e^{−Bᵢⱼ})], in nats. Touches are
//! chosen one by one, then exchanged. The chance to resolve is drawn from the explanations themselves with a fixed seed.

use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use inference::linear::{add_scaled, cholesky, dot, forward, scale};

/// Weight of the distances beside the information: a reserve against inexact predictions.
const RESERVE: f64 = 1e-2;
/// Distances beyond this add nothing.
const FAR_APART: f64 = 25.0;
/// Seed of the drawn outcomes.
const SEED: u64 = 1967;
/// Posterior probability above which an explanation counts as certain.
pub(crate) const SURE: f64 = 0.95;

/// What one explanation predicts for all candidates.
#[derive(Debug, Clone)]
pub(crate) struct Prediction {
    /// Probability.
    pub(crate) weight: f64,
    /// Number of its class: explanations of one class need not be discriminated.
    pub(crate) class: usize,
    /// Expected deviations, m.
    pub(crate) mean: Vec<f64>,
    /// Covariance of the expectation, m², row-major.
    pub(crate) covariance: Vec<f64>,
    /// Variance of the noise of a touch, m².
    pub(crate) noise: f64,
}

impl Prediction {
    /// Covariances of what is expected of a candidate with what is expected of each.
    fn covariances(&self, index: usize) -> &[f64] {
        let count = self.mean.len();
        &self.covariance[index * count..(index + 1) * count]
    }

    fn between(&self, one: usize, other: usize) -> f64 {
        self.covariances(one)[other]
    }

    fn variance(&self, index: usize) -> f64 {
        self.between(index, index) + self.noise
    }
}

/// A Gaussian over all candidates, conditional on the touches chosen so far.
#[derive(Clone)]
struct Conditional {
    /// Per chosen touch, the column of the Cholesky factor that it makes, over all candidates.
    columns: Vec<Vec<f64>>,
    /// Variance of a touch of each candidate, noise included, m².
    rest: Vec<f64>,
    /// Least value in spite of rounding, m².
    least: Vec<f64>,
    log_determinant: f64,
}

impl Conditional {
    /// The prior: no touch is chosen.
    fn new(variances: Vec<f64>) -> Self {
        Self {
            columns: Vec::new(),
            least: variances.iter().map(|own| 1e-9 * own).collect(),
            rest: variances,
            log_determinant: 0.0,
        }
    }

    fn variance(&self, index: usize) -> f64 {
        self.rest[index].max(self.least[index])
    }

    /// Takes a touch whose covariances with all candidates are `crossed`; gives its standard deviation before.
    fn take(&mut self, index: usize, mut crossed: Vec<f64>) -> f64 {
        let variance = self.variance(index);
        for known in &self.columns {
            add_scaled(&mut crossed, -known[index], known);
        }
        scale(&mut crossed, 1.0 / variance.sqrt());
        for (rest, own) in self.rest.iter_mut().zip(&crossed) {
            *rest -= own * own;
        }
        self.log_determinant += variance.ln();
        self.columns.push(crossed);
        variance.sqrt()
    }
}

/// Two explanations and the distance of their predictions of the chosen touches.
#[derive(Clone)]
struct Pair {
    one: usize,
    other: usize,
    conditional: Conditional,
    /// Difference of what they expect of each candidate, conditional on the chosen touches, m.
    apart: Vec<f64>,
    /// Square of the whitened difference of the chosen touches.
    far: f64,
}

/// The state of a choice.
#[derive(Clone)]
struct Choice<'a> {
    predictions: &'a [Prediction],
    chosen: Vec<usize>,
    single: Vec<Conditional>,
    pairs: Vec<Pair>,
}

impl<'a> Choice<'a> {
    fn new(predictions: &'a [Prediction]) -> Self {
        let variances: Vec<Vec<f64>> = (predictions.iter())
            .map(|own| {
                (0..own.mean.len())
                    .map(|index| own.variance(index))
                    .collect()
            })
            .collect();
        let mut pairs = Vec::new();
        for one in 0..predictions.len() {
            for other in one + 1..predictions.len() {
                let means = (predictions[one].mean.iter()).zip(&predictions[other].mean);
                pairs.push(Pair {
                    one,
                    other,
                    conditional: Conditional::new(middle(&variances[one], &variances[other])),
                    apart: means.map(|(a, b)| a - b).collect(),
                    far: 0.0,
                });
            }
        }
        Self {
            predictions,
            chosen: Vec::new(),
            single: variances.into_iter().map(Conditional::new).collect(),
            pairs,
        }
    }

    /// Information with one more touch.
    fn with(&self, index: usize) -> f64 {
        let singles: Vec<f64> = (self.single.iter())
            .map(|conditional| conditional.log_determinant + conditional.variance(index).ln())
            .collect();
        let distances = self.pairs.iter().map(|pair| {
            let variance = pair.conditional.variance(index);
            let far = pair.far + pair.apart[index] * pair.apart[index] / variance;
            let both = 0.5 * (singles[pair.one] + singles[pair.other]);
            let spread = pair.conditional.log_determinant + variance.ln() - both;
            (far / 8.0 + 0.5 * spread).max(0.0)
        });
        information(self.predictions, &self.pairs, distances)
    }

    fn take(&mut self, index: usize) {
        for (conditional, prediction) in self.single.iter_mut().zip(self.predictions) {
            conditional.take(index, prediction.covariances(index).to_vec());
        }
        for pair in &mut self.pairs {
            let (a, b) = (&self.predictions[pair.one], &self.predictions[pair.other]);
            let crossed = middle(a.covariances(index), b.covariances(index));
            let deviation = pair.conditional.take(index, crossed);
            let apart = pair.apart[index] / deviation;
            pair.far += apart * apart;
            if let Some(column) = pair.conditional.columns.last() {
                add_scaled(&mut pair.apart, -apart, column);
            }
        }
        self.chosen.push(index);
    }

    fn of(predictions: &'a [Prediction], chosen: &[usize]) -> Self {
        let mut choice = Self::new(predictions);
        for &index in chosen {
            choice.take(index);
        }
        choice
    }

    /// The best touch to add that is allowed and not yet taken twice; the first of equals.
    fn best(&self, allowed: &mut dyn FnMut(usize) -> bool) -> Option<(usize, f64)> {
        let count = self.predictions.first().map_or(0, |first| first.mean.len());
        let mut order: Vec<(f64, usize)> = (0..count)
            .filter(|index| self.chosen.iter().filter(|known| *known == index).count() < 2)
            .map(|index| (self.with(index), index))
            .collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        order
            .into_iter()
            .find(|&(_, index)| allowed(index))
            .map(|(gain, index)| (index, gain))
    }
}

/// The values half way between others.
fn middle(one: &[f64], other: &[f64]) -> Vec<f64> {
    one.iter().zip(other).map(|(x, y)| 0.5 * (x + y)).collect()
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
    let nats: f64 = (predictions.iter().enumerate())
        .map(|(index, own)| own.weight * (same[index] / (classes[index] * all[index])).ln())
        .sum();
    nats + RESERVE * beyond
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
            Some((index, gain)) if gain > known + 1e-6 => {
                choice.take(index);
                known = gain;
            }
            _ => break,
        }
    }
    for _ in 0..exchanges {
        let before = known;
        for index in 0..choice.chosen.len() {
            let mut others = choice.chosen.clone();
            others.remove(index);
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

/// Probability that after these touches one class is certain, from `draws` simulated outcomes.
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
        let index = predictions.iter().position(|own| {
            at -= own.weight;
            at < 0.0
        });
        let index = index.unwrap_or(predictions.len() - 1);
        let fresh: Vec<f64> = (0..count).map(|_| random.sample(StandardNormal)).collect();
        let (factor, _) = &factors[index];
        let seen: Vec<f64> = (0..count)
            .map(|i| {
                let noise = dot(&factor[i * count..=i * count + i], &fresh[..=i]);
                predictions[index].mean[chosen[i]] + noise
            })
            .collect();
        let scores: Vec<f64> = (predictions.iter().zip(&factors))
            .map(|(own, (factor, log_determinant))| {
                let mut residuals: Vec<f64> = (seen.iter().zip(chosen))
                    .map(|(value, &index)| value - own.mean[index])
                    .collect();
                forward(factor, count, &mut residuals);
                own.weight.ln() - 0.5 * (dot(&residuals, &residuals) + log_determinant)
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
