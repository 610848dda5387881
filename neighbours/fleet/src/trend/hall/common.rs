//! What several machines have in common, and what each has of its own.

use std::collections::BTreeSet;

use inference::evidence::log_sum;

use super::{Common, FEWEST, Found, Kind, Own, TOGETHER, name, word};

/// Uncertainty of an exact size over the distance between sizes.
const EXACT: f64 = 1e-6;
/// Smallest standard deviation between machines that is tried over the uncertainty of their sizes, and its reciprocal the largest over
/// the distance between sizes.
const LEAST: f64 = 1e-2;
/// Scale of the prior of that standard deviation over the uncertainty of the sizes.
const WIDE: f64 = 5.0;
/// Step of the logarithm of those that are tried.
const STEP: f64 = 0.05;

/// Groups of machines of one type that changed alike, in one quantity; marks their changes.
pub(super) fn in_common(found: &mut [Found<'_>], machines: usize) -> Vec<Common> {
    let fewest = FEWEST.max(machines.div_ceil(2));
    let mut groups: Vec<Common> = Vec::new();
    for up in [true, false] {
        let alike: Vec<usize> = (0..found.len())
            .filter(|place| (found[*place].change.size[0] > 0.0) == up)
            .collect();
        let changes: Vec<(&str, [f64; 2])> = alike
            .iter()
            .map(|place| {
                (
                    found[*place].series.machine.as_str(),
                    found[*place].window(),
                )
            })
            .collect();
        let together: Vec<Vec<usize>> = at_one_time(&changes, fewest)
            .into_iter()
            .map(|group| group.into_iter().map(|index| alike[index]).collect())
            .collect();
        for group in together {
            let names: BTreeSet<String> = group
                .iter()
                .map(|place| found[*place].series.machine.clone())
                .collect();
            let steps = group
                .iter()
                .filter(|place| found[**place].change.kind == Kind::Step)
                .count();
            let kind = if 2 * steps >= group.len() {
                Kind::Step
            } else {
                Kind::Drift
            };
            let sizes: Vec<[f64; 2]> = group
                .iter()
                .map(|place| &found[*place].change)
                .filter(|change| change.kind == kind)
                .map(|change| change.size)
                .collect();
            let common = Sizes::new(&sizes);
            let own = group
                .iter()
                .map(|place| &found[*place])
                .filter(|found| found.change.kind == kind)
                .map(|found| (found.series.machine.as_str(), found.change.size));
            let own = common.own(own);
            let onsets: Vec<f64> = group.iter().map(|place| found[*place].onset()).collect();
            let series = found[group[0]].series;
            groups.push(Common {
                machine_type: series.machine_type.clone(),
                quantity: name(&series.quantity),
                unit: series.quantity.unit.clone(),
                kind: word(kind),
                onset: metrology::statistics::median(&onsets),
                machines: names.into_iter().collect(),
                of: machines,
                size: common.mean(),
                between_machines: common.between(),
                own,
            });
            for place in group {
                found[place].common = true;
            }
        }
    }
    groups
}

/// Groups of changes that may have begun at one time: of all instants the one which lies within the onset intervals of the most machines,
/// those intervals widened at either end by half of [`TOGETHER`]; then the same of the rest, as long as there are `fewest` machines.
/// Changes are given by machine and interval, days.
fn at_one_time(changes: &[(&str, [f64; 2])], fewest: usize) -> Vec<Vec<usize>> {
    let mut left: Vec<usize> = (0..changes.len()).collect();
    let mut groups = Vec::new();
    loop {
        let holding = |instant: f64| -> Vec<usize> {
            let holds = |[low, high]: [f64; 2]| {
                low - TOGETHER / 2.0 <= instant && instant <= high + TOGETHER / 2.0
            };
            (left.iter().copied())
                .filter(|index| holds(changes[*index].1))
                .collect()
        };
        let machines = |group: &[usize]| {
            let names: BTreeSet<&str> = group.iter().map(|index| changes[*index].0).collect();
            names.len()
        };
        // The most intervals overlap where one of them begins.
        let begins = (left.iter()).map(|index| changes[*index].1[0] - TOGETHER / 2.0);
        let Some(group) = begins.map(holding).max_by_key(|group| machines(group)) else {
            return groups;
        };
        if machines(&group) < fewest {
            return groups;
        }
        left.retain(|index| !group.contains(index));
        groups.push(group);
    }
}

/// What the sizes of several machines have in common: size = common + own + error, own ~ N(0, τ²).
///
/// τ is not estimated but averaged over: a best value of zero, which few machines often give, would say that none has anything of its own,
/// without doubt. Its prior is a half-Cauchy distribution (Gelman 2006), wide against the uncertainties; that of the common size is even.
pub(super) struct Sizes {
    /// Of each τ: its square, its probability, mean and variance of the common size.
    given: Vec<[f64; 4]>,
}

impl Sizes {
    /// Of sizes with their standard uncertainties, of which there is one at least.
    pub(super) fn new(sizes: &[[f64; 2]]) -> Self {
        let far = sizes.iter().map(|[size, _]| (size - sizes[0][0]).abs());
        let far = far.fold(0.0, f64::max);
        // An exact size is more certain than all others, by so much that it matters no more.
        let floor = far.max(f64::MIN_POSITIVE.sqrt()) * EXACT;
        let variances: Vec<f64> = sizes.iter().map(|[_, u]| u.max(floor).powi(2)).collect();
        let harmonic = variances
            .iter()
            .map(|variance| variance.recip())
            .sum::<f64>();
        let scale = (sizes.len() as f64 / harmonic).sqrt();
        let steps = ((LEAST.recip() * (1.0 + far / scale) / LEAST).ln() / STEP).ceil() as usize;
        let of = |step: usize| {
            let tau = scale * LEAST * (STEP * step as f64).exp();
            let weights = || {
                variances
                    .iter()
                    .map(|variance| (variance + tau * tau).recip())
            };
            let total: f64 = weights().sum();
            let sum: f64 = weights()
                .zip(sizes)
                .map(|(weight, [size, _])| weight * size)
                .sum();
            let mean = sum / total;
            let misfit = |(weight, [size, _]): (f64, &[f64; 2])| {
                0.5 * weight.ln() - 0.5 * weight * (size - mean).powi(2)
            };
            let likelihood = weights().zip(sizes).map(misfit).sum::<f64>() - 0.5 * total.ln();
            let prior = tau.ln() - (WIDE * scale).hypot(tau).ln() * 2.0;
            [tau * tau, likelihood + prior, mean, total.recip()]
        };
        let mut given: Vec<[f64; 4]> = (0..=steps).map(of).collect();
        let whole = log_sum(given.iter().map(|one| one[1]));
        for one in &mut given {
            one[1] = (one[1] - whole).exp();
        }
        Self { given }
    }

    /// Mean and standard deviation of what has a mean and a variance given each τ².
    fn over(&self, of: impl Fn(f64, [f64; 2]) -> [f64; 2]) -> [f64; 2] {
        let (mut first, mut second) = (0.0, 0.0);
        let all: Vec<(f64, [f64; 2])> = (self.given.iter())
            .map(|[square, share, mean, variance]| (*share, of(*square, [*mean, *variance])))
            .collect();
        for (share, [mean, _]) in &all {
            first += share * mean;
        }
        for (share, [mean, variance]) in &all {
            second += share * (variance + (mean - first).powi(2));
        }
        [first, second.sqrt()]
    }

    /// The common size with its standard uncertainty.
    pub(super) fn mean(&self) -> [f64; 2] {
        self.over(|_, mean| mean)
    }

    /// Standard deviation between machines: the median of its probabilities.
    pub(super) fn between(&self) -> f64 {
        let mut sum = 0.0;
        let reached = self.given.iter().find(|one| {
            sum += one[1];
            sum >= 0.5
        });
        reached.map_or(0.0, |one| one[0].sqrt())
    }

    /// What each machine has of its own: of the size little where it is uncertain (the best linear unbiased prediction, Robinson 1991).
    pub(super) fn own<'m>(&self, sizes: impl IntoIterator<Item = (&'m str, [f64; 2])>) -> Vec<Own> {
        let of = |(machine, [size, u]): (&str, [f64; 2])| Own {
            machine: machine.to_owned(),
            size: self.over(|square, [mean, variance]| {
                let share = square / (square + u * u);
                [
                    share * (size - mean),
                    share * u * u + share * share * variance,
                ]
            }),
        };
        sizes.into_iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::{Sizes, at_one_time};
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    /// Three drifts whose begin is known to months only have begun at one time, when the first step did; the other step is alone.
    #[test]
    fn changes_are_together_where_their_intervals_are() {
        let changes = [
            ("a", [0.0, 90.0]),
            ("b", [60.0, 200.0]),
            ("c", [30.0, 75.0]),
            ("d", [70.0, 71.0]),
            ("e", [210.0, 211.0]),
        ];
        assert_eq!(at_one_time(&changes, 3), [vec![0, 1, 2, 3]]);
        assert_eq!(at_one_time(&changes, 5), Vec::<Vec<usize>>::new());
        // Twice the same machine is one.
        assert!(at_one_time(&[("a", [0.0, 1.0]), ("a", [0.0, 1.0])], 2).is_empty());
    }

    /// Machines that differ by far more than their uncertainty: mean and standard deviation of the sizes, and all is their own.
    #[test]
    fn exact_sizes_are_the_machines_own() {
        let sizes = Sizes::new(&[[1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [6.0, 0.0]]);
        let [mean, u] = sizes.mean();
        assert!((mean - 3.0).abs() < 1e-9, "{mean}");
        // Standard deviation 2.16 over two; wider, since that is known from four.
        assert!((1.08..3.0).contains(&u), "{u}");
        assert!((1.5..3.0).contains(&sizes.between()), "{}", sizes.between());
        let own = sizes.own([("a", [6.0, 0.0])]);
        assert!((own[0].size[0] - 3.0).abs() < 1e-9 && (own[0].size[1] - u).abs() < 1e-6);
    }

    /// Twelve machines whose sizes differ by nothing, less than their uncertainty, or more: none of the intervals of what is a machine's own is
    /// without width, and they hold it in 95 % or, where machines differ by as much as their uncertainty, in 92 % (50 to 76 % where
    /// the standard deviation between machines is taken as it is estimated best). Of 4,800 two standard deviations are 1 %, with allowance for
    /// the common mean.
    #[test]
    fn intervals_of_own_parts_hold_and_have_a_width() {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        for between in [0.0, 0.5, 1.0, 2.0, 5.0] {
            let mut held = 0;
            for _ in 0..400 {
                let mut normal = || random.sample::<f64, _>(StandardNormal);
                let own: Vec<f64> = (0..12).map(|_| between * normal()).collect();
                let told: Vec<[f64; 2]> =
                    own.iter().map(|own| [3.0 + own + normal(), 1.0]).collect();
                let sizes = Sizes::new(&told);
                assert!(sizes.between() > 0.0);
                let parts = sizes.own(told.iter().map(|size| ("one", *size)));
                for (part, own) in parts.iter().zip(own) {
                    assert!(part.size[1] > 0.05, "{:?}", part.size);
                    held += usize::from((part.size[0] - own).abs() <= 1.96 * part.size[1]);
                }
            }
            assert!(held >= 4320, "{between}: {held} of 4800");
        }
    }
}
