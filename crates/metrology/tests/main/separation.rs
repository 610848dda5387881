//! Two-pass separation against the properties and Monte-Carlo figures of `docs/source_systems.md, C.3 and C.4`.

use metrology::separation::{
    Pass, SeparationError, SetUp, least_squares, polynomial, recursion, reversal, tilt_bow,
    undetermined, without_line,
};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

const N: usize = 12;
const SPACING: f64 = 20e-3;

/// A wavy part and a bowed guideway of some µm.
fn part(z: f64) -> f64 {
    8e-6 * (z / 37e-3).sin() + 3e-6 * (z / 11e-3).cos() + 40e-6 * z
}
fn guideway(z: f64) -> f64 {
    6e-6 * (z / 60e-3).cos() + 2e-6 * (z / 17e-3).sin()
}

fn pass(shift: usize, mut noise: impl FnMut() -> f64) -> Pass {
    Pass {
        shift,
        readings: (0..N)
            .map(|i| part((i + shift) as f64 * SPACING) + guideway(i as f64 * SPACING) + noise())
            .collect(),
    }
}

fn exact(shift: usize) -> Pass {
    pass(shift, || 0.0)
}

fn true_guideway() -> Vec<f64> {
    (0..N).map(|i| guideway(i as f64 * SPACING)).collect()
}

/// Root mean square in m of the difference from the true guideway after the line is removed.
fn error(found: &[f64]) -> f64 {
    let difference: Vec<f64> = found
        .iter()
        .zip(true_guideway())
        .map(|(a, b)| a - b)
        .collect();
    (without_line(&difference).iter().map(|e| e * e).sum::<f64>() / N as f64).sqrt()
}

#[test]
fn every_exact_method_recovers_the_guideway_without_noise() {
    let (first, shifted) = (exact(0), exact(1));
    let by_recursion = recursion(&first.readings, &shifted.readings).unwrap();
    let offset = by_recursion.guideway[0] - guideway(0.0);
    for (i, s) in by_recursion.guideway.iter().enumerate() {
        assert!((s - offset - guideway(i as f64 * SPACING)).abs() < 1e-19);
    }
    for (i, r) in by_recursion.part.iter().enumerate() {
        assert!((r + offset - part(i as f64 * SPACING)).abs() < 1e-19);
    }
    assert!(
        error(
            &least_squares(&[first.clone(), shifted], SetUp::Exact)
                .unwrap()
                .guideway
        ) < 1e-18
    );
    let passes = [0, 1, 3].map(exact);
    assert!(error(&least_squares(&passes, SetUp::Exact).unwrap().guideway) < 1e-18);
    let turned: Vec<f64> = (0..N)
        .map(|i| part(i as f64 * SPACING) - guideway(i as f64 * SPACING))
        .collect();
    assert!(error(&reversal(&first.readings, &turned).unwrap().guideway) < 1e-18);
}

/// C.4, 1, 2 and 4: what is left undetermined.
#[test]
fn the_null_spaces_are_those_derived() {
    assert_eq!(undetermined(N, &[0, 1], SetUp::Exact), 1);
    // Spacing σ/2: two chains.
    assert_eq!(undetermined(N, &[0, 2], SetUp::Exact), 2);
    assert_eq!(undetermined(N, &[0, 2, 3], SetUp::Exact), 1);
    for shifts in [&[0, 1, 3][..], &[0, 1, 3, 5]] {
        // Heights add the line, tilts the parabola; each nuisance pairs with one shape.
        assert_eq!(undetermined(N, shifts, SetUp::Exact), 1);
        assert_eq!(undetermined(N, shifts, SetUp::Height), 2);
        assert_eq!(undetermined(N, shifts, SetUp::HeightAndTilt), 3);
    }
    assert_eq!(
        least_squares(&[exact(0), exact(2)], SetUp::Exact),
        Err(SeparationError::Chains(2))
    );
    assert_eq!(
        least_squares(&[exact(1), exact(1)], SetUp::Exact),
        Err(SeparationError::NoShift)
    );
}

/// C.4, 2: h gives a ramp h·z/σ, φ a parabola; 1 µm over 220 mm bows by 1.375 µm, 0.83 µm after line removal.
#[test]
fn set_up_errors_of_the_second_pass_do_what_is_derived() {
    let length = (N - 1) as f64 * SPACING;
    let first = exact(0);
    let mut lifted = exact(1);
    lifted.readings.iter_mut().for_each(|k| *k += 1e-6);
    let ramp = recursion(&first.readings, &lifted.readings).unwrap();
    let clean = recursion(&first.readings, &exact(1).readings).unwrap();
    assert!((clean.guideway[N - 1] - ramp.guideway[N - 1] - 11e-6).abs() < 1e-15);
    assert!(error(&ramp.guideway) < 1e-18);
    let tilt = 1e-6 / length;
    let mut tilted = exact(1);
    for (i, k) in tilted.readings.iter_mut().enumerate() {
        *k += tilt * i as f64 * SPACING;
    }
    let bowed = recursion(&first.readings, &tilted.readings).unwrap();
    let difference: Vec<f64> = bowed
        .guideway
        .iter()
        .zip(&clean.guideway)
        .map(|(a, b)| a - b)
        .collect();
    let chord = |i: usize| difference[N - 1] * i as f64 / (N - 1) as f64;
    // The largest sagitta lies between samples 5 and 6; the parabola through them gives it.
    let sagitta = (0..N)
        .map(|i| (difference[i] - chord(i)).abs())
        .fold(0.0, f64::max);
    let bow = tilt_bow(tilt, length, SPACING);
    assert!((bow - 1.375e-6).abs() < 1e-12);
    assert!((sagitta / bow - 4.0 * 5.0 * 6.0 / 121.0).abs() < 1e-9);
    let rest = without_line(&difference)
        .iter()
        .fold(0.0_f64, |m, e| m.max(e.abs()));
    assert!((rest - 0.83e-6).abs() < 0.01e-6, "{rest:e}");
    // Reversal is immune.
    let turned: Vec<f64> = (0..N)
        .map(|i| {
            let z = i as f64 * SPACING;
            part(z) - guideway(z) + 1e-6 + tilt * z
        })
        .collect();
    assert!(error(&reversal(&first.readings, &turned).unwrap().guideway) < 1e-18);
}

/// C.4, 5 and the table: 12 points, σ_n = 1 µm, rms of S after line removal in µm.
#[test]
fn noise_propagates_as_tabulated() {
    let mut rng = Pcg64::seed_from_u64(8);
    let mut noise = || 1e-6 * Distribution::<f64>::sample(&StandardNormal, &mut rng);
    let runs = 3000;
    let mut squares = [0.0_f64; 6];
    let mut last_square = 0.0;
    let clean_last = guideway((N - 1) as f64 * SPACING) - guideway(0.0);
    let mut average = vec![0.0; N];
    for run in 0..runs {
        let all: Vec<Pass> = [0, 1, 3, 5]
            .into_iter()
            .map(|m| pass(m, &mut noise))
            .collect();
        let found = recursion(&all[0].readings, &all[1].readings)
            .unwrap()
            .guideway;
        squares[0] += error(&found).powi(2);
        last_square += (found[N - 1] - clean_last).powi(2);
        for (sum, s) in average.iter_mut().zip(&found) {
            *sum += s / 8.0;
        }
        if run % 8 == 7 {
            squares[5] += 8.0 * error(&average).powi(2);
            average.fill(0.0);
        }
        for (slot, count) in [(1, 2), (2, 3), (3, 4)] {
            let found = least_squares(&all[..count], SetUp::Exact).unwrap();
            squares[slot] += error(&found.guideway).powi(2);
        }
        let turned: Vec<f64> = (0..N)
            .map(|i| part(i as f64 * SPACING) - guideway(i as f64 * SPACING) + noise())
            .collect();
        squares[4] += error(&reversal(&all[0].readings, &turned).unwrap().guideway).powi(2);
    }
    let rms = squares.map(|s| (s / f64::from(runs)).sqrt() * 1e6);
    for (slot, tabulated) in [1.25, 1.24, 0.66, 0.54, 0.65, 0.44].into_iter().enumerate() {
        assert!((rms[slot] / tabulated - 1.0).abs() < 0.05, "{rms:?}");
    }
    // The random walk ends at σ√(2·11) = 4.69 µm.
    let end = (last_square / f64::from(runs)).sqrt() * 1e6;
    assert!((end / 4.69 - 1.0).abs() < 0.05, "{end}");
}

/// (10) and (12): the source's straight line.
#[test]
fn order_two_is_the_sources_straight_line() {
    let (a1, a2) = (3e-5, -2e-4);
    let form = |z: f64| a1 * z + a2 * z * z;
    let first: Vec<f64> = (0..N)
        .map(|i| form(i as f64 * SPACING) + guideway(i as f64 * SPACING))
        .collect();
    let shifted: Vec<f64> = (0..N)
        .map(|i| form((i + 1) as f64 * SPACING) + guideway(i as f64 * SPACING))
        .collect();
    let found = polynomial(&first, &shifted, SPACING, SPACING, 2).unwrap();
    assert!(
        (found.coefficients[0] - a1).abs() < 1e-15 && (found.coefficients[1] - a2).abs() < 1e-14
    );
    assert!(error(&found.guideway) < 1e-18 && !found.bias_suspected);
    // c1, c2 of (12) on other data.
    let (mut sz, mut sk, mut szz, mut szk) = (0.0, 0.0, 0.0, 0.0);
    let (first, shifted) = (exact(0).readings, exact(1).readings);
    for i in 0..N {
        let (z, k) = (i as f64 * SPACING, shifted[i] - first[i]);
        sz += z;
        sk += k;
        szz += z * z;
        szk += z * k;
    }
    let m = N as f64;
    let c2 = (m * szk - sz * sk) / (m * szz - sz * sz);
    let c1 = (sk - c2 * sz) / m;
    let a2 = c2 / (2.0 * SPACING);
    let a1 = c1 / SPACING - a2 * SPACING;
    let found = polynomial(&first, &shifted, SPACING, SPACING, 2).unwrap();
    assert!((found.coefficients[1] / a2 - 1.0).abs() < 1e-12);
    assert!((found.coefficients[0] / a1 - 1.0).abs() < 1e-12);
}

/// C.4, 6: a polynomial too stiff for the part is biased, and says so; a higher order does better.
#[test]
fn a_stiff_polynomial_warns_of_its_bias() {
    let (first, shifted) = (exact(0).readings, exact(1).readings);
    let stiff = polynomial(&first, &shifted, SPACING, SPACING, 2).unwrap();
    assert!(error(&stiff.guideway) > 2e-6);
    let smooth = |z: f64| 8e-6 * (z / 50e-3).sin();
    let first: Vec<f64> = (0..N)
        .map(|i| smooth(i as f64 * SPACING) + guideway(i as f64 * SPACING))
        .collect();
    let shifted: Vec<f64> = (0..N)
        .map(|i| smooth((i + 1) as f64 * SPACING) + guideway(i as f64 * SPACING))
        .collect();
    let two = polynomial(&first, &shifted, SPACING, SPACING, 2).unwrap();
    assert!(two.bias_suspected);
    let stiff = error(&two.guideway);
    let five = polynomial(&first, &shifted, SPACING, SPACING, 5).unwrap();
    assert!(error(&five.guideway) < 0.2 * stiff);
}

#[test]
fn waves_of_the_shifts_period_are_invisible() {
    let wave = |z: f64| 5e-6 * (std::f64::consts::TAU * z / SPACING).cos();
    let first: Vec<f64> = (0..N).map(|i| wave(i as f64 * SPACING)).collect();
    let found = recursion(&first, &first).unwrap();
    assert!(
        without_line(&found.guideway)
            .iter()
            .all(|s| s.abs() < 1e-15)
    );
}

#[test]
fn uneven_or_broken_passes_are_refused() {
    let good = exact(0).readings;
    assert!(matches!(
        recursion(&good, &good[1..]),
        Err(SeparationError::Length { .. })
    ));
    let mut broken = good.clone();
    broken[4] = f64::NAN;
    assert_eq!(
        recursion(&good, &broken),
        Err(SeparationError::NotFinite { pass: 1, sample: 4 })
    );
    assert_eq!(
        polynomial(&good, &good, SPACING, SPACING, 0),
        Err(SeparationError::Order(0))
    );
    assert_eq!(
        polynomial(&good, &good, -1.0, SPACING, 2),
        Err(SeparationError::Spacing(-1.0))
    );
    assert_eq!(
        least_squares(&[], SetUp::Exact),
        Err(SeparationError::NoShift)
    );
}
