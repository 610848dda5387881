//! Fits against properties any least-squares fit must have.

use metrology::fit::robust::{Rejection, reject_outliers};
use metrology::fit::{self, Fit, FitError, Point, Shape};
use nalgebra::{Rotation3, Vector3};
use rand::Rng;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;

/// A part-sized round feature: `turn` of the circumference, `slope` of the radius by height, noise of 3 µm.
fn round(rng: &mut Pcg64, n: usize, radius: f64, height: f64, turn: f64, slope: f64) -> Vec<Point> {
    let noise = Normal::new(0.0, 3e-6).expect("a deviation");
    (0..n)
        .map(|_| {
            let angle = rng.random_range(0.0..turn);
            let z = rng.random_range(-0.5..0.5) * height;
            let rho = radius + slope * z + noise.sample(rng);
            Point::new(rho * angle.cos(), rho * angle.sin(), z)
        })
        .collect()
}

fn ball(rng: &mut Pcg64, n: usize, radius: f64) -> Vec<Point> {
    let noise = Normal::new(0.0, 3e-6).expect("a deviation");
    (0..n)
        .map(|_| {
            let z: f64 = rng.random_range(0.0..1.0);
            let angle = rng.random_range(0.0..std::f64::consts::TAU);
            let ring = (1.0 - z * z).sqrt();
            Point::new(ring * angle.cos(), ring * angle.sin(), z) * (radius + noise.sample(rng))
        })
        .collect()
}

fn pose(rng: &mut Pcg64) -> impl Fn(&Point) -> Point + use<> {
    let mut component = || rng.random_range(-1.0..1.0);
    let turn = Rotation3::new(Vector3::new(component(), component(), component()) * 3.0);
    let shift = Vector3::new(component(), component(), component());
    move |p| turn * p + shift
}

/// The residuals of a fit do not depend on the pose of the points (beyond the sign of a plane) nor, point by point, on
/// their order.
fn check_invariance<S: Shape>(
    seed: u64,
    fit: impl Fn(&[Point]) -> Result<Fit<S>, FitError>,
    make: impl Fn(&mut Pcg64) -> Vec<Point>,
) {
    let mut rng = Pcg64::seed_from_u64(seed);
    for round in 0..100 {
        let points = make(&mut rng);
        let base = fit(&points).expect("a fit");
        let place = pose(&mut rng);
        let moved = fit(&points.iter().map(&place).collect::<Vec<_>>()).expect("a fit");
        let mut order: Vec<usize> = (0..points.len()).collect();
        order.shuffle(&mut rng);
        let shuffled = fit(&order.iter().map(|&i| points[i]).collect::<Vec<_>>()).expect("a fit");
        for (position, &i) in order.iter().enumerate() {
            let r = base.residuals[i].abs();
            let (m, s) = (moved.residuals[i].abs(), shuffled.residuals[position].abs());
            assert!(
                (r - m).abs() < 2e-13 && (r - s).abs() < 2e-13,
                "{} {round}: {r:e} {m:e} {s:e}",
                S::NAME
            );
            assert!((base.shape.distance(&points[i]) - base.residuals[i]).abs() < 1e-14);
        }
        assert!((base.form - moved.form).abs() < 1e-12);
        assert!((base.rms - shuffled.rms).abs() < 1e-12);
    }
}

#[test]
fn fits_do_not_depend_on_pose_or_order() {
    let turn = std::f64::consts::TAU;
    check_invariance(2, fit::plane, |rng| round(rng, 15, 0.02, 1e-6, turn, 0.0));
    check_invariance(3, fit::circle, |rng| round(rng, 15, 0.02, 1e-6, turn, 0.0));
    check_invariance(4, fit::sphere, |rng| ball(rng, 25, 0.0125));
    check_invariance(5, fit::cylinder, |rng| {
        round(rng, 20, 0.01, 0.05, turn, 0.0)
    });
    check_invariance(6, fit::cone, |rng| round(rng, 25, 0.02, 0.03, turn, 0.4));
}

/// Repeats a measurement with fresh noise and compares the scatter of two parameters with the stated uncertainty.
#[test]
fn covariance_predicts_the_scatter_of_repeated_fits() {
    let mut rng = Pcg64::seed_from_u64(11);
    let (sigma, runs) = (1e-5, 1500);
    let noise = Normal::new(0.0, sigma).unwrap();
    let exact: Vec<Point> = (0..14)
        .map(|i| {
            let angle = 0.2 * f64::from(i);
            let z = 0.004 * f64::from(i % 5);
            let rho = 0.03 + 0.3 * z;
            Point::new(rho * angle.cos(), rho * angle.sin(), z)
        })
        .collect();
    let mut squares = [0.0; 4];
    let reference = fit::cone(&exact).unwrap();
    let ring: Vec<Point> = exact
        .iter()
        .map(|p| Point::new(p.x, p.y, 0.0).normalize() * 0.03)
        .collect();
    let circle_reference = fit::circle(&ring).unwrap();
    for _ in 0..runs {
        let mut noisy = |points: &[Point]| -> Vec<Point> {
            points
                .iter()
                .map(|p| p + Point::from_fn(|_, _| noise.sample(&mut rng)))
                .collect()
        };
        let cone = fit::cone(&noisy(&exact)).unwrap().shape;
        squares[0] += (cone.half_angle - reference.shape.half_angle).powi(2);
        let tilt = (cone.axis - reference.shape.axis).dot(&reference.frame.column(0));
        squares[1] += tilt.powi(2);
        let circle = fit::circle(&noisy(&ring)).unwrap().shape;
        squares[2] += (circle.radius - circle_reference.shape.radius).powi(2);
        let rise =
            (circle.center - circle_reference.shape.center).dot(&circle_reference.shape.normal);
        squares[3] += rise.powi(2);
    }
    let stated = [
        reference.uncertainty("half_angle", sigma).unwrap(),
        reference.uncertainty("a1", sigma).unwrap(),
        circle_reference.uncertainty("radius", sigma).unwrap(),
        circle_reference.uncertainty("c3", sigma).unwrap(),
    ];
    for (index, (sum, stated)) in squares.iter().zip(stated).enumerate() {
        let ratio = (sum / f64::from(runs)).sqrt() / stated;
        // Four standard deviations of a standard deviation from 1500 runs: 4/√3000.
        assert!(
            (ratio - 1.0).abs() < 0.073,
            "parameter {index}: ratio {ratio}"
        );
    }
}

/// Short arcs, slender shafts, discs and nearly cylindrical cones, five to forty points, no starting values.
#[test]
fn exact_shapes_are_found_from_any_distribution_of_points() {
    let mut rng = Pcg64::seed_from_u64(99);
    for case in 0..1000 {
        let radius = 10f64.powf(rng.random_range(-3.0..-0.5));
        let height = radius * 10f64.powf(rng.random_range(-0.7..1.7));
        let turn = rng.random_range(0.6..std::f64::consts::TAU);
        let cone = case % 2 == 1;
        // The small end keeps a fifth of the radius.
        let slope = if cone {
            rng.random_range(0.01..1.0_f64).min(1.6 * radius / height)
        } else {
            0.0
        };
        let n = rng.random_range(9..40);
        let place = pose(&mut rng);
        let points: Vec<Point> = (0..n)
            .map(|_| {
                let angle = rng.random_range(0.0..turn);
                let z = rng.random_range(-0.5..0.5) * height;
                let rho = radius + slope * z;
                place(&Point::new(rho * angle.cos(), rho * angle.sin(), z))
            })
            .collect();
        let rms = if cone {
            fit::cone(&points).map(|f| f.rms)
        } else {
            fit::cylinder(&points).map(|f| f.rms)
        };
        assert!(
            rms.as_ref().is_ok_and(|rms| *rms < 1e-12),
            "case {case}: {rms:?}, radius {radius}, height {height}, turn {turn}, slope {slope}, {n} points"
        );
    }
}

#[test]
fn points_without_a_shape_are_refused_in_words() {
    let line: Vec<Point> = (0..9)
        .map(|i| Point::new(0.1, 0.2, 0.3) + Point::new(0.01, 0.02, -0.005) * f64::from(i))
        .collect();
    let flat: Vec<Point> = (0..12)
        .map(|i| Point::new(f64::from(i % 4) * 0.01, f64::from(i / 4) * 0.013, 0.02))
        .collect();
    let mut broken = flat.clone();
    broken[7].y = f64::NAN;
    assert_eq!(fit::plane(&broken), Err(FitError::NotFinite { index: 7 }));
    let text = |error: FitError| error.to_string();
    assert_eq!(
        text(fit::sphere(&flat[..3]).unwrap_err()),
        "a sphere needs at least 4 points, 3 given"
    );
    assert_eq!(
        text(fit::plane(&[line[0]; 5]).unwrap_err()),
        "the points do not determine a plane: they coincide"
    );
    for degenerate in [
        fit::plane(&line).map(|_| ()),
        fit::circle(&line).map(|_| ()),
        fit::sphere(&line).map(|_| ()),
        fit::sphere(&flat).map(|_| ()),
        fit::cylinder(&line).map(|_| ()),
        fit::cylinder(&flat).map(|_| ()),
        fit::cone(&flat).map(|_| ()),
    ] {
        assert!(
            matches!(degenerate, Err(FitError::Degenerate { .. })),
            "{degenerate:?}"
        );
    }
    // One ring of a cylinder, lifted by nothing: every cone through it fits.
    let ring: Vec<Point> = (0..8)
        .map(|i| {
            let angle = f64::from(i);
            Point::new(0.01 * angle.cos(), 0.01 * angle.sin(), 0.0)
        })
        .collect();
    assert!(fit::cone(&ring).is_err());
    assert!(fit::circle(&ring).is_ok());
}

/// Chips and knocks on a fifth of the touches, some of them on one side.
#[test]
fn false_touches_are_rejected_and_no_others() {
    let mut rng = Pcg64::seed_from_u64(41);
    let (mut missed, mut lost, mut total) = (0, 0, 0);
    for case in 0..5 {
        let mut points = round(&mut rng, 30, 0.01, 0.03, std::f64::consts::TAU, 0.0);
        let truth: Vec<usize> = (0..6).map(|k| k * 5).collect();
        for &i in &truth {
            let outward = Point::new(points[i].x, points[i].y, 0.0).normalize();
            points[i] += outward * rng.random_range(40e-6..300e-6);
        }
        let rules = Rejection::default();
        let found = reject_outliers(&points, &rules, fit::cylinder).expect("a cylinder");
        let rejected: Vec<usize> = found.rejected.iter().map(|r| r.0).collect();
        missed += truth.iter().filter(|i| !rejected.contains(i)).count();
        lost += rejected.iter().filter(|i| !truth.contains(i)).count();
        total += found.kept.len();
        assert!(
            (found.fit.shape.radius - 0.01).abs() < 4e-6,
            "case {case}: {rejected:?}"
        );
    }
    assert_eq!(missed, 0);
    assert!(lost * 50 <= total, "{lost} of {total}");
    let clean = round(&mut rng, 200, 0.01, 0.03, std::f64::consts::TAU, 0.0);
    let found = reject_outliers(&clean, &Rejection::default(), fit::cylinder).expect("a cylinder");
    assert!(found.rejected.is_empty());
    assert_eq!(found.fit, fit::cylinder(&clean).expect("a cylinder"));
}
