//! Surface mismatch against the figures of `docs/source_systems.md, D.3 and D.4`, and against rank theory.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use machine::models::WCBXFZYST;
use machine::{Chain, ChainErrors, LinkError};
use machining::mismatch::{
    LINKS, MismatchTest, PatternKind, ROTARY, calibrated, condition, identify, rank,
    standard_patterns,
};
use metrology::statistics::rms;
use nalgebra::{DMatrix, Isometry3, Point3};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

const NOISE: f64 = 1.5e-6;

fn test_of(keep: impl Fn(PatternKind) -> bool) -> MismatchTest {
    let patterns = standard_patterns()
        .into_iter()
        .filter(|pattern| keep(pattern.kind))
        .collect();
    MismatchTest::new(
        Chain::from_urdf(WCBXFZYST).unwrap(),
        Isometry3::identity(),
        Point3::origin(),
        &ROTARY,
        patterns,
    )
    .unwrap()
}

fn links(chain: &Chain, sign: impl Fn(usize) -> f64) -> Vec<LinkError> {
    LINKS
        .iter()
        .enumerate()
        .map(|(place, (name, size))| LinkError::named(chain, name, sign(place) * size).unwrap())
        .collect()
}

/// Signs of case E1: + − + − + − + over the angles, + for EX0C.
fn e1(chain: &Chain) -> Vec<LinkError> {
    let signs = [1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0];
    links(chain, |place| signs[place])
}

/// D.3, µm.
const TABLE: [[f64; 8]; 14] = [
    [5., 0., 0., 5., -5., 0., -5., 0.],
    [-15., 0., 0., -15., 0., 0., 0., 0.],
    [5., 0., 0., 5., 0., 0., -5., 0.],
    [7.5, 0., 20., 7.5, 7.5, -7.5, 0., 2.5],
    [0., 0., 0., 0., -5., 0., 0., 0.],
    [-7.5, 0., 20., -7.5, 7.5, -7.5, 0., 2.5],
    [4., 0., -40., 0., -13., 0., -4., 0.],
    [-6., 0., 0., -13., 0., 0., 0., 0.],
    [-4., 0., -40., 0., -9., 0., 4., 0.],
    [0., 0., 0., -4., 6., -6., 0., 0.],
    [-2., -2., 0., 0., 0., 7.5, 2., 2.],
    [2., -2., 0., 0., 0., 3., -2., 2.],
    [6., -5.5, 20., 5.5, 5.5, 0., -3., 0.],
    [-6., -5.5, 20., -5.5, 5.5, 0., 3., 0.],
];

#[test]
fn sensitivities_equal_the_published_table() {
    let test = test_of(|_| true);
    let found = test.sensitivity(&links(test.chain(), |_| 1.0));
    for (row, (name, expected)) in test.row_names().iter().zip(TABLE).enumerate() {
        for (column, expected) in expected.into_iter().enumerate() {
            let got = found[(row, column)] * 1e6;
            assert!(
                (got - expected).abs() < 1e-3,
                "{name} {}: {got}",
                LINKS[column].0
            );
        }
    }
}

#[test]
fn slots_are_blind_to_one_link_and_steps_see_all() {
    let whole = test_of(|_| true);
    let sizes = links(whole.chain(), |_| 1.0);
    let matrix = whole.sensitivity(&sizes);
    assert_eq!(rank(&matrix), 8);
    assert!((condition(&matrix) - 18.1).abs() < 0.05);
    // With the three tip offsets, of 10 µm each.
    let tips = whole.tip_offsets(10e-6);
    let with_tips = DMatrix::from_fn(14, 11, |row, column| {
        if column < 8 {
            matrix[(row, column)]
        } else {
            tips[(row, column - 8)]
        }
    });
    assert_eq!(rank(&with_tips), 11);
    assert!((condition(&with_tips) - 24.4).abs() < 0.05);
    let slots = test_of(|kind| kind == PatternKind::Slot);
    let blind = slots.sensitivity(&sizes);
    assert_eq!(rank(&blind), 7);
    assert!(condition(&blind).is_infinite());
    assert!(blind.column(1).amax() < 1e-18, "EC0B does not show");
    // One corner step is enough.
    let mut patterns = slots.patterns().to_vec();
    patterns.push(standard_patterns().remove(5));
    let one = MismatchTest::new(
        slots.chain().clone(),
        Isometry3::identity(),
        Point3::origin(),
        &ROTARY,
        patterns,
    )
    .unwrap();
    assert_eq!(rank(&one.sensitivity(&sizes)), 8);
    let found = identify(&slots, &sizes, &[1e-6; 10], NOISE).unwrap();
    assert!(found.uncertainty[1].is_infinite() && found.links[1].value.abs() < 1e-15);
    assert!(found.uncertainty[0].is_finite());
    assert!(identify(&slots, &sizes, &[0.0; 14], NOISE).is_err());
}

#[test]
fn first_order_mismatch_is_within_ten_nanometres_of_the_exact_one() {
    let test = test_of(|_| true);
    let truth = e1(test.chain());
    let linear = test.sensitivity(&truth).column_sum();
    let errors = ChainErrors::of_links(test.chain(), &truth);
    let exact = test.exact(&errors, None).unwrap();
    for (linear, exact) in linear.iter().zip(&exact) {
        assert!((linear - exact).abs() <= 1e-8, "{linear} against {exact}");
    }
    assert!((rms(&exact) - 20.7e-6).abs() < 0.05e-6);
    let volumetric = test.compensation(&truth).unwrap();
    let left = test.exact(&errors, Some(&volumetric)).unwrap();
    let most = left.iter().fold(0.0_f64, |most, m| most.max(m.abs()));
    assert!(most > 0.0 && most <= 5e-9, "second order leaves {most}");
}

/// Root of the mean square of R, U and C over `runs` seeded tests, µm, and the share that keeps the rule of D-link.
fn campaign(
    test: &MismatchTest,
    runs: u64,
    truth: impl Fn(&mut Pcg64) -> Vec<LinkError>,
) -> ([f64; 3], f64) {
    let mut sums = [0.0; 3];
    let mut kept = 0;
    for seed in 0..runs {
        let mut random = Pcg64::seed_from_u64(seed);
        let truth = truth(&mut random);
        let errors = ChainErrors::of_links(test.chain(), &truth);
        let known = calibrated(&truth, 5e-6, 2e-6, &mut random);
        let volumetric = test.compensation(&known).unwrap();
        let outcome = test.run(&errors, &volumetric, NOISE, &mut random).unwrap();
        let sizes = [outcome.floor, outcome.uncompensated, outcome.compensated].map(|m| rms(&m));
        for (sum, size) in sums.iter_mut().zip(sizes) {
            *sum += size * size * 1e12;
        }
        kept += u32::from(sizes[2] <= 0.30 * sizes[1] && sizes[2] <= 6e-6);
    }
    (
        sums.map(|sum| (sum / runs as f64).sqrt()),
        f64::from(kept) / runs as f64,
    )
}

#[test]
fn compensated_mismatch_comes_near_the_floor_in_random_cases() {
    let test = test_of(|_| true);
    let ([r, u, c], _) = campaign(&test, 300, |random| {
        let mut sizes = links(test.chain(), |_| 1.0);
        for link in &mut sizes {
            link.value *= random.random_range(-1.0..1.0);
        }
        sizes
    });
    // D.4: 2.1, 13.1, 3.1 µm; the scatter of U over seeds is about 0.3.
    assert!((r - 2.1).abs() < 0.1, "R {r}");
    assert!((u - 13.1).abs() < 1.0, "U {u}");
    assert!((c - 3.1).abs() < 0.15, "C {c}");
}

#[test]
fn case_e1_keeps_the_rule_in_ninety_nine_of_a_hundred_runs() {
    let test = test_of(|_| true);
    // 500 runs, as the source has them, leave the share uncertain by 0.4 %; the expected share is 99.4 %.
    let ([r, u, c], kept) = campaign(&test, 5000, |_| e1(test.chain()));
    assert!(kept >= 0.99, "kept in {kept}");
    // One run of the source: R 2.6, U 21.7, C 3.0 µm; expected over runs 2.12, 20.8, 3.1.
    assert!(
        (r - 2.12).abs() < 0.1 && (u - 20.83).abs() < 0.2 && (c - 3.1).abs() < 0.15,
        "{r} {u} {c}"
    );
}

#[test]
fn mismatches_alone_tell_the_links_weakly() {
    let test = test_of(|_| true);
    let truth = e1(test.chain());
    let errors = ChainErrors::of_links(test.chain(), &truth);
    let mut squares = [0.0; 8];
    let mut floor = 0.0;
    let runs = 200;
    let mut uncertainty = Vec::new();
    for seed in 0..runs {
        let mut random = Pcg64::seed_from_u64(seed);
        let none = test.compensation(&[]).unwrap();
        let outcome = test.run(&errors, &none, NOISE, &mut random).unwrap();
        let found = identify(&test, &truth, &outcome.uncompensated, NOISE).unwrap();
        for ((sum, found), truth) in squares.iter_mut().zip(&found.links).zip(&truth) {
            *sum += (found.value - truth.value).powi(2) / f64::from(runs as u32);
        }
        let volumetric = test.compensation(&found.links).unwrap();
        let again = test.run(&errors, &volumetric, NOISE, &mut random).unwrap();
        floor += rms(&again.compensated).powi(2) / f64::from(runs as u32);
        uncertainty = found.uncertainty;
    }
    // D.4: 9 to 25 µrad, 1.7 µm.
    for (place, (square, stated)) in squares.iter().zip(&uncertainty).enumerate() {
        assert!(
            (square.sqrt() / stated - 1.0).abs() < 0.2,
            "{}",
            LINKS[place].0
        );
        if LINKS[place].0 == "EX0C" {
            assert!((stated - 1.7e-6).abs() < 0.1e-6);
        } else {
            assert!((9e-6..26e-6).contains(stated), "{stated}");
        }
    }
    // Yet they validate: C 2.8 µm in the source's run, 2.7 expected.
    assert!((floor.sqrt() - 2.66e-6).abs() < 0.15e-6);
}

#[test]
fn patterns_the_machine_cannot_cut_are_named() {
    let chain = Chain::from_urdf(WCBXFZYST).unwrap();
    let new = |rotary: &[&str], patterns| {
        MismatchTest::new(
            chain.clone(),
            Isometry3::identity(),
            Point3::origin(),
            rotary,
            patterns,
        )
        .unwrap_err()
        .to_string()
    };
    assert!(new(&["B", "A"], standard_patterns()).contains("`A`"));
    assert!(new(&["B"], standard_patterns()).contains("index of 2 positions for 1"));
    let mut far = standard_patterns();
    far[3].point = Point3::new(0.0, 0.0, 2.0);
    assert!(new(&ROTARY, far).contains("P4"));
}
