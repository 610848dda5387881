//! Criteria, uncertainties, touches left out, and the part placed by its datums, against shapes whose answer is known and
//! against the scatter of simulated measurements.

use analysis::{
    AnalysisNode, Config, Input, Output, RawAlignment, RawConfig, RawFit, State, feature::Criterion,
};
use graph::{Node, Outbox, Stamp};
use machine::Chain;
use metrology::statistics::{rms, standard_deviation};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use probecell_msgs::{
    FeatureResult, InspectionFeature, InspectionPlan, InspectionPoint, PartAlignment, ProbeEvent,
    Stylus, geometry_msgs as ros,
};
use rand::SeedableRng;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

use crate::robot::{BALL, ROBOT};

/// m; what a touch errs.
const NOISE: f64 = 1e-6;

fn config(edit: impl FnOnce(&mut RawConfig)) -> Config {
    let mut raw = RawConfig {
        touch_standard_uncertainty_um: NOISE * 1e6,
        repeat_limit_um: 500.0,
        ..RawConfig::default()
    };
    edit(&mut raw);
    raw.check(Chain::from_urdf(ROBOT).expect("a chain"))
        .expect("sound settings")
}

fn fitted(feature: &str, criterion: Criterion, outlier_limit: Option<f64>) -> RawFit {
    RawFit {
        feature: feature.to_owned(),
        criterion,
        outlier_limit,
    }
}

fn ros_vector(v: Vector3<f64>) -> ros::Vector3 {
    ros::Vector3 {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}

fn ros_point(v: Vector3<f64>) -> ros::Point {
    ros::Point {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}

/// A feature, and where it is touched: points and outward normals.
struct Nominal {
    feature: InspectionFeature,
    touches: Vec<(Vector3<f64>, Vector3<f64>)>,
}

fn nominal(id: &str, kind: u8, origin: Vector3<f64>, axis: Vector3<f64>, radius: f64) -> Nominal {
    Nominal {
        feature: InspectionFeature {
            id: id.to_owned(),
            kind,
            origin: ros_point(origin),
            axis: ros_vector(axis),
            radius,
            lower_tolerance: -1e-3,
            upper_tolerance: 1e-3,
            ..InspectionFeature::default()
        },
        touches: Vec::new(),
    }
}

/// A bore of 20 mm along z, touched at so many angles at each of two heights.
fn bore(id: &str, centre: Vector3<f64>, angles: usize) -> Nominal {
    let mut bore = nominal(id, InspectionFeature::BORE, centre, Vector3::z(), 10e-3);
    for height in [-8e-3, 8e-3] {
        for index in 0..angles {
            let angle = index as f64 / angles as f64 * std::f64::consts::TAU;
            let out = Vector3::new(angle.cos(), angle.sin(), 0.0);
            bore.touches
                .push((centre + out * 10e-3 + Vector3::z() * height, -out));
        }
    }
    bore
}

/// A plane of 40 mm by 30 mm about a point, touched three by three times.
fn plane(id: &str, middle: Vector3<f64>, normal: Vector3<f64>) -> Nominal {
    let mut plane = nominal(id, InspectionFeature::PLANE, middle, normal, 0.0);
    let one = normal.yzx();
    let other = normal.cross(&one);
    for (i, j) in (0..9).map(|place| (f64::from(place / 3 - 1), f64::from(place % 3 - 1))) {
        plane
            .touches
            .push((middle + one * (i * 20e-3) + other * (j * 15e-3), normal));
    }
    plane
}

fn ball(id: &str, centre: Vector3<f64>) -> Nominal {
    let mut ball = nominal(id, InspectionFeature::SPHERE, centre, Vector3::z(), 12e-3);
    for index in 0..12 {
        let (turn, rise) = (f64::from(index) * 2.4, 0.1 + f64::from(index) * 0.07);
        let out = Vector3::new(
            turn.cos() * f64::cos(rise),
            turn.sin() * f64::cos(rise),
            f64::sin(rise),
        );
        ball.touches.push((centre + out * 12e-3, out));
    }
    ball
}

/// A cone of 15° that opens along z, 24 mm across at its origin, touched all round at three heights from without or within.
fn cone(id: &str, side: f64) -> Nominal {
    let mut cone = nominal(
        id,
        InspectionFeature::CONE,
        Vector3::zeros(),
        Vector3::z(),
        12e-3,
    );
    cone.feature.half_angle = 15_f64.to_radians();
    let (sin, cos) = cone.feature.half_angle.sin_cos();
    for height in [-8e-3, 0.0, 8e-3] {
        for index in 0..8 {
            let angle = f64::from(index) * std::f64::consts::FRAC_PI_4;
            let out = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let surface = out * (12e-3 + height * sin / cos) + Vector3::z() * height;
            let normal = out * cos - Vector3::z() * sin;
            cone.touches.push((surface, normal * side));
        }
    }
    cone
}

fn plan(features: &[Nominal]) -> InspectionPlan {
    let mut plan = InspectionPlan {
        plan_id: "p".to_owned(),
        stylus: Stylus {
            ball_radius: BALL,
            ..Stylus::default()
        },
        ..InspectionPlan::default()
    };
    plan.part_pose.orientation.w = 1.0;
    for (index, one) in (0..).zip(features) {
        plan.features.push(one.feature.clone());
        for (position, normal) in &one.touches {
            plan.points.push(InspectionPoint {
                feature: index,
                position: ros_point(*position),
                normal: ros_vector(*normal),
                ..InspectionPoint::default()
            });
        }
    }
    plan
}

/// Measures: `excess` (m) is what stands out along the normal at a point of the part. Gives all that is said.
fn measured(
    config: &Config,
    plan: &InspectionPlan,
    order: impl Iterator<Item = usize>,
    excess: impl FnMut(usize, Vector3<f64>, Vector3<f64>) -> f64,
) -> Vec<Output> {
    measured_next(
        config,
        &mut AnalysisNode::start(config),
        plan,
        order,
        excess,
    )
}

/// The same after what was measured before.
fn measured_next(
    config: &Config,
    state: &mut State,
    plan: &InspectionPlan,
    order: impl Iterator<Item = usize>,
    mut excess: impl FnMut(usize, Vector3<f64>, Vector3<f64>) -> f64,
) -> Vec<Output> {
    let mut out = Outbox::default();
    let mut step = |input| AnalysisNode::step(config, state, Stamp(0), input, &mut out);
    step(Input::Plan(plan.clone()));
    for (sequence, index) in order.enumerate() {
        let point = &plan.points[index];
        let p = Vector3::new(point.position.x, point.position.y, point.position.z);
        let n = Vector3::new(point.normal.x, point.normal.y, point.normal.z);
        let centre = p + n * (BALL + excess(index, p, n));
        step(Input::Event(ProbeEvent {
            plan_id: "p".to_owned(),
            sequence: sequence as u64,
            point_index: index as u32,
            axis_names: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
            axis_positions: vec![centre.x, centre.y, centre.z],
            ..ProbeEvent::default()
        }));
    }
    out.messages().to_vec()
}

fn results(said: &[Output]) -> Vec<FeatureResult> {
    let results = said.iter().filter_map(|one| match one {
        Output::Feature(result) => Some(result.clone()),
        _ => None,
    });
    results.collect()
}

fn alignments(said: &[Output]) -> Vec<PartAlignment> {
    let alignments = said.iter().filter_map(|one| match one {
        Output::Alignment(alignment) => Some(alignment.clone()),
        _ => None,
    });
    alignments.collect()
}

/// The surface is an exact wave of 5 µm, seven touches high and seven low at each height: all sizes are known.
#[test]
fn each_criterion_gives_the_size_that_it_is_defined_by() {
    let features = [bore("bore", Vector3::zeros(), 14)];
    let plan = plan(&features);
    for (criterion, size) in [
        (Criterion::LeastSquares, 20e-3),
        (Criterion::MinimumZone, 20e-3),
        (Criterion::MinimumCircumscribed, 20e-3 + 10e-6),
        (Criterion::MaximumInscribed, 20e-3 - 10e-6),
    ] {
        let config = config(|raw| raw.fits = vec![fitted("bore", criterion, None)]);
        let wave = |index: usize, _, _| if index.is_multiple_of(2) { 5e-6 } else { -5e-6 };
        let result = &results(&measured(&config, &plan, 0..28, wave))[0];
        assert!(
            (result.size - size).abs() < 2e-9,
            "{criterion:?}: {:.9}",
            result.size
        );
        assert!(
            (result.form - 10e-6).abs() < 2e-9,
            "{criterion:?}: {:e}",
            result.form
        );
        assert_eq!(result.criterion, criterion.code());
        assert!(result.position < 1e-9 && result.orientation < 1e-6);
    }
}

/// Three touches at each of two heights also lie on a cylinder of 24 mm that runs across the bore.
#[test]
fn a_cylinder_that_is_not_the_plans_is_no_answer() {
    let plan = plan(&[bore("bore", Vector3::zeros(), 3)]);
    let said = measured(&config(|_| {}), &plan, 0..6, |_, _, _| 0.0);
    let result = &results(&said)[0];
    assert!((result.size - 20e-3).abs() < 1e-9, "{:e}", result.size);
    assert!(
        result.text.starts_with("touches do not determine"),
        "{}",
        result.text
    );
}

/// A cone that stands out by 5 µm everywhere along its normals has grown by 10 µm over the cosine of its half angle, from
/// within shrunk by as much. 24 touches spread evenly about the origin tell its size as their mean does.
#[test]
fn a_cone_is_measured_at_its_origin_from_without_and_within() {
    for (side, criterion) in [
        (1.0, Criterion::LeastSquares),
        (-1.0, Criterion::LeastSquares),
        (1.0, Criterion::MinimumZone),
    ] {
        let plan = plan(&[cone("cone", side)]);
        let config = config(|raw| raw.fits = vec![fitted("cone", criterion, None)]);
        let result = &results(&measured(&config, &plan, 0..24, |_, _, _| 5e-6))[0];
        let cos = 15_f64.to_radians().cos();
        let expected = 24e-3 + side * 10e-6 / cos;
        assert!((result.size - expected).abs() < 2e-9, "{}", result.size);
        assert!((result.nominal_size - 24e-3).abs() < 1e-12);
        assert!(result.form < 1e-9 && result.position < 1e-9 && result.orientation < 1e-6);
        if criterion == Criterion::LeastSquares {
            let by_mean = 2.0 * NOISE / cos / 24_f64.sqrt();
            let stated = result.standard_uncertainty;
            assert!(
                (stated / by_mean - 1.0).abs() < 0.15,
                "{stated:e} {by_mean:e}"
            );
        }
    }
    let refused = config(|raw| {
        raw.fits = vec![fitted("cone", Criterion::MaximumInscribed, None)];
    });
    let result = &results(&measured(
        &refused,
        &plan(&[cone("cone", 1.0)]),
        0..24,
        |_, _, _| 0.0,
    ))[0];
    assert_eq!(result.decision, FeatureResult::INVALID);
}

/// Scatter of many noisy measurements of one part against the uncertainties that each states, in the mean of their squares.
/// The part is off by much more than the noise, so that position and orientation have a direction.
#[test]
fn stated_uncertainties_are_the_scatter_of_repeated_measurements() {
    let features = [
        bore("bore", Vector3::new(30e-3, 10e-3, 0.0), 10),
        plane("plane", Vector3::new(0.0, 0.0, 20e-3), Vector3::z()),
        ball("ball", Vector3::new(-40e-3, 20e-3, 10e-3)),
    ];
    let part = Isometry3::from_parts(
        Vector3::new(50e-6, -30e-6, 40e-6).into(),
        UnitQuaternion::from_scaled_axis(Vector3::new(1e-3, 2e-3, 0.0)),
    );
    let mut random = Pcg64::seed_from_u64(5);
    for criterion in [Criterion::LeastSquares, Criterion::MinimumZone] {
        // Each zone is itself simulated a thousand times, so the quickest feature stands for all.
        let zone = criterion == Criterion::MinimumZone;
        let (plan, runs) = if zone {
            (plan(&features[1..2]), 100)
        } else {
            (plan(&features), 600)
        };
        let config = config(|raw| {
            let fits = ["bore", "plane", "ball"].map(|id| fitted(id, criterion, None));
            raw.fits = fits.into();
        });
        let mut found = vec![Vec::new(); plan.features.len()];
        for _ in 0..runs {
            let touch = |_: usize, p: Vector3<f64>, n: Vector3<f64>| {
                let unit: f64 = StandardNormal.sample(&mut random);
                off(&part, p, n) + unit * NOISE
            };
            let said = measured(&config, &plan, 0..plan.points.len(), touch);
            for (own, result) in found.iter_mut().zip(results(&said)) {
                own.push(result);
            }
        }
        // Of a chi-squared with as many degrees of freedom three standard deviations, and what linearisation leaves.
        let allowed = 3.0 / (2.0 * f64::from(runs)).sqrt() + 0.05;
        for own in &found {
            let check = |what: &str, value: fn(&FeatureResult) -> (f64, f64)| {
                let ratio = scatter_over_stated(own, value);
                let id = &own[0].feature_id;
                assert!(
                    (ratio - 1.0).abs() < allowed,
                    "{id} {criterion:?} {what}: {ratio:.3}"
                );
            };
            check("size", |one| (one.size, one.standard_uncertainty));
            check("position", |one| (one.position, one.position_uncertainty));
            if own[0].feature_id != "ball" {
                check("orientation", |one| {
                    (one.orientation, one.orientation_uncertainty)
                });
            }
            // The form found holds the noise already, and disturbed touches add it once more: the uncertainty stated for a
            // form of nothing but noise is up to a third too large, never too small.
            let form: fn(&FeatureResult) -> (f64, f64) = |one| (one.form, one.form_uncertainty);
            if zone {
                check("form", form);
            } else {
                let ratio = scatter_over_stated(own, form);
                assert!((0.70..1.0 + allowed).contains(&ratio), "form: {ratio:.3}");
            }
        }
    }
}

/// Standard deviation of repeated values over the root mean square of their stated uncertainties.
fn scatter_over_stated(results: &[FeatureResult], value: fn(&FeatureResult) -> (f64, f64)) -> f64 {
    let (values, stated): (Vec<f64>, Vec<f64>) = results.iter().map(value).unzip();
    standard_deviation(&values) / rms(&stated)
}

/// How far the surface of a part that lies at `part` stands out at a planned point, where it is flat: to first order.
fn off(part: &Isometry3<f64>, p: Vector3<f64>, n: Vector3<f64>) -> f64 {
    let normal = part.rotation * n;
    let through = part * Point3::from(p);
    (through.coords - p).dot(&normal) / n.dot(&normal)
}

#[test]
fn a_touch_that_the_others_contradict_is_left_out_and_named() {
    let features = [bore("bore", Vector3::zeros(), 10)];
    let plan = plan(&features);
    let chip = |index: usize, _, _| match index {
        3 => 200e-6,
        one => [1e-6, -1e-6, 0.5e-6][one % 3],
    };
    let without = config(|raw| raw.fits = vec![fitted("bore", Criterion::LeastSquares, Some(6.0))]);
    // Point 7 is touched twice more, and once of these something lay between.
    let again = (0..20).chain([7, 7]);
    let mut touches = 0;
    let knocked = |index: usize, p, n| {
        touches += 1;
        if touches == 22 {
            90e-6
        } else {
            chip(index, p, n)
        }
    };
    let said = measured(&without, &plan, again, knocked);
    let result = results(&said).pop().expect("a result");
    assert_eq!(result.left_out, [3, 21]);
    assert_eq!((result.touches, result.sequences.len()), (20, 20));
    assert_eq!(
        result.text,
        "outliers left out: point 3, point 7 1 of 3 times"
    );
    assert!((result.size - 20e-3).abs() < 2e-6, "{}", result.size);
    assert!(result.repeat_spread < 1e-9);

    let all = config(|_| {});
    let result = &results(&measured(&all, &plan, 0..20, chip))[0];
    assert!(result.left_out.is_empty() && result.form > 150e-6);
    let zone =
        config(|raw| raw.fits = vec![fitted("bore", Criterion::MaximumInscribed, Some(6.0))]);
    let result = &results(&measured(&zone, &plan, 0..20, chip))[0];
    assert_eq!(result.left_out, [3], "{}", result.text);
    assert!((result.size - 20e-3).abs() < 4e-6, "{}", result.size);
}

/// A block with three planes, a bore and a ball, clamped off its place.
fn block() -> Vec<Nominal> {
    vec![
        plane("A", Vector3::new(0.0, 0.0, 20e-3), Vector3::z()),
        plane("B", Vector3::new(0.0, -30e-3, 0.0), -Vector3::y()),
        plane("C", Vector3::new(35e-3, 0.0, 0.0), Vector3::x()),
        bore("bore", Vector3::new(10e-3, 5e-3, 0.0), 10),
        ball("ball", Vector3::new(-10e-3, 40e-3, 30e-3)),
    ]
}

fn aligned_by(datums: &[&str], best_fit: &[&str]) -> impl FnOnce(&mut RawConfig) {
    let own = |ids: &[&str]| ids.iter().map(|id| (*id).to_owned()).collect();
    let alignment = RawAlignment {
        datums: own(datums),
        best_fit: own(best_fit),
        free: ["x", "y", "z", "a", "b", "c"].map(str::to_owned).into(),
    };
    |raw| raw.alignment = Some(alignment)
}

#[test]
fn an_aligned_part_is_told_where_it_lies_and_its_features_in_its_own_frame() {
    let plan = plan(&block());
    let (shift, rotation) = (
        Vector3::new(80e-6, -50e-6, 30e-6),
        Vector3::new(2e-4, -3e-4, 5e-4),
    );
    let part = Isometry3::from_parts(shift.into(), UnitQuaternion::from_scaled_axis(rotation));
    let touch = |_: usize, p, n| off(&part, p, n);
    let raw_result = &results(&measured(
        &config(|_| {}),
        &plan,
        0..plan.points.len(),
        touch,
    ))[3];
    assert!(raw_result.position > 80e-6 && raw_result.aligned_to.is_empty());
    for (datums, best_fit) in [(vec!["A", "B", "C"], vec![]), (vec![], vec!["A", "B", "C"])] {
        let config = config(aligned_by(&datums, &best_fit));
        // The datums are touched last: nothing is told before.
        let order = (0..plan.points.len()).rev();
        let said = measured(&config, &plan, order, touch);
        let placed = &alignments(&said)[0];
        assert!(
            placed.valid && placed.sequences.len() == 27,
            "{}",
            placed.text
        );
        let found = [&placed.shift, &placed.rotation].map(|v| Vector3::new(v.x, v.y, v.z));
        // To second order in the rotation.
        assert!((found[0] - shift).norm() < 0.1e-6, "{:?}", found[0]);
        assert!((found[1] - rotation).norm() < 0.5e-6, "{:?}", found[1]);
        let results = results(&said);
        assert_eq!(results.len(), 5);
        for result in &results {
            let id = &result.feature_id;
            assert_eq!(result.aligned_to, ["A", "B", "C"], "{id}");
            assert!(result.position < 0.2e-6, "{id}: {:e}", result.position);
            assert!(result.orientation < 1e-6, "{id}: {:e}", result.orientation);
        }
    }
}

/// The part may have been clamped again: the bore waits for the datums of its own plan.
#[test]
fn a_new_plan_forgets_where_the_part_lay() {
    let plan = plan(&block());
    let config = config(aligned_by(&["A", "B", "C"], &[]));
    let mut state = AnalysisNode::start(&config);
    let exact = |_: usize, _, _| 0.0;
    let all = measured_next(&config, &mut state, &plan, 0..plan.points.len(), exact);
    assert_eq!(results(&all).len(), 5);
    let bore = measured_next(&config, &mut state, &plan, 27..47, exact);
    assert!(results(&bore).is_empty());
}

#[test]
fn the_uncertainty_of_an_alignment_is_its_scatter_and_goes_on_into_what_is_aligned() {
    let plan = plan(&block());
    let mut random = Pcg64::seed_from_u64(6);
    let mut draw = |standard: f64| -> f64 {
        let unit: f64 = StandardNormal.sample(&mut random);
        unit * standard
    };
    for (datums, best_fit) in [(vec!["A", "B", "C"], vec![]), (vec![], vec!["A", "B", "C"])] {
        let alignment = aligned_by(&datums, &best_fit);
        let config = config(|raw| {
            alignment(raw);
            raw.common_standard_uncertainty_um = 2.0;
        });
        let (mut values, mut stated) = (vec![Vec::new(); 7], vec![Vec::new(); 7]);
        for _ in 0..200 {
            let shared = draw(config.common_uncertainty);
            // The part lies well, and the ball far off along x, so that its position has a direction.
            let touch = |index: usize, _: Vector3<f64>, n: Vector3<f64>| {
                let lies = if index >= 47 { n.x * 100e-6 } else { 0.0 };
                lies + shared + draw(NOISE)
            };
            let said = measured(&config, &plan, 0..plan.points.len(), touch);
            let placed = &alignments(&said)[0];
            let [s, r] = [&placed.shift, &placed.rotation];
            for (which, value) in [s.x, s.y, s.z, r.x, r.y, r.z].into_iter().enumerate() {
                values[which].push(value);
                stated[which].push(placed.covariance[7 * which]);
            }
            let ball = results(&said).pop().expect("the ball");
            values[6].push(ball.position);
            stated[6].push(ball.position_uncertainty.powi(2));
        }
        for (which, (values, stated)) in values.iter().zip(&stated).enumerate() {
            let count = values.len() as f64;
            let mean = values.iter().sum::<f64>() / count;
            let squares = values.iter().map(|one| (one - mean).powi(2)).sum::<f64>();
            let scatter = (squares / (count - 1.0)).sqrt();
            let ratio = scatter / (stated.iter().sum::<f64>() / count).sqrt();
            assert!((ratio - 1.0).abs() < 0.2, "{which}: {ratio:.3}");
        }
    }
}

/// What the alignment adds depends on how the feature lies to the datums.
#[test]
fn the_uncertainty_of_a_position_does_not_depend_on_where_the_part_has_its_origin() {
    let config = config(aligned_by(&["A", "B", "C"], &[]));
    let stated = |by: Vector3<f64>| {
        let mut features = block();
        for one in &mut features {
            let at = &one.feature.origin;
            one.feature.origin = ros_point(Vector3::new(at.x, at.y, at.z) + by);
            one.touches.iter_mut().for_each(|(place, _)| *place += by);
        }
        let plan = plan(&features);
        let touch = |index: usize, _, n: Vector3<f64>| if index >= 47 { n.x * 1e-4 } else { 0.0 };
        let said = measured(&config, &plan, 0..plan.points.len(), touch);
        results(&said).pop().expect("the ball").position_uncertainty
    };
    let here = stated(Vector3::zeros());
    let there = stated(Vector3::new(100e-3, -50e-3, 80e-3));
    assert!((here - there).abs() < 0.01 * here, "{here:e} {there:e}");
}

#[test]
fn a_part_that_cannot_be_placed_has_no_sizes_and_says_why() {
    let plan = plan(&block());
    let exact = |_: usize, _, _| 0.0;
    for (datums, why) in [
        (
            vec!["A"],
            "no datum fixes the rotation about the primary direction",
        ),
        (
            vec!["ball", "A"],
            "the primary datum is a point and gives no direction",
        ),
    ] {
        let config = config(aligned_by(&datums, &[]));
        let said = measured(&config, &plan, 0..plan.points.len(), exact);
        let placed = alignments(&said).pop().expect("said");
        assert!(
            !placed.valid && placed.text.contains(why),
            "{}",
            placed.text
        );
        for result in results(&said) {
            assert_eq!(result.decision, FeatureResult::INVALID);
            let told = format!("the part could not be aligned: {}", placed.text);
            assert_eq!(result.text, told);
        }
    }
    let bores = config(aligned_by(&[], &["bore"]));
    let said = measured(&bores, &plan, 0..plan.points.len(), exact);
    let placed = alignments(&said).pop().expect("said");
    assert!(
        placed.text.contains("leave 2 displacements"),
        "{}",
        placed.text
    );
}

#[test]
fn settings_that_mean_nothing_are_refused() {
    let chain = || Chain::from_urdf(ROBOT).expect("a chain");
    let refused = |edit: &dyn Fn(&mut RawConfig), says: &str| {
        let mut raw = RawConfig::default();
        edit(&mut raw);
        let error = raw.check(chain()).expect_err("refused").to_string();
        assert!(error.contains(says), "{error}");
    };
    let fit = |limit| fitted("D", Criterion::LeastSquares, Some(limit));
    refused(
        &|raw| raw.fits = vec![fit(2.0)],
        "analysis.fits.D.outlier_limit = 2",
    );
    refused(&|raw| raw.fits = vec![fit(f64::NAN)], "outlier_limit = NaN");
    refused(
        &|raw| raw.fits = vec![fit(6.0), fit(6.0)],
        "\"D\" is listed twice",
    );
    let alignment = |datums: &[&str], best_fit: &[&str], free: &[&str]| {
        let own = |ids: &[&str]| ids.iter().map(|id| (*id).to_owned()).collect();
        Some(RawAlignment {
            datums: own(datums),
            best_fit: own(best_fit),
            free: own(free),
        })
    };
    refused(
        &|raw| raw.alignment = alignment(&[], &[], &["x"]),
        "either datums or best_fit",
    );
    refused(
        &|raw| raw.alignment = alignment(&["A"], &["B"], &["x"]),
        "either datums or best_fit",
    );
    refused(
        &|raw| raw.alignment = alignment(&[], &["B"], &["w"]),
        "\"w\" is none of x, y, z",
    );
    refused(
        &|raw| raw.alignment = alignment(&["A"], &[], &["x"]),
        "free belongs to best_fit",
    );
}
