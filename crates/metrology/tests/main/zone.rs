//! Touching fits against exhaustive enumeration of contacts, and against random search.

use metrology::fit::zone::{self, Criterion, ZoneFit};
use metrology::fit::{Cone, Cylinder, FitError, Point, Shape, Sphere};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Points near a feature of radius 10 mm, form error up to 20 µm, in a random pose.
fn round(rng: &mut Pcg64, n: usize, height: f64, slope: f64) -> Vec<Point> {
    let turn = nalgebra::Rotation3::new(Vector3::from_fn(|_, _| rng.random_range(-2.0..2.0)));
    let shift = Vector3::from_fn(|_, _| rng.random_range(-0.2..0.2));
    (0..n)
        .map(|i| {
            let angle = std::f64::consts::TAU * (i as f64 + rng.random_range(-0.3..0.3)) / n as f64;
            let z = if height > 0.0 {
                rng.random_range(-0.5..0.5) * height
            } else {
                0.0
            };
            let rho = 0.01 + slope * z + rng.random_range(-10e-6..10e-6);
            turn * Point::new(rho * angle.cos(), rho * angle.sin(), z) + shift
        })
        .collect()
}

fn by_cylinder(points: &[Point], criterion: Criterion) -> Result<ZoneFit<Cylinder>, FitError> {
    zone::cylinder(&metrology::fit::cylinder(points)?, points, criterion)
}

fn subsets(n: usize, k: usize) -> Vec<Vec<usize>> {
    if k == 0 {
        return vec![Vec::new()];
    }
    (k - 1..n)
        .flat_map(|last| {
            subsets(last, k - 1).into_iter().map(move |mut s| {
                s.push(last);
                s
            })
        })
        .collect()
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
        (l.min(v), h.max(v))
    })
}

/// Width of a point set: over all planes through three points and all pairs of parallel planes through two edges.
fn brute_flatness(points: &[Point]) -> f64 {
    let mut best = f64::INFINITY;
    let mut try_normal = |normal: Vector3<f64>| {
        if normal.norm() > 1e-12 {
            let (low, high) = range(points.iter().map(|p| p.dot(&normal.normalize())));
            best = best.min(high - low);
        }
    };
    for t in subsets(points.len(), 3) {
        try_normal((points[t[1]] - points[t[0]]).cross(&(points[t[2]] - points[t[0]])));
    }
    for t in subsets(points.len(), 4) {
        for [a, b, c, d] in [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2]] {
            try_normal((points[t[b]] - points[t[a]]).cross(&(points[t[d]] - points[t[c]])));
        }
    }
    best
}

#[test]
fn flatness_is_the_least_over_all_contacts() {
    let mut rng = Pcg64::seed_from_u64(1);
    for case in 0..200 {
        let tilt = nalgebra::Rotation3::new(Vector3::from_fn(|_, _| rng.random_range(-2.0..2.0)));
        let points: Vec<Point> = (0..rng.random_range(4..12))
            .map(|_| {
                tilt * Point::new(
                    rng.random_range(-0.05..0.05),
                    rng.random_range(-0.05..0.05),
                    rng.random_range(-10e-6..10e-6),
                )
            })
            .collect();
        let fit = zone::plane(&points).unwrap();
        let brute = brute_flatness(&points);
        assert!(
            (fit.zone - brute).abs() < 1e-13,
            "{case}: {:e} {brute:e}",
            fit.zone
        );
        assert!(fit.contacts.len() >= 4);
    }
}

/// All centres at which a roundness criterion can be extreme: circumcentres, and where a bisector of two points meets
/// that of two others (or the middle of two).
fn centres(points: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
    let bisector = |a: usize, b: usize| {
        let (p, q) = (points[a], points[b]);
        (q - p, (q.norm_squared() - p.norm_squared()) / 2.0)
    };
    let meet = |(a, s): (Vector2<f64>, f64), (b, t): (Vector2<f64>, f64)| {
        Matrix2::new(a.x, a.y, b.x, b.y)
            .try_inverse()
            .map(|m| m * Vector2::new(s, t))
    };
    let pairs = subsets(points.len(), 2);
    let mut found: Vec<Vector2<f64>> = pairs
        .iter()
        .map(|p| (points[p[0]] + points[p[1]]) / 2.0)
        .collect();
    for (i, a) in pairs.iter().enumerate() {
        for b in &pairs[..i] {
            found.extend(meet(bisector(a[0], a[1]), bisector(b[0], b[1])));
        }
    }
    found
}

#[test]
fn roundness_by_every_criterion_is_the_extreme_over_all_contacts() {
    let mut rng = Pcg64::seed_from_u64(2);
    for case in 0..200 {
        let n = rng.random_range(5..11);
        let points = round(&mut rng, n, 0.0, 0.0);
        let flat = metrology::fit::circle(&points).unwrap();
        let local: Vec<Vector2<f64>> = points
            .iter()
            .map(|p| flat.frame.tr_mul(&(p - flat.shape.center)).xy())
            .collect();
        let radii = |c: &Vector2<f64>| range(local.iter().map(|p| (p - c).norm()));
        let centres = centres(&local);
        let zone_width = centres
            .iter()
            .map(radii)
            .map(|(l, h)| h - l)
            .fold(f64::INFINITY, f64::min);
        let outer = centres
            .iter()
            .map(|c| radii(c).1)
            .fold(f64::INFINITY, f64::min);
        // An inscribed circle lies among the points; far outside any empty circle is larger.
        let inner = centres
            .iter()
            .filter(|c| c.norm() < 1e-3)
            .map(|c| radii(c).0)
            .fold(0.0, f64::max);
        let fit = |criterion| zone::circle(&points, criterion).unwrap();
        let found = fit(Criterion::MinimumZone);
        assert!(
            (found.zone - zone_width).abs() < 1e-13,
            "{case}: {:e} {zone_width:e}",
            found.zone
        );
        let found = fit(Criterion::MinimumCircumscribed);
        assert!(
            (found.shape.radius - outer).abs() < 1e-13,
            "{case}: {:e}",
            found.shape.radius - outer
        );
        let found = fit(Criterion::MaximumInscribed);
        assert!(
            (found.shape.radius - inner).abs() < 1e-13,
            "{case}: {:e}",
            found.shape.radius - inner
        );
    }
}

#[test]
fn the_circumscribed_sphere_is_the_least_over_all_contacts() {
    let mut rng = Pcg64::seed_from_u64(3);
    for _ in 0..60 {
        let points: Vec<Point> = (0..9)
            .map(|_| {
                let d = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64)).normalize();
                d * (0.01 + rng.random_range(-1e-5..1e-5))
            })
            .collect();
        let mut best = f64::INFINITY;
        let mut try_centre = |c: Point| {
            best = best.min(range(points.iter().map(|p| (p - c).norm())).1);
        };
        for t in subsets(9, 2) {
            try_centre((points[t[0]] + points[t[1]]) / 2.0);
        }
        for t in subsets(9, 3) {
            let (a, b) = (points[t[1]] - points[t[0]], points[t[2]] - points[t[0]]);
            let n = a.cross(&b);
            let rows = Matrix3::from_rows(&[a.transpose(), b.transpose(), n.transpose()]);
            let right = Vector3::new(a.norm_squared() / 2.0, b.norm_squared() / 2.0, 0.0);
            try_centre(points[t[0]] + rows.try_inverse().unwrap() * right);
        }
        for t in subsets(9, 4) {
            let arm = |k: usize| points[t[k]] - points[t[0]];
            let rows =
                Matrix3::from_rows(&[arm(1).transpose(), arm(2).transpose(), arm(3).transpose()]);
            let right = Vector3::from_fn(|k, _| arm(k + 1).norm_squared() / 2.0);
            try_centre(points[t[0]] + rows.try_inverse().unwrap() * right);
        }
        let fit = zone::sphere(&points, Criterion::MinimumCircumscribed).unwrap();
        assert!(
            (fit.shape.radius - best).abs() < 1e-13,
            "{:e}",
            fit.shape.radius - best
        );
    }
}

/// Random search around a shape, from its own size down to 1e-13 m: never better, and nearly as good from outside.
fn check_by_search<S: Shape>(
    rng: &mut Pcg64,
    found: f64,
    start: &[f64],
    value: &dyn Fn(&[f64]) -> f64,
    make: &str,
) {
    assert!(
        (value(start) - found).abs() < 1e-12,
        "{make}: {:e}",
        value(start) - found
    );
    for exponent in 0..10 {
        let step = 1e-4 * 10f64.powi(-exponent);
        for _ in 0..2000 {
            let trial: Vec<f64> = start
                .iter()
                .map(|v| v + step * rng.random_range(-1.0..1.0))
                .collect();
            let other = value(&trial);
            assert!(
                other >= found - 1e-13,
                "{} {make}: {:e} lower at step {step:e}",
                S::NAME,
                found - other
            );
        }
    }
}

/// Offsets and tilts of an axis about a fitted one, then the distances from it.
fn about(
    points: &[Point],
    point: Point,
    axis: Vector3<f64>,
) -> impl Fn(&[f64]) -> Vec<(f64, f64)> + '_ {
    let side = if axis.x.abs() < 0.7 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let e1 = axis.cross(&side).normalize();
    let e2 = axis.cross(&e1);
    move |v| {
        let foot = point + e1 * v[0] + e2 * v[1];
        let axis = (axis + (e1 * v[2] + e2 * v[3]) * 100.0).normalize();
        points
            .iter()
            .map(|p| {
                let along = (p - foot).dot(&axis);
                ((p - foot - axis * along).norm(), along)
            })
            .collect()
    }
}

#[test]
fn no_random_search_beats_cylinder_line_sphere_or_cone() {
    let mut rng = Pcg64::seed_from_u64(4);
    for _ in 0..8 {
        let points = round(&mut rng, 20, 0.03, 0.0);
        for criterion in [
            Criterion::MinimumZone,
            Criterion::MinimumCircumscribed,
            Criterion::MaximumInscribed,
        ] {
            let fit: ZoneFit<Cylinder> = by_cylinder(&points, criterion).unwrap();
            let distances = about(&points, fit.shape.point, fit.shape.axis);
            let value = |v: &[f64]| {
                let (low, high) = range(distances(v).iter().map(|d| d.0));
                match criterion {
                    Criterion::MinimumZone => high - low,
                    Criterion::MinimumCircumscribed => high,
                    Criterion::MaximumInscribed => -low,
                }
            };
            let found = match criterion {
                Criterion::MinimumZone => fit.zone,
                Criterion::MinimumCircumscribed => fit.shape.radius,
                Criterion::MaximumInscribed => -fit.shape.radius,
            };
            check_by_search::<Cylinder>(
                &mut rng,
                found,
                &[0.0; 4],
                &value,
                &format!("{criterion:?}"),
            );
            assert!(fit.contacts.len() >= 5, "{criterion:?}: {:?}", fit.contacts);
        }
        let ball: Vec<Point> = (0..20)
            .map(|_| {
                let d = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64)).normalize();
                d * (0.01 + rng.random_range(-1e-5..1e-5))
            })
            .collect();
        for criterion in [Criterion::MinimumZone, Criterion::MaximumInscribed] {
            let fit: ZoneFit<Sphere> = zone::sphere(&ball, criterion).unwrap();
            let inner = criterion == Criterion::MaximumInscribed;
            let value = |v: &[f64]| {
                let centre = fit.shape.center + Vector3::new(v[0], v[1], v[2]);
                let (low, high) = range(ball.iter().map(|p| (p - centre).norm()));
                if inner { -low } else { high - low }
            };
            let found = if inner { -fit.shape.radius } else { fit.zone };
            check_by_search::<Sphere>(
                &mut rng,
                found,
                &[0.0; 3],
                &value,
                &format!("{criterion:?}"),
            );
        }

        let taper = round(&mut rng, 24, 0.02, 0.3);
        let fit: ZoneFit<Cone> = zone::cone(&taper).unwrap();
        let distances = about(&taper, fit.shape.point, fit.shape.axis);
        let value = |v: &[f64]| {
            let (sin, cos) = (fit.shape.half_angle + 100.0 * v[4]).sin_cos();
            let (low, high) = range(distances(v).iter().map(|(rho, z)| rho * cos - z * sin));
            high - low
        };
        check_by_search::<Cone>(&mut rng, fit.zone, &[0.0; 5], &value, "zone");
        assert!(fit.contacts.len() >= 6);
    }
}

/// The least-squares shape is never better at the zone's own criterion, and the criteria order the sizes.
#[test]
fn criteria_order_the_sizes_of_a_shaft() {
    let mut rng = Pcg64::seed_from_u64(5);
    for _ in 0..100 {
        let points = round(&mut rng, 40, 0.05, 0.0);
        let least_squares = metrology::fit::cylinder(&points).unwrap();
        let by = |criterion| by_cylinder(&points, criterion).unwrap();
        let (zone, outer, inner) = (
            by(Criterion::MinimumZone),
            by(Criterion::MinimumCircumscribed),
            by(Criterion::MaximumInscribed),
        );
        assert!(zone.zone <= least_squares.form + 1e-14);
        assert!(zone.zone <= outer.zone + 1e-14 && zone.zone <= inner.zone + 1e-14);
        assert!(inner.shape.radius < least_squares.shape.radius);
        assert!(least_squares.shape.radius < outer.shape.radius);
        assert!(outer.residuals.iter().all(|r| *r <= 1e-15));
        assert!(inner.residuals.iter().all(|r| *r >= -1e-15));
    }
}

#[test]
fn large_clouds_and_degenerate_ones() {
    let mut rng = Pcg64::seed_from_u64(6);
    let points = round(&mut rng, 20_000, 0.05, 0.0);
    let fit = by_cylinder(&points, Criterion::MinimumZone).unwrap();
    // Form errors lie within ±10 µm, and 20 000 points fill the zone.
    assert!(fit.zone < 20e-6 && fit.zone > 19.9e-6);
    let line: Vec<Point> = (0..6)
        .map(|i| Point::new(0.01, 0.02, 0.01 * f64::from(i)))
        .collect();
    assert!(zone::plane(&line).is_err());
    assert!(zone::circle(&line, Criterion::MinimumZone).is_err());
    let mut broken = points[..9].to_vec();
    broken[3].x = f64::NAN;
    let start = metrology::fit::cylinder(&points[..9]).unwrap();
    assert!(zone::cylinder(&start, &broken, Criterion::MinimumZone).is_err());
}
