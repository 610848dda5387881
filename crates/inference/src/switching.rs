//! A displacement that is present in one of two states: levels, noise and states by expectation maximisation.
//!
//! y_t = L_t·w_s + noise, where s is the hidden state of a Markov chain of two ([`crate::markov`]) and L_t says how a
//! displacement shows in datum t. Levels and noise by the EM of Baum et al. (1970) in the form of Hamilton (1990,
//! J. Econometrics 45, 39–70); the probabilities of leaving a state are integrated over a grid, so that a chain that changes
//! often and one that hardly does are equals at first. Values in m.

use crate::fixed_point::RESOLUTION;
use crate::linear::{cholesky, dot, solve_cholesky};
use crate::markov::{Densities, MarkovChain, Smoothed};

/// Probabilities of leaving a state that are tried, for each of the two: from a change in fifty data to independent draws.
const LEAVES: [f64; 5] = [0.02, 0.05, 0.12, 0.25, 0.5];
/// Iterations of the expectation maximisation, at most.
const ITERATIONS: usize = 25;
/// It ends when the log likelihood rises by less than this.
const RISEN: f64 = 1e-2;
/// Chains of less than this share of the likelihood do not count.
const UNLIKELY: f64 = 1e-3;
/// Ridge of the normal equations of a level, relative to the mean power of the loadings.
const RIDGE: f64 = 1e-9;

/// A signal of two states.
#[derive(Debug, Clone)]
pub struct TwoStates {
    /// True for each datum that was more probably taken in the second state.
    pub second: Vec<bool>,
    /// Log probability of this sequence of states, averaged over all chains that are tried.
    ///
    /// With it, the evidence of a model that is given the states is a lower bound of that of one that sums over all sequences,
    /// whatever else stands in the model.
    pub log_probability: f64,
    /// Log likelihood gained over a signal of one state, all sequences summed.
    pub gain: f64,
}

/// The most likely signal of two states near one whose probabilities of the second state are `start`.
///
/// `loadings` hold, for each direction of the displacement, how it shows in each datum. `None` where a level cannot be found,
/// or where two states gain less than `worth` over one.
pub fn two_states(
    values: &[f64],
    loadings: &[Vec<f64>],
    start: &[f64],
    worth: f64,
) -> Option<TwoStates> {
    let signal = Signal::new(values, loadings);
    let mut leaves = [0.2; 2];
    let mut best = f64::NEG_INFINITY;
    let mut densities = signal.densities(start)?;
    for _ in 0..ITERATIONS {
        let Smoothed {
            log_likelihood,
            probabilities,
            changes,
        } = MarkovChain::of_two(leaves).smoothed(&densities);
        if log_likelihood < best + RISEN {
            break;
        }
        best = log_likelihood;
        for (state, leaves) in leaves.iter_mut().enumerate() {
            let all: f64 = changes[state].iter().sum();
            *leaves = (changes[state][1 - state] + 1.0) / (all + 2.0);
        }
        densities = signal.densities(&of_second(&probabilities))?;
    }
    let one = signal.log_likelihood_of_one_state()?;
    // No chain that is tried can be much likelier than the likeliest.
    if best - one < worth {
        return None;
    }
    let (probabilities, log_likelihood) = over_all_chains(&densities);
    let second: Vec<bool> = probabilities.iter().map(|&second| second > 0.5).collect();
    let states = TwoStates {
        log_probability: log_probability(&second),
        second,
        gain: log_likelihood - one,
    };
    (states.gain >= worth).then_some(states)
}

/// Probabilities of the second state and the log likelihood, averaged over all chains that are tried.
fn over_all_chains(densities: &Densities<2>) -> (Vec<f64>, f64) {
    let mut chains: Vec<(MarkovChain<2>, f64)> = Vec::with_capacity(LEAVES.len() * LEAVES.len());
    for first in LEAVES {
        for second in LEAVES {
            let chain = MarkovChain::of_two([first, second]);
            let log_likelihood = chain.log_likelihood(densities);
            chains.push((chain, log_likelihood));
        }
    }
    let most = (chains.iter()).fold(f64::NEG_INFINITY, |most, (_, own)| most.max(*own));
    let total: f64 = chains.iter().map(|(_, own)| (own - most).exp()).sum();
    let mut mean = vec![0.0; densities.count()];
    let mut counted = 0.0;
    for (chain, log_likelihood) in &chains {
        let weight = (log_likelihood - most).exp() / total;
        if weight < UNLIKELY {
            continue;
        }
        counted += weight;
        let own = of_second(&chain.smoothed(densities).probabilities);
        for (mean, own) in mean.iter_mut().zip(own) {
            *mean += weight * own;
        }
    }
    for mean in &mut mean {
        *mean /= counted;
    }
    (mean, most + (total / chains.len() as f64).ln())
}

/// Log probability of a sequence of states, averaged over all chains that are tried.
fn log_probability(second: &[bool]) -> f64 {
    let certain = second.iter().map(|&second| {
        if second {
            [f64::NEG_INFINITY, 0.0]
        } else {
            [0.0, f64::NEG_INFINITY]
        }
    });
    over_all_chains(&Densities::new(certain)).1
}

fn of_second(probabilities: &[[f64; 2]]) -> Vec<f64> {
    probabilities.iter().map(|both| both[1]).collect()
}

struct Signal<'a> {
    values: &'a [f64],
    loadings: &'a [Vec<f64>],
    /// Of each datum, the products of each loading with those up to itself and with the value: an entry of the normal equations each.
    products: Vec<Vec<f64>>,
    /// Their sums, the normal equations of a signal of one state.
    of_one: Vec<f64>,
}

impl<'a> Signal<'a> {
    fn new(values: &'a [f64], loadings: &'a [Vec<f64>]) -> Self {
        let with = |(index, one): (usize, &'a Vec<f64>)| {
            let others = loadings[..=index].iter().map(Vec::as_slice);
            others.chain([values]).map(move |other| {
                one.iter()
                    .zip(other)
                    .map(|(one, other)| one * other)
                    .collect()
            })
        };
        let products: Vec<Vec<f64>> = loadings.iter().enumerate().flat_map(with).collect();
        Self {
            values,
            loadings,
            of_one: products
                .iter()
                .map(|product| product.iter().sum())
                .collect(),
            products,
        }
    }

    /// Log densities of the data in both states, at the levels and the noise that are most likely for these probabilities.
    fn densities(&self, second: &[f64]) -> Option<Densities<2>> {
        let of_second: Vec<f64> = self.products.iter().map(|own| dot(own, second)).collect();
        let of_first: Vec<f64> = (self.of_one.iter().zip(&of_second))
            .map(|(all, second)| all - second)
            .collect();
        let levels = [self.level(&of_first)?, self.level(&of_second)?];
        let errors: Vec<[f64; 2]> = (0..self.values.len())
            .map(|datum| [0, 1].map(|state| self.values[datum] - self.shown(&levels[state], datum)))
            .collect();
        let power: f64 = (errors.iter().zip(second))
            .map(|(errors, second)| {
                (1.0 - second) * errors[0] * errors[0] + second * errors[1] * errors[1]
            })
            .sum();
        let variance = power / self.values.len() as f64 + RESOLUTION * RESOLUTION;
        let constant = (std::f64::consts::TAU * variance).ln();
        let density = |error: f64| -0.5 * (error * error / variance + constant);
        Some(Densities::new(errors.iter().map(|both| both.map(density))))
    }

    /// Weighted least squares of one level from the weighted sums of the products.
    fn level(&self, sums: &[f64]) -> Option<Vec<f64>> {
        let n = self.loadings.len();
        let mut normal = vec![0.0; n * n];
        let mut right = vec![0.0; n];
        for i in 0..n {
            let first = i * (i + 3) / 2;
            normal[i * n..=i * n + i].copy_from_slice(&sums[first..=first + i]);
            normal[i * n + i] += RIDGE * self.of_one[first + i];
            right[i] = sums[first + i + 1];
        }
        cholesky(&mut normal, n)?;
        solve_cholesky(&normal, n, &mut right);
        Some(right)
    }

    fn shown(&self, level: &[f64], datum: usize) -> f64 {
        let loadings = self.loadings.iter().zip(level);
        loadings.map(|(own, level)| own[datum] * level).sum()
    }

    /// Largest log likelihood of a signal of one state.
    fn log_likelihood_of_one_state(&self) -> Option<f64> {
        let level = self.level(&self.of_one)?;
        let error = |datum: usize| self.values[datum] - self.shown(&level, datum);
        let power: f64 = (0..self.values.len())
            .map(|datum| error(datum).powi(2))
            .sum();
        let count = self.values.len() as f64;
        let variance = power / count + RESOLUTION * RESOLUTION;
        Some(-0.5 * count * (1.0 + (std::f64::consts::TAU * variance).ln()))
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    const COUNT: usize = 120;

    const ANY: f64 = f64::NEG_INFINITY;

    fn start(values: &[f64]) -> Vec<f64> {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let above = values.iter().map(|&value| value > mean);
        above.map(|above| if above { 0.9 } else { 0.1 }).collect()
    }

    /// Monte Carlo: AR(1) noise of any correlation gains less from two states than from its correlation, and white noise
    /// nothing; a signal that switches by four times its noise gains more from two states, and the states are found.
    #[test]
    fn switching_is_told_from_correlated_noise() {
        let mut random = Pcg64Mcg::seed_from_u64(8_128);
        let ones = [vec![1.0; COUNT]];
        for trial in 0..60 {
            let noise =
                |random: &mut Pcg64Mcg| -> f64 { 1e-6 * random.sample::<f64, _>(StandardNormal) };
            let lag1 = [0.0, 0.4, 0.7, 0.85][trial % 4];
            let mut correlated = vec![noise(&mut random)];
            for datum in 1..COUNT {
                let fresh = noise(&mut random) * f64::sqrt(1.0 - lag1 * lag1);
                correlated.push(lag1 * correlated[datum - 1] + fresh);
            }
            let found = two_states(&correlated, &ones, &start(&correlated), ANY).expect("solvable");
            assert!(
                found.gain < ar1_gain(&correlated) + 3.0,
                "{lag1}: {}",
                found.gain
            );
            let mut state = false;
            let states: Vec<bool> = (0..COUNT)
                .map(|_| {
                    state ^= random.random_bool(0.15);
                    state
                })
                .collect();
            let switching: Vec<f64> = (states.iter())
                .map(|&state| noise(&mut random) + if state { 4e-6 } else { 0.0 })
                .collect();
            let found = two_states(&switching, &ones, &start(&switching), ANY).expect("solvable");
            assert!(found.gain > ar1_gain(&switching) + 10.0, "{}", found.gain);
            let right = (found.second.iter().zip(&states))
                .filter(|(second, state)| second == state)
                .count();
            assert!(right.min(COUNT - right) <= 6, "{right}");
        }
    }

    /// Log likelihood that AR(1) noise gains over white noise, at its estimated correlation.
    fn ar1_gain(values: &[f64]) -> f64 {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let left: Vec<f64> = values.iter().map(|value| value - mean).collect();
        let power = dot(&left, &left);
        let along: f64 = left.windows(2).map(|pair| pair[0] * pair[1]).sum();
        let lag1 = along / power;
        -0.5 * values.len() as f64 * (1.0 - lag1 * lag1).ln()
    }
}
