//! The model of distances against an independent walk along moves in small steps, which asks for points on the skin of
//! the stylus whether they lie inside a body: it knows no distances and no halving, so it shares no mistake with it.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use machine::geometry::{Body, Contact, Stylus, StylusPose, Surroundings, bodies, passes};
use machine::{Access, Chain, Nominal, TouchPose};
use nalgebra::{Point3, Unit, Vector3};
use probecell_msgs::{InspectionFeature, InspectionPlan, InspectionPoint, geometry_msgs};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::{RngCore, SeedableRng};

/// m; a ball of 6 mm on a stem of 50 mm, and as much of a probe body of 40 mm across.
const BALL: f64 = 0.003;
const LENGTH: f64 = 0.1;
const STEM: f64 = 0.7 * BALL;
const PROBE: f64 = 0.02;
/// m; steps of the walk, and the spacing of points on the skin.
const STEP: f64 = 0.003;

/// Ball, stem and probe body by ends along the stem and radius, m; without the body the stem is as long as both.
fn shafts(with_probe: bool) -> Vec<(f64, f64, f64)> {
    if with_probe {
        vec![(0.0, 0.0, BALL), (0.0, 0.05, STEM), (0.05, LENGTH, PROBE)]
    } else {
        vec![(0.0, 0.0, BALL), (0.0, LENGTH, STEM)]
    }
}

fn contains(body: &Body, point: &Point3<f64>) -> bool {
    let polar = |(origin, axis): &(Point3<f64>, Unit<Vector3<f64>>)| {
        let arm = point - origin;
        (arm.dot(axis), arm.cross(axis).norm())
    };
    match body {
        Body::Block { faces, bores } => {
            faces
                .iter()
                .all(|(n, offset)| n.dot(&point.coords) < *offset)
                && bores.iter().all(|(line, radius)| polar(line).1 > *radius)
        }
        Body::Round {
            axis,
            heights,
            radii,
        } => {
            let (height, radius) = polar(axis);
            heights[0] < height && height < heights[1] && radii[0] < radius && radius < radii[1]
        }
        Body::Ball { centre, radius } => (point - centre).norm_squared() < radius * radius,
    }
}

/// Points on the axis and in rings around it, of shafts with round ends; `thinner` (m) than they are.
fn skin([ball, mount]: &StylusPose, shafts: &[(f64, f64, f64)], thinner: f64) -> Vec<Point3<f64>> {
    let stem = (mount - ball).normalize();
    let across = if stem.x.abs() < 0.6 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let u = stem.cross(&across).normalize();
    let v = stem.cross(&u);
    let mut points = Vec::new();
    let mut ring = |height: f64, radius: f64| {
        let spokes = (TAU * radius / STEP).ceil().clamp(8.0, 64.0) as u32;
        points.push(ball + stem * height);
        for spoke in 0..spokes {
            let (sine, cosine) = (TAU * f64::from(spoke) / f64::from(spokes)).sin_cos();
            points.push(ball + stem * height + (u * cosine + v * sine) * radius);
        }
    };
    for &(from, to, radius) in shafts {
        let radius = radius - thinner;
        for latitude in 0..=6 {
            let (sine, cosine) = (0.25 * TAU * f64::from(latitude) / 6.0).sin_cos();
            ring(from - radius * sine, radius * cosine);
            ring(to + radius * sine, radius * cosine);
        }
        let rings = ((to - from) / STEP).ceil().max(1.0) as u32;
        for at in 0..=rings {
            ring(
                from + (to - from) * f64::from(at) / f64::from(rings),
                radius,
            );
        }
    }
    points
}

/// True when a point of the skin is inside a body at one of these poses.
fn hits(
    poses: impl IntoIterator<Item = StylusPose>,
    shafts: &[(f64, f64, f64)],
    bodies: &[Body],
    thinner: f64,
) -> bool {
    poses.into_iter().any(|pose| {
        let skin = skin(&pose, shafts, thinner);
        bodies
            .iter()
            .any(|body| skin.iter().any(|point| contains(body, point)))
    })
}

/// Poses on a straight line, in small steps.
fn along(from: &StylusPose, to: &StylusPose) -> Vec<StylusPose> {
    let steps = ((from[0] - to[0]).norm() / STEP).ceil().max(1.0) as u32;
    (0..=steps)
        .map(|at| [0, 1].map(|i| from[i] + (to[i] - from[i]) * (f64::from(at) / f64::from(steps))))
        .collect()
}

fn nominal() -> Nominal {
    let mut plan = InspectionPlan::default();
    plan.part_pose.orientation.w = 1.0;
    plan.stylus.ball_center.z = -LENGTH;
    plan.stylus.ball_radius = BALL;
    Nominal::from_plan(&plan).unwrap()
}

/// Random legs past random bodies: what the model calls clear, the walk does not call a hit; what it calls a hit by more
/// than the steps of the walk, the walk finds.
#[test]
fn two_methods_agree_on_random_legs() {
    let mut rng = Pcg32::seed_from_u64(5);
    let mut uniform =
        |low: f64, high: f64| low + (high - low) * f64::from(rng.next_u32()) / 4_294_967_296.0;
    let nominal = nominal();
    let (mut free, mut hit) = (0, 0);
    for round in 0..320 {
        let mut vector = |size: f64| Vector3::from([0; 3].map(|_| uniform(-size, size)));
        let [from, way, centre] = [vector(0.08), vector(0.12), vector(0.03)];
        let [stem, axis] = [0; 2].map(|_| Unit::new_normalize(vector(1.0)));
        let (from, centre) = (Point3::from(from), Point3::from(centre));
        let body = match round % 4 {
            0 => Body::Ball {
                centre,
                radius: 0.04,
            },
            1 => Body::Round {
                axis: (centre, axis),
                heights: [-0.03, 0.05],
                radii: [0.0, 0.03],
            },
            2 => Body::Round {
                axis: (centre, axis),
                heights: [-0.04, 0.04],
                radii: [0.03, 0.045],
            },
            _ => Body::Block {
                faces: [
                    (Vector3::x(), 0.03),
                    (-Vector3::x(), 0.03),
                    (Vector3::y(), 0.03),
                    (-Vector3::y(), 0.03),
                    (-Vector3::z(), 0.03),
                    (Vector3::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2), 0.02),
                ]
                .map(|(normal, offset)| (normal, offset + normal.dot(&centre.coords)))
                .to_vec(),
                bores: vec![((centre, axis), 0.015)],
            },
        };
        let with_probe = round % 8 < 4;
        let stylus = if with_probe {
            Stylus::with_probe(&nominal).unwrap()
        } else {
            Stylus::with_stem(&nominal)
        };
        let pose = [from, from + stem.into_inner() * LENGTH];
        let ends = [pose, pose.map(|point| point + way)];
        let body = std::slice::from_ref(&body);
        let clear_by = |least: f64| passes(&stylus, body, &[least], [&ends[0], &ends[1]]);
        let walk = |thinner: f64| {
            hits(
                along(&ends[0], &ends[1]),
                &shafts(with_probe),
                body,
                thinner,
            )
        };
        if clear_by(0.0) {
            assert!(!walk(1e-5), "{body:?} {ends:?}");
            free += 1;
        } else if !clear_by(-STEP) && !matches!(body[0], Body::Block { .. }) {
            // Beside the edges of a block its distance is a lower bound only.
            assert!(walk(0.0), "{body:?} {ends:?}");
            hit += 1;
        }
    }
    assert!(free > 60 && hit > 60, "{free} free and {hit} hit");
}

/// Three linear axes; the stylus hangs below the mount.
const MACHINE: &str = r#"<robot name="xyz"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
<link name="a"/><link name="b"/>
<joint name="f" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
<joint name="X" type="prismatic"><parent link="foundation"/><child link="a"/><axis xyz="1 0 0"/>
  <limit lower="-1" upper="1" effort="0" velocity="0.5"/></joint>
<joint name="Y" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" effort="0" velocity="0.5"/></joint>
<joint name="Z" type="prismatic"><parent link="b"/><child link="probe_mount"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="0" velocity="0.5"/></joint></robot>"#;

/// A plate with a flank, a boss of 15 mm radius and 30 mm height, a bore of 12 mm radius, and a ball.
fn plan() -> InspectionPlan {
    let mut plan = InspectionPlan::default();
    plan.part_pose.orientation.w = 1.0;
    plan.stylus.ball_center.z = -LENGTH;
    plan.stylus.ball_radius = BALL;
    let kinds = [
        (InspectionFeature::PLANE, Vector3::z(), 0.0, [0.0; 3]),
        (InspectionFeature::PLANE, Vector3::x(), 0.0, [0.1, 0.0, 0.0]),
        (
            InspectionFeature::CYLINDER,
            Vector3::z(),
            0.015,
            [0.04, 0.0, 0.0],
        ),
        (
            InspectionFeature::BORE,
            Vector3::z(),
            0.012,
            [-0.04, 0.0, 0.0],
        ),
        (
            InspectionFeature::SPHERE,
            Vector3::z(),
            0.01,
            [0.0, 0.05, 0.02],
        ),
    ];
    for (kind, axis, radius, [x, y, z]) in kinds {
        plan.features.push(InspectionFeature {
            kind,
            radius,
            origin: geometry_msgs::Point { x, y, z },
            axis: geometry_msgs::Vector3 {
                x: axis.x,
                y: axis.y,
                z: axis.z,
            },
            ..InspectionFeature::default()
        });
    }
    let mut touch = |feature: u32, [x, y, z]: [f64; 3], normal: Vector3<f64>| {
        plan.points.push(InspectionPoint {
            feature,
            position: geometry_msgs::Point { x, y, z },
            normal: geometry_msgs::Vector3 {
                x: normal.x,
                y: normal.y,
                z: normal.z,
            },
            approach_distance: 0.005,
            retract_distance: 0.005,
            feed: 5e-3,
            ..InspectionPoint::default()
        });
    };
    for [x, y] in [[-0.09, -0.07], [0.09, 0.07], [-0.09, 0.07], [0.08, -0.07]] {
        touch(0, [x, y, 0.0], Vector3::z());
    }
    for y in [-0.05, 0.05] {
        touch(1, [0.1, y, -0.01], Vector3::x());
    }
    for turn in 0..4 {
        let (sine, cosine) = (0.25 * TAU * f64::from(turn)).sin_cos();
        let out = Vector3::new(cosine, sine, 0.0);
        for height in [0.008, 0.03] {
            touch(2, [0.04 + 0.015 * cosine, 0.015 * sine, height], out);
        }
        for height in [-0.015, -0.004] {
            touch(3, [-0.04 + 0.012 * cosine, 0.012 * sine, height], -out);
        }
    }
    touch(4, [0.0, 0.05, 0.03], Vector3::z());
    plan
}

#[test]
fn moves_of_axes_that_are_called_clear_hit_nothing_and_others_do() {
    let (chain, plan) = (Chain::from_urdf(MACHINE).unwrap(), plan());
    let nominal = Nominal::from_plan(&plan).unwrap();
    let around = Surroundings::new(&chain, &plan, &nominal);
    let bodies = bodies(&Contact::of_plan(&plan, &nominal), 0.0, BALL);
    // Over, beside and in between: the mount is as high over the plate as the stylus is long, and a little more.
    let mut stations: Vec<Vec<f64>> = Vec::new();
    for [x, y] in [
        [-0.09, -0.07],
        [0.09, 0.07],
        [0.0, -0.06],
        [-0.04, 0.0],
        [0.04, 0.04],
        [0.12, 0.0],
    ] {
        for height in [0.009, 0.02, 0.045] {
            stations.push(vec![x, y, LENGTH + height]);
        }
    }
    let pose = |at: &[f64]| {
        let mount = Point3::new(at[0], at[1], at[2]);
        [mount - Vector3::z() * LENGTH, mount]
    };
    let (mut free, mut caught) = (0, 0);
    for from in &stations {
        for to in &stations {
            let ends = [from, to].map(|at| around.clearances(at));
            let walk =
                |bodies: &[Body]| hits(along(&pose(from), &pose(to)), &shafts(false), bodies, 1e-5);
            if around.is_clear(from, std::slice::from_ref(to), [&ends[0], &ends[1]]) {
                assert!(!walk(&bodies), "{from:?} to {to:?}");
                free += 1;
            } else {
                caught += usize::from(walk(&bodies));
            }
        }
    }
    assert!(free > 50 && caught > 20, "{free} free, {caught} hit");
}

#[test]
fn touches_that_are_allowed_can_be_made_and_others_are_refused() {
    let (chain, plan) = (Chain::from_urdf(MACHINE).unwrap(), plan());
    let nominal = Nominal::from_plan(&plan).unwrap();
    let touch = |feature: usize, position: Point3<f64>, normal: Vector3<f64>| {
        let mount = position + normal * BALL + Vector3::z() * LENGTH;
        let same = plan
            .points
            .iter()
            .position(|point| point.feature as usize == feature);
        TouchPose {
            feature,
            position,
            normal,
            surface: nominal.surfaces[same.unwrap()],
            positions: Some(vec![mount.x, mount.y, mount.z]),
        }
    };
    let measured: Vec<TouchPose> = nominal
        .points
        .iter()
        .zip(&plan.points)
        .map(|((position, normal), point)| touch(point.feature as usize, *position, **normal))
        .collect();
    let access = Access::new(&chain, &nominal, &plan, &measured);
    let bodies = bodies(&Contact::of_plan(&plan, &nominal), 0.0, BALL);
    let mut allowed = 0;
    for x in -10..=10 {
        for y in -7..=7 {
            let position = Point3::new(0.01 * f64::from(x), 0.01 * f64::from(y), 0.0);
            let proposed = touch(0, position, Vector3::z());
            let contact = position + Vector3::z() * BALL;
            let at = [contact, contact + Vector3::z() * LENGTH];
            let withdrawn = at.map(|point| point + Vector3::z() * 0.2);
            let hit = hits(along(&at, &withdrawn), &shafts(true), &bodies, 1e-5);
            if access.allows(&proposed) {
                assert!(!hit, "{position:?}");
                allowed += 1;
            } else {
                assert!(hit, "{position:?} can be touched");
            }
        }
    }
    // Of 315, those under the boss and under the ball are refused.
    assert_eq!(allowed, 301);
    // The underside of the ball is out of reach of a stylus from above; without axis positions it is no touch.
    let below = Vector3::new(0.8, 0.0, -0.6);
    assert!(!access.allows(&touch(4, Point3::new(0.008, 0.05, 0.014), below)));
    let mut unknown = touch(0, Point3::origin(), Vector3::z());
    unknown.positions = None;
    assert!(!access.allows(&unknown));
}

#[test]
fn soft_limits_are_checked_before_the_first_move() {
    use machine::check_travel;
    let limits = [(-0.5, 0.5), (0.0, 3.0)];
    assert_eq!(
        check_travel(&[vec![0.5, 0.0], vec![-0.5, 3.0]], &limits),
        Ok(())
    );
    let error = check_travel(&[vec![0.0, 0.0], vec![0.6, 0.0]], &limits).unwrap_err();
    assert_eq!((error.index, error.axis, error.target), (1, 0, 0.6));
    assert_eq!(
        error.to_string(),
        "move 1 takes axis 0 to 0.6, outside its limits -0.5 to 0.5 (m or rad)"
    );
    assert!(check_travel(&[vec![0.0]], &limits).is_err());
    assert!(check_travel(&[vec![f64::NAN, 0.0]], &limits).is_err());
}
