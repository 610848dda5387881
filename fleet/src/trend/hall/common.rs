//! What several machines have in common, and what each has of its own.

use std::collections::BTreeSet;

use super::{Common, FEWEST, Found, Kind, Own, TOGETHER, name, word};

/// Groups of machines of one type that changed alike, in one quantity; marks their changes.
pub(super) fn in_common(found: &mut [Found<'_>], machines: usize) -> Vec<Common> {
    let fewest = FEWEST.max(machines.div_ceil(2));
    let mut groups: Vec<Common> = Vec::new();
    for up in [true, false] {
        let mut places: Vec<usize> = (0..found.len())
            .filter(|place| (found[*place].change.size[0] > 0.0) == up)
            .collect();
        places.sort_by(|a, b| found[*a].onset().total_cmp(&found[*b].onset()));
        let gap = |pair: [usize; 2]| found[pair[1]].onset() - found[pair[0]].onset() > TOGETHER;
        let together: Vec<Vec<usize>> = places
            .chunk_by(|a, b| !gap([*a, *b]))
            .map(<[usize]>::to_vec)
            .collect();
        for group in together {
            let names: BTreeSet<String> = group
                .iter()
                .map(|place| found[*place].series.machine.clone())
                .collect();
            if names.len() < fewest {
                continue;
            }
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
    use super::{own_parts, random_effects};

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
