//! What several machines have in common, and what each has of its own.

use std::collections::BTreeSet;

use super::{Common, FEWEST, Found, Kind, Own, TOGETHER, name, word};

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
            let (size, between_machines) = random_effects(&sizes);
            let own = group
                .iter()
                .map(|place| &found[*place])
                .filter(|found| found.change.kind == kind)
                .map(|found| (found.series.machine.as_str(), found.change.size));
            let own = own_parts(size, between_machines, own);
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
                size,
                between_machines,
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

/// Mean of sizes with their standard uncertainty, and the standard deviation between them: DerSimonian and Laird 1986, the
/// method of moments.
pub(super) fn random_effects(sizes: &[[f64; 2]]) -> ([f64; 2], f64) {
    let weighted = |between: f64| {
        let weights: Vec<f64> = sizes
            .iter()
            .map(|[_, u]| 1.0 / (u * u + between).max(f64::MIN_POSITIVE))
            .collect();
        let total: f64 = weights.iter().sum();
        let mean = sizes
            .iter()
            .zip(&weights)
            .map(|([size, _], weight)| size * weight)
            .sum::<f64>()
            / total;
        (mean, total, weights)
    };
    let (mean, total, weights) = weighted(0.0);
    let q: f64 = sizes
        .iter()
        .zip(&weights)
        .map(|([size, _], weight)| weight * (size - mean).powi(2))
        .sum();
    let squares: f64 = weights.iter().map(|weight| weight * weight).sum();
    let freedom = sizes.len().saturating_sub(1) as f64;
    let denominator = total - squares / total;
    let between = if denominator > 0.0 {
        ((q - freedom) / denominator).max(0.0)
    } else {
        0.0
    };
    let (mean, total, _) = weighted(between);
    ([mean, total.sqrt().recip()], between.sqrt())
}

/// What each machine has of its own beyond the common `mean`, by the standard deviation between machines: the best linear
/// unbiased prediction (Robinson 1991), which takes little for the machine's own where its size is uncertain.
pub(super) fn own_parts<'m>(
    mean: [f64; 2],
    between: f64,
    sizes: impl IntoIterator<Item = (&'m str, [f64; 2])>,
) -> Vec<Own> {
    let of = |(machine, [size, u]): (&str, [f64; 2])| {
        let variance = (between * between + u * u).max(f64::MIN_POSITIVE);
        let share = between * between / variance;
        Own {
            machine: machine.to_owned(),
            size: [
                share * (size - mean[0]),
                (share * u * u + (share * mean[1]).powi(2)).sqrt(),
            ],
        }
    };
    sizes.into_iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::{at_one_time, own_parts, random_effects};

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

    /// Of a machine that is known exactly all is its own; of one that is as uncertain as machines differ, half.
    #[test]
    fn the_own_part_is_shrunk_by_its_uncertainty() {
        let own = own_parts(
            [2.0, 0.0],
            1.0,
            [("exact", [3.0, 0.0]), ("vague", [3.0, 1.0])],
        );
        assert_eq!(own[0].size, [1.0, 0.0]);
        assert_eq!(own[1].size, [0.5, 0.5_f64.sqrt()]);
        assert_eq!(
            own_parts([2.0, 0.1], 0.0, [("alike", [3.0, 1.0])])[0].size,
            [0.0, 0.0]
        );
    }

    /// Two machines: Q = (1 − 3)² / 2 = 2 with unit variances, so that the variance between them is 1 by hand.
    #[test]
    fn machines_that_differ_make_the_common_size_less_certain() {
        let ([mean, uncertainty], between) = random_effects(&[[1.0, 1.0], [3.0, 1.0]]);
        assert!(
            (mean - 2.0).abs() < 1e-12
                && (between - 1.0).abs() < 1e-12
                && (uncertainty - 1.0).abs() < 1e-12
        );
        let ([_, alike], none) = random_effects(&[[2.0, 1.0], [2.0, 1.0]]);
        assert!(none == 0.0 && (alike - 0.5_f64.sqrt()).abs() < 1e-12);
    }
}
