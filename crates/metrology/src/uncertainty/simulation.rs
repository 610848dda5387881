//! Monte Carlo: propagation of distributions, with as many trials as it takes (JCGM 101 clause 7, JCGM 102 clause 7).

use nalgebra::{SMatrix, SVector};
use rand::SeedableRng;
use rand_pcg::Pcg64;

use super::UncertaintyError;
use crate::statistics::standard_deviation;

/// When a simulation has seen enough.
///
/// JCGM 101 7.9 stops when twice the standard deviation of the mean of the blocks' results is below half a unit of the
/// last of two significant digits. That is between 0.5 and 5 % of u, by its leading digits, and the number of trials
/// jumps a hundredfold with them. Here the bound is relative whatever the digits, and it is applied to the standard
/// uncertainties, which are what is stated; the estimate is the measured value itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stability {
    /// Trials of one block; at least 2.
    pub block: usize,
    /// Fewest blocks: the scatter of fewer says little.
    pub least_blocks: usize,
    /// Most blocks: beyond these the result is given as it is, and [`Simulation::stable`] is false.
    pub most_blocks: usize,
    /// Twice the standard deviation of each standard uncertainty, over that uncertainty, at which it is stable.
    pub tolerance: f64,
}

impl Default for Stability {
    /// 5 % of u: the coarsest that two significant digits allow. A normal result takes about 1000 trials for it.
    fn default() -> Self {
        Self {
            block: 100,
            least_blocks: 10,
            most_blocks: 100,
            tolerance: 0.05,
        }
    }
}

/// Largest share of trials in which the model may have no value: an iterative fit may fail for a few of them, and leaving
/// out one in twenty changes a standard uncertainty by less than the tolerance of its stability unless all lie in one tail.
const UNDEFINED_SHARE: f64 = 0.05;

/// Result of a simulation of N values.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation<const N: usize> {
    /// Mean of the trials, unit of the values.
    pub mean: SVector<f64, N>,
    /// Covariance of the trials.
    pub covariance: SMatrix<f64, N, N>,
    /// The values of all trials in which the model has one, in the order drawn.
    pub values: Vec<[f64; N]>,
    /// False where the most blocks were drawn and a standard uncertainty still was not stable.
    pub stable: bool,
}

impl<const N: usize> Simulation<N> {
    /// Standard uncertainty of each value.
    pub fn standard_uncertainties(&self) -> [f64; N] {
        std::array::from_fn(|index| self.covariance[(index, index)].max(0.0).sqrt())
    }
}

/// Draws `trial` until the standard uncertainties of its N values are stable.
///
/// `trial` draws its inputs from the generator (for example by [`super::Input::draw`]) and evaluates the model; `None`
/// where the model has no value for them. The generator starts from `seed`, so that equal calls give equal results.
///
/// # Errors
/// More than one trial in twenty without a finite value.
pub fn simulate<const N: usize>(
    stability: &Stability,
    seed: u64,
    mut trial: impl FnMut(&mut Pcg64) -> Option<[f64; N]>,
) -> Result<Simulation<N>, UncertaintyError> {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut values: Vec<[f64; N]> = Vec::new();
    let mut blocks: Vec<[f64; N]> = Vec::new();
    let (mut trials, mut stable) = (0, false);
    while !stable && blocks.len() < stability.most_blocks {
        let start = values.len();
        for _ in 0..stability.block {
            let drawn = trial(&mut random);
            values.extend(drawn.filter(|values| values.iter().all(|v| v.is_finite())));
        }
        trials += stability.block;
        let undefined = trials - values.len();
        let enough = blocks.len() + 1 >= stability.least_blocks;
        if enough && undefined as f64 > UNDEFINED_SHARE * trials as f64 {
            return Err(UncertaintyError::TrialsUndefined { undefined, trials });
        }
        let (_, covariance) = moments(&values[start..]);
        blocks.push(std::array::from_fn(|i| covariance[(i, i)].max(0.0).sqrt()));
        stable = enough && is_stable(&blocks, stability.tolerance);
    }
    let (mean, covariance) = moments(&values);
    Ok(Simulation {
        mean,
        covariance,
        values,
        stable,
    })
}

/// JCGM 101 7.9.4: the standard deviation of the mean over the blocks, twice, against the tolerance, for each value.
fn is_stable<const N: usize>(blocks: &[[f64; N]], tolerance: f64) -> bool {
    (0..N).all(|index| {
        let of_value: Vec<f64> = blocks.iter().map(|block| block[index]).collect();
        let deviation = standard_deviation(&of_value) / (of_value.len() as f64).sqrt();
        2.0 * deviation <= tolerance * crate::statistics::mean(&of_value)
    })
}

/// Mean and covariance, divisor n − 1.
fn moments<const N: usize>(values: &[[f64; N]]) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
    let count = values.len() as f64;
    let vectors = || values.iter().map(|value| SVector::from(*value));
    let mean = vectors().sum::<SVector<f64, N>>() / count;
    let squares = vectors()
        .map(|value| (value - mean) * (value - mean).transpose())
        .sum::<SMatrix<f64, N, N>>();
    (mean, squares / (count - 1.0))
}
