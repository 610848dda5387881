//! Hidden Markov chains: likelihood and state probabilities of a signal that switches between a few states.
//!
//! The likelihood is that of the forward recursion (Hamilton 1989, Econometrica 57, 357–384, eq. 4.5–4.8), the probabilities
//! given the whole signal are those of the backward recursion (Kim 1994, J. Econometrics 60, 1–22, eq. 2.20). What a state
//! means is left to the caller, who gives the log density of each datum in each state.

/// A Markov chain of `N` states.
#[derive(Debug, Clone)]
pub struct MarkovChain<const N: usize> {
    /// Probability of each state before the first datum.
    pub initial: [f64; N],
    /// Probability of each state (column) after each state (row); rows sum to 1.
    pub transitions: [[f64; N]; N],
}

/// Densities of the data of a signal in each state.
#[derive(Debug, Clone)]
pub struct Densities<const N: usize> {
    /// Of each datum: density in each state over the largest of them.
    relative: Vec<[f64; N]>,
    /// Logarithm of the product of the largest.
    log_scale: f64,
}

impl<const N: usize> Densities<N> {
    /// From the log densities of each datum in each state.
    pub fn new(log_densities: impl Iterator<Item = [f64; N]>) -> Self {
        let mut log_scale = 0.0;
        let relative = log_densities.map(|datum| {
            let most = datum.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            log_scale += most;
            // An exponential is the most expensive part of it, and that of the largest is known.
            datum.map(|density| {
                if density == most {
                    1.0
                } else {
                    (density - most).exp()
                }
            })
        });
        Self {
            relative: relative.collect(),
            log_scale,
        }
    }

    /// Number of data.
    pub fn count(&self) -> usize {
        self.relative.len()
    }
}

/// What a signal tells about the states of a chain.
#[derive(Debug, Clone)]
pub struct Smoothed<const N: usize> {
    /// Natural logarithm of the likelihood of the signal, all sequences of states summed.
    pub log_likelihood: f64,
    /// Probability of each state at each datum given all data.
    pub probabilities: Vec<[f64; N]>,
    /// Expected number of changes from each state (row) to each state (column).
    pub changes: [[f64; N]; N],
}

impl MarkovChain<2> {
    /// A chain of two states that leaves the first and the second with these probabilities, in its steady state.
    pub fn of_two(leaves: [f64; 2]) -> Self {
        let sum = (leaves[0] + leaves[1]).max(f64::MIN_POSITIVE);
        Self {
            initial: [leaves[1] / sum, leaves[0] / sum],
            transitions: [[1.0 - leaves[0], leaves[0]], [leaves[1], 1.0 - leaves[1]]],
        }
    }
}

impl<const N: usize> MarkovChain<N> {
    /// Likelihood and probabilities of the states.
    pub fn smoothed(&self, densities: &Densities<N>) -> Smoothed<N> {
        let count = densities.count();
        let mut predicted = Vec::with_capacity(count);
        let mut filtered = Vec::with_capacity(count);
        let log_likelihood = self.filter(densities, |before, after| {
            predicted.push(*before);
            filtered.push(*after);
        });
        let mut probabilities = filtered.clone();
        let mut changes = [[0.0; N]; N];
        for datum in (1..count).rev() {
            let mut ratio = predicted[datum];
            for (ratio, after) in ratio.iter_mut().zip(&probabilities[datum]) {
                *ratio = if *ratio > 0.0 { after / *ratio } else { 0.0 };
            }
            for from in 0..N {
                let own = filtered[datum - 1][from];
                let mut sum = 0.0;
                for (to, ratio) in ratio.iter().enumerate() {
                    let joint = own * self.transitions[from][to] * ratio;
                    changes[from][to] += joint;
                    sum += joint;
                }
                probabilities[datum - 1][from] = sum;
            }
        }
        Smoothed {
            log_likelihood,
            probabilities,
            changes,
        }
    }

    /// Log likelihood alone.
    pub fn log_likelihood(&self, densities: &Densities<N>) -> f64 {
        self.filter(densities, |_, _| {})
    }

    /// The log likelihood; `visit` is given the probabilities of the states before and after each datum.
    fn filter(&self, densities: &Densities<N>, mut visit: impl FnMut(&[f64; N], &[f64; N])) -> f64 {
        let mut log_likelihood = densities.log_scale;
        // One logarithm for many data, as long as their product keeps its precision.
        let mut product = 1.0_f64;
        let mut before = self.initial;
        for datum in &densities.relative {
            let mut after = [0.0; N];
            let mut sum = 0.0;
            for ((after, before), density) in after.iter_mut().zip(&before).zip(datum) {
                *after = before * density;
                sum += *after;
            }
            let sum = sum.max(f64::MIN_POSITIVE);
            for after in &mut after {
                *after /= sum;
            }
            product *= sum;
            if product < 1e-150 {
                log_likelihood += product.ln();
                product = 1.0;
            }
            visit(&before, &after);
            before = [0.0; N];
            for (after, transitions) in after.iter().zip(&self.transitions) {
                for (before, transition) in before.iter_mut().zip(transitions) {
                    *before += after * transition;
                }
            }
        }
        log_likelihood + product.ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Growth of the real gross national product of the United States, 100·Δln, 1951 II to 1984 IV: the data of Hamilton
    /// (1989).
    const GROWTH: [f64; 135] = [
        2.593_164_21,
        2.202_171_33,
        0.458_275_62,
        0.968_743_8,
        -0.241_307_57,
        0.896_474_78,
        2.053_932_19,
        1.733_536_48,
        0.938_712_89,
        -0.464_778_33,
        -0.809_834_06,
        -1.397_636_89,
        -0.398_860_93,
        1.191_841_6,
        1.456_200_48,
        2.118_082_28,
        1.089_578_63,
        1.323_902_73,
        0.872_963_67,
        -0.197_732_73,
        0.454_202_15,
        0.072_218_76,
        1.103_036_4,
        0.820_974_89,
        -0.057_957_95,
        0.584_477_72,
        -1.561_926_72,
        -2.050_410_27,
        0.536_371_83,
        2.336_768_39,
        2.340_145_59,
        1.233_926_3,
        1.886_964_8,
        -0.459_207_92,
        0.849_404_69,
        1.701_398_49,
        -0.287_563_12,
        0.095_946_27,
        -0.860_802_89,
        1.034_471_27,
        1.236_859_44,
        1.420_045_02,
        2.224_106_31,
        1.302_101_73,
        1.035_176_99,
        0.925_342_5,
        -0.165_599_51,
        1.344_438_2,
        1.375_001_31,
        1.732_221_84,
        0.716_056_35,
        2.210_321_43,
        0.853_330_31,
        1.002_387_76,
        0.427_254_41,
        2.143_683_43,
        1.437_891_84,
        1.579_599_26,
        2.274_698_26,
        1.959_626_56,
        0.259_923_99,
        1.019_469_14,
        0.490_163_98,
        0.563_633_8,
        0.595_954_6,
        1.430_828_57,
        0.562_301_22,
        1.153_883_93,
        1.687_228_44,
        0.774_382_05,
        -0.096_470_45,
        1.396_001_46,
        0.136_467_98,
        0.552_237_15,
        -0.399_448_72,
        -0.616_711_02,
        -0.087_225_61,
        1.210_183_5,
        -0.907_297_55,
        2.649_161_58,
        -0.008_069_4,
        0.511_118_95,
        -0.004_014_37,
        2.168_214_32,
        1.925_867_32,
        1.035_047_17,
        1.858_972_19,
        2.320_049_29,
        0.255_707_89,
        -0.098_552_74,
        0.890_736_82,
        -0.558_964_85,
        0.283_502_55,
        -1.311_554_07,
        -0.882_787_76,
        -1.974_549_41,
        1.012_752_65,
        1.682_647_23,
        1.382_712_84,
        1.860_736_37,
        0.444_737_7,
        0.414_490_01,
        0.992_022_75,
        1.362_835_76,
        1.599_705_22,
        1.988_458_16,
        -0.256_842_32,
        0.877_869_49,
        3.109_565_5,
        0.853_244_78,
        1.233_373_17,
        0.003_143_02,
        -0.094_333_69,
        0.898_833_22,
        -0.190_366_28,
        0.997_723_76,
        -2.391_200_54,
        0.066_496_73,
        1.261_360_17,
        1.916_378_38,
        -0.334_802_9,
        0.442_071_08,
        -1.406_649_11,
        -1.521_298_89,
        0.299_198_69,
        -0.801_974_48,
        0.152_047_92,
        0.985_850_27,
        2.130_346_06,
        1.343_979_24,
        1.615_505_22,
        2.709_300_99,
        1.244_614_12,
        0.508_354_66,
        0.148_021_67,
    ];

    /// Hamilton's (1989) model of the business cycle at its maximum likelihood: an AR(4) about a mean that switches between
    /// recession and growth. Estimates and log likelihood are those that EViews gives for its SWITCHREG of this series.
    #[test]
    fn the_filter_gives_the_likelihood_of_hamiltons_business_cycle() {
        let (stays, recovers) = ([0.754_673, 1.0 - 0.095_915], 0.095_915);
        let means = [-0.358_811, 1.163_516];
        let variance = (2.0_f64 * -0.262_658).exp();
        let lags = [0.013_486, -0.057_521, -0.246_983, -0.212_923];
        // A state is the sequence of five regimes, the latest first.
        let regime = |state: usize, lag: usize| state >> lag & 1;
        let change = |from: usize, to: usize| {
            if from == to {
                stays[from]
            } else {
                1.0 - stays[from]
            }
        };
        let steady = MarkovChain::of_two([1.0 - stays[0], recovers]).initial;
        let mut transitions = [[0.0; 32]; 32];
        for (from, transitions) in transitions.iter_mut().enumerate() {
            for latest in 0..2 {
                transitions[(from << 1 & 31) | latest] = change(regime(from, 0), latest);
            }
        }
        let initial = std::array::from_fn(|state| {
            let chain = (0..4).map(|lag| change(regime(state, lag + 1), regime(state, lag)));
            steady[regime(state, 4)] * chain.product::<f64>()
        });
        let chain = MarkovChain::<32> {
            initial,
            transitions,
        };
        let densities = (4..GROWTH.len()).map(|quarter| {
            std::array::from_fn(|state| {
                let apart = |lag: usize| GROWTH[quarter - lag] - means[regime(state, lag)];
                let expected: f64 = (lags.iter().enumerate())
                    .map(|(lag, weight)| weight * apart(lag + 1))
                    .sum();
                let error = apart(0) - expected;
                -0.5 * (error * error / variance + (std::f64::consts::TAU * variance).ln())
            })
        });
        let found = chain.smoothed(&Densities::new(densities));
        assert!(
            (found.log_likelihood + 181.263_39).abs() < 1e-4,
            "{}",
            found.log_likelihood
        );
        // Growth in the last quarter, as EViews smooths it: 0.927714.
        let last = found.probabilities.last().expect("quarters");
        let growth: f64 = (0..32)
            .filter(|&state| regime(state, 0) == 1)
            .map(|state| last[state])
            .sum();
        assert!((growth - 0.927_714).abs() < 1e-4, "{growth}");
    }

    /// Against the sum over all 2⁹ sequences of two states.
    #[test]
    fn the_recursions_are_the_sum_over_all_sequences() {
        let chain = MarkovChain::of_two([0.2, 0.35]);
        let values = [0.3_f64, 1.9, 2.2, -0.4, 0.1, 2.6, 1.2, -0.9, 0.8];
        let density =
            |datum: usize, state: usize| -0.5 * (values[datum] - 2.0 * state as f64).powi(2);
        let all = (0..values.len()).map(|datum| [density(datum, 0), density(datum, 1)]);
        let found = chain.smoothed(&Densities::new(all));
        let (mut total, mut other, mut left) = (0.0, vec![0.0; values.len()], 0.0);
        for sequence in 0..1_usize << values.len() {
            let state = |datum: usize| sequence >> datum & 1;
            let mut probability = chain.initial[state(0)] * density(0, state(0)).exp();
            for datum in 1..values.len() {
                probability *= chain.transitions[state(datum - 1)][state(datum)]
                    * density(datum, state(datum)).exp();
            }
            total += probability;
            for (datum, other) in other.iter_mut().enumerate() {
                *other += probability * state(datum) as f64;
            }
            let leaves =
                (1..values.len()).filter(|&datum| state(datum - 1) == 0 && state(datum) == 1);
            left += probability * leaves.count() as f64;
        }
        assert!((found.log_likelihood - f64::ln(total)).abs() < 1e-12);
        for (datum, other) in other.iter().enumerate() {
            assert!((found.probabilities[datum][1] - other / total).abs() < 1e-12);
        }
        assert!((found.changes[0][1] - left / total).abs() < 1e-12);
    }
}
