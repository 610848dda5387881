//! The uncertainty engine against the examples of the GUM and its supplements, and against simulated measurements.

use metrology::statistics::{coverage_factor, mean, standard_deviation};
use metrology::uncertainty::{
    Budget, Components, Coverage, Input, Stability, UncertaintyError, contributions, propagate,
    simulate,
};
use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

fn normal(standard: f64, degrees_of_freedom: f64) -> Input {
    Input::Normal {
        standard,
        degrees_of_freedom,
    }
}

/// As many trials, in blocks that are never taken as stable before.
fn fixed(trials: usize) -> Stability {
    Stability {
        block: trials,
        least_blocks: 1,
        most_blocks: 1,
        tolerance: 0.0,
    }
}

/// Shortest interval that holds the share `probability` of the values (JCGM 101 7.7.2).
fn shortest_interval(mut values: Vec<f64>, probability: f64) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    let inside = (probability * values.len() as f64 + 0.5).floor() as usize;
    let width = |start: usize| values[start + inside] - values[start];
    let start = (0..values.len() - inside).min_by(|a, b| width(*a).total_cmp(&width(*b)));
    let start = start.expect("more values than the interval holds");
    (values[start], values[start + inside])
}

/// GUM H.1, the end gauge: u_c = 32 nm, ν_eff = 16, U₉₉ = 93 nm.
#[test]
fn the_end_gauge_of_the_gum_is_reproduced() {
    let budget = Budget::default()
        .with("calibration of the standard", normal(25e-9, 18.0), 1.0)
        .with("repeated observations", normal(5.8e-9, 24.0), 1.0)
        .with("random effects of the comparator", normal(3.9e-9, 5.0), 1.0)
        .with(
            "systematic effects of the comparator",
            normal(6.7e-9, 8.0),
            1.0,
        )
        .with(
            "difference of the expansion coefficients",
            normal(0.58e-6, 50.0),
            -0.05 * 0.1,
        )
        .with(
            "difference of the temperatures",
            normal(0.029, 2.0),
            -0.05 * 11.5e-6,
        );
    let result = budget.combine(Coverage::Probability(0.99)).unwrap();
    assert!((result.standard - 32e-9).abs() < 0.5e-9, "{result:?}");
    assert!(result.degrees_of_freedom.floor() == 16.0, "{result:?}");
    // The GUM rounds 16.7 down to 16 before it takes k = 2.92.
    assert!((result.factor - 2.92).abs() < 0.025, "{result:?}");
    assert!((result.expanded - 93e-9).abs() < 1.5e-9, "{result:?}");
}

#[test]
fn standard_uncertainties_of_the_distributions_are_those_of_their_draws() {
    for input in [
        Input::exact(2.0),
        Input::Rectangular { half_width: 2.0 },
        Input::Triangular { half_width: 2.0 },
        Input::Arcsine { half_width: 2.0 },
    ] {
        let result = simulate(&fixed(200_000), 7, |random| {
            Some([5.0 + input.draw(random)])
        })
        .unwrap();
        let [standard] = result.standard_uncertainties();
        assert!(
            (standard / input.standard() - 1.0).abs() < 0.01,
            "{input:?}"
        );
        assert!((result.mean[0] - 5.0).abs() < 0.02);
    }
    let readings = Input::Readings {
        deviation: 3.0,
        count: 9,
    };
    assert_eq!(
        (readings.standard(), readings.degrees_of_freedom()),
        (1.0, 8.0)
    );
}

/// JCGM 101 9.2.3: four rectangular inputs of unit variance; the shortest 95 % interval is ±3.88, where the GUM's
/// own formula gives ±3.92.
#[test]
fn four_rectangular_inputs_give_the_interval_of_the_supplement() {
    let width = Input::Rectangular {
        half_width: 3.0_f64.sqrt(),
    };
    let result = simulate(&fixed(400_000), 2, |random| {
        Some([(0..4).map(|_| width.draw(random)).sum::<f64>()])
    });
    let result = result.unwrap();
    assert!((result.standard_uncertainties()[0] - 2.0).abs() < 0.01);
    let values = result.values.iter().map(|value| value[0]).collect();
    let (low, high) = shortest_interval(values, 0.95);
    assert!(
        (low + 3.88).abs() < 0.03 && (high - 3.88).abs() < 0.03,
        "{low} {high}"
    );
    let budget = (0..4).fold(Budget::default(), |budget, index| {
        budget.with(format!("x{index}"), width, 1.0)
    });
    assert!(
        (budget
            .combine(Coverage::Probability(0.95))
            .unwrap()
            .expanded
            - 3.92)
            .abs()
            < 0.005
    );
}

#[test]
fn equal_seeds_give_equal_simulations_and_others_do_not() {
    let run = |seed| {
        let inputs = [normal(0.1, 6.0), normal(0.2, 4.0)];
        simulate(&Stability::default(), seed, |random| {
            let [a, b] = inputs.map(|input| input.draw(random));
            Some([(1.0 + a) * (2.0 + b)])
        })
        .unwrap()
    };
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
}

/// A normal result takes about 1/(2·0.025²) = 800 trials for 5 %, so the thousand of ten blocks mostly suffice; a
/// heavy-tailed one (Student's t with 3 degrees of freedom) takes more.
#[test]
fn a_simulation_goes_on_until_its_standard_uncertainty_is_stable() {
    let trials = |input: Input| -> Vec<f64> {
        (0..200)
            .map(|seed| {
                let one = |random: &mut Pcg64| Some([input.draw(random)]);
                let result = simulate(&Stability::default(), seed, one).unwrap();
                assert!(result.stable || result.values.len() == 10_000);
                result.values.len() as f64
            })
            .collect()
    };
    let (even, heavy) = (trials(Input::exact(1.0)), trials(normal(1.0, 3.0)));
    assert!((1000.0..1300.0).contains(&mean(&even)), "{}", mean(&even));
    assert!(mean(&heavy) > 2.0 * mean(&even), "{}", mean(&heavy));
    // What the tolerance promises: two standard deviations within 5 %.
    let stated: Vec<f64> = (0..400)
        .map(|seed| {
            let one = |random: &mut Pcg64| Some([Input::exact(1.0).draw(random)]);
            let result = simulate(&Stability::default(), 1000 + seed, one).unwrap();
            result.standard_uncertainties()[0]
        })
        .collect();
    assert!((mean(&stated) - 1.0).abs() < 0.005, "{}", mean(&stated));
    assert!(2.0 * standard_deviation(&stated) < 0.05);
}

#[test]
fn a_model_that_has_no_value_too_often_is_refused() {
    let sometimes = |share: f64| {
        simulate(&Stability::default(), 1, |random| {
            (random.random::<f64>() > share).then_some([1.0])
        })
    };
    assert!(sometimes(0.02).is_ok());
    assert!(matches!(
        sometimes(0.10),
        Err(UncertaintyError::TrialsUndefined { .. })
    ));
    assert!(simulate(&Stability::default(), 1, |_| Some([f64::NAN])).is_err());
}

#[test]
fn numerical_sensitivities_are_those_of_calculus() {
    // Area and ratio of a rectangle.
    let (a, b, u) = (3.0, 2.0, [0.01, 0.02, 0.0]);
    let z = contributions(&u, |d| {
        Some([(a + d[0]) * (b + d[1]), (a + d[0]) / (b + d[1])])
    });
    let z = z.unwrap();
    let exact = [
        [b * u[0], a * u[1], 0.0],
        [u[0] / b, -a * u[1] / (b * b), 0.0],
    ];
    for (row, expected) in exact.iter().enumerate() {
        for (column, expected) in expected.iter().enumerate() {
            assert!((z[(row, column)] - expected).abs() < 1e-5, "{row} {column}");
        }
    }
    assert_eq!(
        contributions(&[1.0], |d| (d[0] > 0.0).then_some([d[0]])),
        Err(UncertaintyError::Undefined(0))
    );
    assert!(contributions(&[-1.0], |d| Some([d[0]])).is_err());
}

#[test]
fn correlated_inputs_propagate_alike_by_matrix_and_by_draws() {
    let covariance = DMatrix::from_row_slice(2, 2, &[4.0, -1.5, -1.5, 1.0]);
    let jacobian = DMatrix::from_row_slice(1, 2, &[2.0, 3.0]);
    let linear = propagate(&jacobian, &covariance).unwrap()[(0, 0)];
    assert!((linear - (16.0 + 9.0 - 18.0)).abs() < 1e-12);
    let factor = covariance.clone().cholesky().unwrap().l();
    let unit = Input::exact(1.0);
    let drawn = simulate(&fixed(200_000), 5, |random| {
        let (one, other) = (unit.draw(random), unit.draw(random));
        let x = [
            factor[(0, 0)] * one,
            factor[(1, 0)] * one + factor[(1, 1)] * other,
        ];
        Some([2.0 * x[0] + 3.0 * x[1]])
    });
    let [standard] = drawn.unwrap().standard_uncertainties();
    assert!((standard / linear.sqrt() - 1.0).abs() < 0.01);
    assert!(propagate(&jacobian, &DMatrix::identity(3, 3)).is_err());
    assert!(propagate(&jacobian, &-covariance).is_err());
}

/// Mean, sum and difference of values that share a component, against draws of the same; with opposite sensitivities too.
#[test]
fn components_combine_as_draws_with_a_common_error_do() {
    let own = [0.2, 0.7, 0.3];
    let common = [1.0, 2.0, -1.0];
    let parts = [0, 1, 2].map(|i| Components {
        independent: own[i],
        common: common[i],
    });
    let thirds = [1.0 / 3.0; 3];
    for weights in [thirds, [1.0, 1.0, 1.0], [1.0, -0.5, 0.0]] {
        let drawn = simulate(&fixed(100_000), 3, |random| {
            let shared = Input::exact(1.0).draw(random);
            let term = |i: usize, random: &mut Pcg64| {
                weights[i] * (Input::exact(own[i]).draw(random) + common[i] * shared)
            };
            Some([(0..3).map(|i| term(i, random)).sum::<f64>()])
        });
        let [drawn] = drawn.unwrap().standard_uncertainties();
        let combined = Components::linear_combination(weights.into_iter().zip(parts)).standard();
        assert!(
            (combined / drawn - 1.0).abs() < 0.01,
            "{weights:?}: {combined} {drawn}"
        );
    }
    let split = Components::split(parts[1].standard(), parts[1].common);
    assert!((split.independent - 0.7).abs() < 1e-15);
    assert_eq!(Components::split(1.0, 1.0 + 1e-15).independent, 0.0);
}

/// U covers the true value about as often as stated where one input is known from four readings: 94.0 % of 95 % with
/// Student's t, the percent being Welch–Satterthwaite's own, whose ν_eff scatters with the readings. k = 1.96 covers 91.1 %.
#[test]
fn the_expanded_uncertainty_covers_the_true_value_as_often_as_it_states() {
    let (deviation, count, other) = (1.0, 4_u32, 0.3);
    let mut random = Pcg64::seed_from_u64(8);
    let (runs, mut covered, mut by_normal) = (40_000, 0_u32, 0_u32);
    for _ in 0..runs {
        let readings: Vec<f64> = (0..count)
            .map(|_| {
                let unit: f64 = StandardNormal.sample(&mut random);
                deviation * unit
            })
            .collect();
        let shift: f64 = StandardNormal.sample(&mut random);
        let error = mean(&readings) + other * shift;
        let budget = Budget::default()
            .with(
                "readings",
                Input::Readings {
                    deviation: standard_deviation(&readings),
                    count,
                },
                1.0,
            )
            .with("calibration", Input::exact(other), 1.0);
        let stated = budget.combine(Coverage::Probability(0.95)).unwrap();
        covered += u32::from(error.abs() <= stated.expanded);
        by_normal += u32::from(error.abs() <= 1.96 * stated.standard);
    }
    let [covered, by_normal] = [covered, by_normal].map(|n| f64::from(n) / f64::from(runs));
    // Three standard deviations of the count are 0.0036.
    assert!((covered - 0.940).abs() < 0.0036, "{covered}");
    assert!(by_normal < covered - 0.025, "{by_normal}");
}

#[test]
fn senseless_budgets_are_refused() {
    let budget = |input, c| {
        Budget::default()
            .with("x", input, c)
            .combine(Coverage::Probability(0.95))
    };
    assert!(budget(normal(-1.0, 5.0), 1.0).is_err());
    assert!(budget(normal(1.0, 0.0), 1.0).is_err());
    assert!(budget(normal(1.0, 5.0), f64::NAN).is_err());
    assert!(
        Budget::default()
            .combine(Coverage::Probability(1.0))
            .is_err()
    );
    let one = Input::Readings {
        deviation: 1.0,
        count: 1,
    };
    assert!(budget(one, 1.0).is_err());
    let nothing = Budget::default()
        .combine(Coverage::Probability(0.95))
        .unwrap();
    assert_eq!((nothing.standard, nothing.expanded), (0.0, 0.0));
    assert_eq!(nothing.factor, coverage_factor(0.95, f64::INFINITY));
    let twice = Budget::default().combine(Coverage::NormalFactor(2.0));
    assert_eq!(twice.unwrap().factor, 2.0);
    assert!(
        Budget::default()
            .combine(Coverage::NormalFactor(0.0))
            .is_err()
    );
    let few = Budget::default().with("x", normal(1.0, 10.0), 1.0);
    let few = few.combine(Coverage::NormalFactor(2.0)).unwrap();
    assert!((few.factor - 2.284).abs() < 5e-4);
}
