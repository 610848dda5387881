//! Sizes of families beside small remainders, against dense covariance matrices and planted sizes.

use inference::relevance::{Products, Remainder};
use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

const ROWS: usize = 60;

fn columns(random: &mut Pcg64Mcg, count: usize) -> Vec<Vec<f64>> {
    (0..count)
        .map(|_| (0..ROWS).map(|_| random.sample(StandardNormal)).collect())
        .collect()
}

/// A smooth process over the rows: leading columns of a squared exponential.
fn smooth() -> Vec<Vec<f64>> {
    let wave = |k: usize, row: usize| {
        let phase = std::f64::consts::PI * k as f64 * (row as f64 + 0.5) / ROWS as f64;
        (-0.1 * (k * k) as f64).exp() * phase.cos()
    };
    (1..7)
        .map(|k| (0..ROWS).map(|row| wave(k, row)).collect())
        .collect()
}

/// The evidence is that of the n × n covariance matrix (Rasmussen and Williams 2006, eq. 2.30), less the prior of the remainder.
#[test]
fn the_evidence_is_that_of_the_dense_covariance() {
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let (family, remainder) = (columns(&mut random, 3), smooth());
    let y: Vec<f64> = columns(&mut random, 1).remove(0);
    let usual = 0.4;
    let offered = [Remainder {
        columns: &remainder,
        usual,
    }];
    let families = std::iter::once(family.as_slice());
    let products = Products::new(&[], &offered, families, &y, &[true; ROWS], 1e-6);
    let sizes = products.start().with(0, 0.7);
    let fit = products.fit_in(sizes.clone(), 0).expect("solvable");
    let dense = |blocks: &[Vec<f64>]| DMatrix::from_vec(ROWS, blocks.len(), blocks.concat());
    let (f, r) = (dense(&family), dense(&remainder));
    let covariance = DMatrix::identity(ROWS, ROWS) * sizes.noise
        + &r * r.transpose() * sizes.variances[0]
        + &f * f.transpose() * 0.7;
    let y = DVector::from_vec(y);
    let factor = covariance.cholesky().expect("positive definite");
    let log_determinant: f64 = factor
        .l_dirty()
        .diagonal()
        .iter()
        .map(|v| 2.0 * v.ln())
        .sum();
    let expected = -0.5 * (log_determinant + y.dot(&factor.solve(&y)))
        - 0.5 * sizes.variances[0] / (usual * usual);
    assert!((fit.log_evidence - expected).abs() < 1e-8);
}

/// A planted family is worth its price, others all but never are, and the sizes that were planted are found: the deviations hold a family of
/// size 2, a remainder of 0.2 and noise of 0.1.
#[test]
fn planted_sizes_are_found_and_nothing_else() {
    let mut random = Pcg64Mcg::seed_from_u64(11);
    let (mut named, mut innocent) = (0, 0);
    let mut noises = Vec::new();
    for _ in 0..40 {
        let families: Vec<Vec<Vec<f64>>> = (0..8).map(|_| columns(&mut random, 4)).collect();
        let remainder = smooth();
        let mut y = vec![0.0; ROWS];
        for (block, size) in [(&families[2], 2.0), (&remainder, 0.2)] {
            for column in block {
                let value: f64 = size * random.sample::<f64, _>(StandardNormal);
                for (y, part) in y.iter_mut().zip(column) {
                    *y += value * part;
                }
            }
        }
        for value in &mut y {
            *value += 0.1 * random.sample::<f64, _>(StandardNormal);
        }
        let gap = (y.iter().map(|value| value * value).sum::<f64>() / ROWS as f64).sqrt();
        let offered = [Remainder {
            columns: &remainder,
            usual: 0.08 * gap,
        }];
        let all = families.iter().map(Vec::as_slice);
        let products = Products::new(&[], &offered, all, &y, &[true; ROWS], 1e-6);
        let empty = products.fit(products.start()).expect("solvable");
        let net = |fit: &inference::relevance::Fit, family: usize| {
            let (_, variance) = products.gain(fit, family);
            let more = products.fit(products.grown(&fit.sizes, family, variance));
            more.map_or(0.0, |more| more.log_evidence - fit.log_evidence) - 7.0
        };
        named += usize::from(net(&empty, 2) > 0.0);
        let (_, variance) = products.gain(&empty, 2);
        let grown = products.grown(&empty.sizes, 2, variance);
        let fit = products.fit(grown).expect("solvable");
        innocent += (0..8)
            .filter(|&other| other != 2 && net(&fit, other) > 0.0)
            .count();
        noises.push(fit.sizes.noise.sqrt());
    }
    assert_eq!(named, 40);
    // Seven nats are some 1,100 to one; of 280 trials of what does not act, fewer than one in a hundred may reach them.
    assert!(innocent < 3, "{innocent}");
    let mean = noises.iter().sum::<f64>() / noises.len() as f64;
    assert!((mean - 0.1).abs() < 0.02, "{mean}");
}

/// A family that is added behind the others is the same as one that was there from the start.
#[test]
fn a_family_added_later_is_the_same() {
    let mut random = Pcg64Mcg::seed_from_u64(3);
    let (first, second) = (columns(&mut random, 2), columns(&mut random, 3));
    let y = columns(&mut random, 1).remove(0);
    let both = [first.as_slice(), second.as_slice()];
    let at_once = Products::new(&[], &[], both.into_iter(), &y, &[true; ROWS], 1e-6);
    let mut later = Products::new(&[], &[], both[..1].iter().copied(), &y, &[true; ROWS], 1e-6);
    later.extend(&DMatrix::from_vec(ROWS, 3, second.concat()));
    let evidence = |products: &Products| {
        let sizes = products.start().with(0, 1.0).with(1, 1.0);
        products.fit(sizes).expect("solvable").log_evidence
    };
    assert!((evidence(&at_once) - evidence(&later)).abs() < 1e-9);
}
