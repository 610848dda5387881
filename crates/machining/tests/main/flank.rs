//! Flank milling against the figures of `docs/source_systems.md, E`, and the equations against the true envelope.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use machine::Chain;
use machine::models::XFYZBA;
use machining::flank::runout::test_heights;
use machining::flank::simulated::{FlankCase, Place, measured_places};
use machining::flank::{
    ConeFrustum, ErringPath, FlankPath, Mirrored, RadiusProfile, Regenerated, RuledPart, Runout,
    SPiece, contact_point, envelope_error, envelope_normal, material_left, normal_error,
    path_normal,
};
use metrology::statistics::rms;
use rand::SeedableRng;
use rand_pcg::Pcg64;

fn case() -> FlankCase {
    FlankCase::standard(Chain::from_urdf(XFYZBA).unwrap()).unwrap()
}

/// `count` parameters inside the path, evenly spaced, its ends left out.
fn inside(path: &impl FlankPath, count: usize) -> Vec<f64> {
    let (first, last) = path.domain();
    let at = |i: usize| first + (last - first) * (0.03 + 0.94 * i as f64 / (count - 1) as f64);
    (0..count).map(at).collect()
}

#[test]
fn run_out_has_the_published_values_and_period() {
    let tool = Runout::default();
    let published = [
        14.1, 15.5, 15.9, 15.4, 14.0, 11.8, 10.0, 12.3, 13.8, 14.6, 14.5, 13.6, 12.1, 9.9, 10.5,
    ];
    for (height, expected) in test_heights().into_iter().zip(published) {
        let got = tool.radius_error(height) * 1e6;
        assert!((got - expected).abs() <= 0.05 + 1e-9, "{got} at {height}");
    }
    assert!((tool.period() - 20.9e-3).abs() < 0.05e-3);
    let round = Runout {
        offset: 0.0,
        lean: 0.0,
        ..tool
    };
    assert_eq!(round.radius_error(0.01), tool.constant);
}

#[test]
fn the_parts_have_the_published_sizes() {
    let piece = SPiece::new(0.010).unwrap();
    let [bottom, top] = piece.edge_lengths();
    assert!((bottom - 380.6e-3).abs() < 0.05e-3 && (top - 360.2e-3).abs() < 0.05e-3);
    let mut lean = 0.0_f64;
    let mut twist = 0.0_f64;
    for i in 0..=2000 {
        let u = f64::from(i) / 2000.0;
        lean = lean.max(piece.location(u).axis.z.clamp(-1.0, 1.0).acos());
        twist = twist.max(piece.surface(u, 0.0).1.angle(&piece.surface(u, 1.0).1));
    }
    assert!((lean.to_degrees() - 10.7).abs() < 0.05, "lean {lean}");
    assert!((twist.to_degrees() - 6.7).abs() < 0.05, "twist {twist}");
    let cone = ConeFrustum::new(0.010);
    assert!((2.0 * cone.top_radius() - 69.28e-3).abs() < 5e-6);
    assert!((cone.ruling(0.0) - 20.71e-3).abs() < 5e-6);
    let head = case().head;
    let mut range = [f64::INFINITY, -f64::INFINITY, f64::INFINITY, -f64::INFINITY];
    for u in inside(&cone, 721) {
        let location = cone.location(u * 1.07);
        let [_, _, _, b, a] = head.positions(&location.point, &location.axis);
        range = [
            range[0].min(b),
            range[1].max(b),
            range[2].min(a),
            range[3].max(a),
        ];
    }
    for (got, published) in range.into_iter().zip([-5.0, 25.0, -15.0, 15.0]) {
        assert!((got.to_degrees() - published).abs() < 0.1, "{got}");
    }
}

/// Distances (m) by which the source's one normal per location misses the envelope, at heights up to 45 mm.
fn twist_error(path: &impl FlankPath, places: &[f64], heights: &[f64]) -> Vec<f64> {
    let radius = 0.010;
    let mut errors = Vec::new();
    for &u in places {
        let location = path.location(u);
        let one = path_normal(path, u).unwrap();
        for &height in heights {
            let own = envelope_normal(path, u, height).unwrap();
            let source = contact_point(&location, &one, height, radius);
            let true_one = contact_point(&location, &own, height, radius);
            errors.push(-own.dot(&(source - true_one)));
        }
    }
    errors
}

#[test]
fn one_normal_per_location_is_exact_on_a_cone_and_not_on_a_twisted_surface() {
    let mut heights = test_heights();
    heights.insert(0, 0.0);
    let most = |errors: &[f64]| errors.iter().fold(0.0_f64, |most, e| most.max(e.abs()));
    let cone = ConeFrustum::new(0.010);
    let errors = twist_error(&cone, &inside(&cone, 61), &heights);
    assert!(most(&errors) <= 0.05e-6, "cone {}", most(&errors));
    // Published 72 µm and rms 15.5 over an unstated grid; a dense one has 75.3 and 15.8.
    let piece = SPiece::new(0.010).unwrap();
    let errors = twist_error(&piece, &inside(&piece, 401), &heights);
    assert!((most(&errors) - 74e-6).abs() < 3e-6, "S {}", most(&errors));
    assert!(
        (rms(&errors) - 15.7e-6).abs() < 0.7e-6,
        "S rms {}",
        rms(&errors)
    );
}

#[test]
fn the_envelope_normal_is_that_of_the_swept_surface() {
    let piece = SPiece::new(0.010).unwrap();
    for u in inside(&piece, 9) {
        for height in [0.0, 0.012, 0.036] {
            let normal = envelope_normal(&piece, u, height).unwrap();
            let point = contact_point(&piece.location(u), &normal, height, 0.010);
            let left = material_left(&piece, &|_| 0.010, &point, &-normal, u).unwrap();
            assert!(left.abs() < 1e-9, "{left} at {u}, {height}");
        }
    }
}

#[test]
fn offsetting_at_mid_height_keeps_the_overcut_small() {
    let overcut = |v: f64| {
        let piece = SPiece::offset_along(0.010, v).unwrap();
        let mut least = 0.0_f64;
        for u in inside(&piece, 101) {
            for height in test_heights().into_iter().filter(|&height| height < 0.040) {
                let (point, outward) = piece.surface(u, height / piece.ruling(u));
                let left = material_left(&piece, &|_| 0.010, &point, &outward, u).unwrap();
                assert!(
                    left < 1e-8,
                    "a cylinder on a twisted surface only overcuts: {left}"
                );
                least = least.min(left);
            }
        }
        -least
    };
    // Published 12.3 and 60.8 µm over an unstated grid.
    let (middle, bottom) = (overcut(0.5), overcut(0.0));
    assert!((bottom - 60.8e-6).abs() < 2e-6, "bottom {bottom}");
    assert!(middle < 15e-6 && middle > 11e-6, "middle {middle}");
}

#[test]
fn both_faces_of_a_rib_remove_the_set_up_offset() {
    let case = case();
    let runs = 12;
    let (mut one_sided, mut two_sided) = (0.0, 0.0);
    for seed in 0..runs {
        let mut random = Pcg64::seed_from_u64(seed);
        let test = case.planar_test(&mut random).unwrap();
        let bias = |profile: &RadiusProfile| {
            let errors: Vec<f64> = profile
                .heights()
                .iter()
                .zip(profile.errors())
                .map(|(&height, error)| error - case.tool.radius_error(height))
                .collect();
            (errors.iter().sum::<f64>() / errors.len() as f64).abs() / runs as f64
        };
        one_sided += bias(&RadiusProfile::from_one_face(&test.heights, &test.plus).unwrap());
        two_sided +=
            bias(&RadiusProfile::from_two_faces(&test.heights, &test.plus, &test.minus).unwrap());
    }
    // Published 6.4 and 0.24 µm.
    assert!((one_sided - 6.4e-6).abs() < 0.8e-6, "{one_sided}");
    assert!(two_sided < 0.4e-6, "{two_sided}");
}

/// Mean over 12 seeds of the rms prediction error (m) without and with the tool, and the worst ratio.
fn campaign(part: &impl RuledPart) -> (f64, f64, f64) {
    let case = case();
    let places = measured_places(part);
    let (mut path_only, mut with_tool, mut worst) = (0.0, 0.0, 0.0_f64);
    for seed in 0..12 {
        let mut random = Pcg64::seed_from_u64(seed);
        let test = case.planar_test(&mut random).unwrap();
        let profile =
            RadiusProfile::from_two_faces(&test.heights, &test.plus, &test.minus).unwrap();
        let measured = case.measured(part, part, &places, &mut random).unwrap();
        let miss = |profile: Option<&RadiusProfile>| {
            let predicted = case.predicted(part, part, profile, &places).unwrap();
            let errors: Vec<f64> = measured.iter().zip(predicted).map(|(m, p)| m - p).collect();
            rms(&errors)
        };
        let (without, with) = (miss(None), miss(Some(&profile)));
        path_only += without / 12.0;
        with_tool += with / 12.0;
        worst = worst.max(with / without);
    }
    (path_only, with_tool, worst)
}

#[test]
fn a_tool_profile_predicts_what_the_path_alone_does_not() {
    for (part, published, (path_only, with_tool, worst)) in [
        (
            "S",
            (13.2e-6, 1.9e-6),
            campaign(&SPiece::new(0.010).unwrap()),
        ),
        (
            "cone",
            (14.1e-6, 1.6e-6),
            campaign(&ConeFrustum::new(0.010)),
        ),
    ] {
        // Which heights the source measured on the parts is not stated; ours have another mean run-out.
        assert!(
            (path_only - published.0).abs() < 1.0e-6,
            "{part}: {path_only}"
        );
        assert!(
            (with_tool - published.1).abs() < 0.35e-6,
            "{part}: {with_tool}"
        );
        assert!(worst <= 0.30, "{part}: {worst}");
    }
}

#[test]
fn predictions_equal_the_swept_surface_to_first_order() {
    let case = case();
    let heights: Vec<f64> = (0..=450).map(|i| f64::from(i) * 1e-4).collect();
    let errors: Vec<f64> = heights.iter().map(|&z| case.tool.radius_error(z)).collect();
    let profile = RadiusProfile::new(&heights, &errors).unwrap();
    let piece = SPiece::new(0.010).unwrap();
    let driven = ErringPath::new(&piece, case.head, &case.chain, &case.errors).unwrap();
    let places = measured_places(&piece);
    let predicted = case
        .predicted(&piece, &piece, Some(&profile), &places)
        .unwrap();
    let mut of_source = 0.0_f64;
    for (&place, predicted) in places.iter().zip(predicted) {
        let left = case.machined(&piece, &piece, place).unwrap();
        assert!(
            (left - predicted).abs() < 0.1e-6,
            "{left} {predicted} at {place:?}"
        );
        let (point, _) = piece.surface(place.u, place.v);
        let location = piece.location(place.u);
        let height = location.axis.dot(&(point - location.point));
        let error = profile.at(height);
        let source = normal_error(&piece, &driven, place.u, height, 0.010, error).unwrap();
        let own = envelope_error(&piece, &driven, place.u, height, error).unwrap();
        of_source = of_source.max((source - own).abs());
    }
    // The source's form holds for differences, up to the movement along the surface times the twist.
    assert!(of_source > 0.2e-6 && of_source < 1e-6, "{of_source}");
}

#[test]
fn a_regenerated_path_leaves_less() {
    let case = case();
    let mut random = Pcg64::seed_from_u64(3);
    let test = case.planar_test(&mut random).unwrap();
    let profile = RadiusProfile::from_two_faces(&test.heights, &test.plus, &test.minus).unwrap();
    let cone = ConeFrustum::new(0.010);
    let driven = ErringPath::new(&cone, case.head, &case.chain, &case.known).unwrap();
    let mirrored = Mirrored::new(driven);
    let regenerated = Regenerated::new(&mirrored, &profile, 0.0, cone.ruling(0.0));
    let (offset, lean) = regenerated.moved();
    assert!(offset > 8e-6 && lean.abs() < 2e-3);
    let places = measured_places(&cone);
    let left = |path: &dyn FlankPath| {
        let left: Vec<f64> = places
            .iter()
            .map(|&place| case.machined(&cone, &path, place).unwrap())
            .collect();
        rms(&left)
    };
    let predicted = |path: &dyn FlankPath| {
        rms(&case
            .predicted(&cone, &path, Some(&profile), &places)
            .unwrap())
    };
    let (as_planned, for_the_machine, for_both) =
        (left(&cone), left(&mirrored), left(&regenerated));
    assert!(as_planned > 15e-6, "{as_planned}");
    // Without errors of the path, the run-out of the heights in use remains; then its departure from a line.
    assert!((for_the_machine - 14e-6).abs() < 1e-6, "{for_the_machine}");
    assert!(for_both < 2.5e-6, "{for_both}");
    assert!(predicted(&regenerated) < 0.2 * predicted(&cone));
}

#[test]
fn unusable_profiles_are_refused() {
    assert!(RadiusProfile::new(&[], &[]).is_err());
    assert!(RadiusProfile::new(&[0.0], &[1e-6, 2e-6]).is_err());
    assert!(RadiusProfile::new(&[0.0, 0.0], &[1e-6, 2e-6]).is_err());
    assert!(RadiusProfile::new(&[0.0, f64::NAN], &[1e-6, 2e-6]).is_err());
    assert!(RadiusProfile::from_two_faces(&[0.0], &[1e-6], &[]).is_err());
    let profile = RadiusProfile::new(&[0.0, 1.0, 2.0], &[0.0, 1e-6, 4e-6]).unwrap();
    for (height, expected) in [
        (-1.0, 0.0),
        (0.5, 0.5e-6),
        (1.0, 1e-6),
        (1.5, 2.5e-6),
        (9.0, 4e-6),
    ] {
        assert!((profile.at(height) - expected).abs() < 1e-18);
    }
    let lost = Place {
        u: 0.5,
        v: f64::NAN,
    };
    let cone = ConeFrustum::new(0.010);
    assert!(case().machined(&cone, &cone, lost).is_err());
}
