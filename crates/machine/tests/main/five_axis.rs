//! The chain against `docs/source_systems.md, D`: closed-form Jacobian (D.2) and sensitivity table (D.3).

use machine::{Chain, ChainErrors, Side, Target};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

/// WCBXFZYSt with {F} at the B-C intersection; axis values 0 put the ball there.
use machine::models::WCBXFZYST;

/// The eight errors of D.2: joint and component (X Y Z A B C = 0..5).
const ERRORS: [(&str, usize); 8] = [
    ("B", 3),
    ("B", 5),
    ("C", 0),
    ("C", 3),
    ("C", 4),
    ("Z", 4),
    ("Y", 3),
    ("Y", 5),
];

fn joint(chain: &Chain, name: &str) -> usize {
    chain
        .joints()
        .iter()
        .position(|joint| joint.name == name)
        .unwrap()
}

/// Axis positions that bring the ball to `p` at indices (b, c): x = −rx, y = ry, z = rz with r = Ry(b) Rz(c) p.
fn pose(chain: &Chain, p: Vector3<f64>, b: f64, c: f64) -> (Vec<f64>, Vector3<f64>) {
    let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), b)
        * nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), c);
    let r = turn * p;
    let names = ["X", "B", "C", "Z", "Y", "S"].map(String::from);
    (
        chain
            .positions(&names, &[-r.x, b, c, r.z, r.y, 0.0])
            .unwrap(),
        r,
    )
}

/// D.2, tool frame, tool minus feature.
pub(crate) fn closed_form(r: Vector3<f64>, b: f64) -> [Vector3<f64>; 8] {
    let (s, k) = b.sin_cos();
    [
        Vector3::new(0.0, r.z, -r.y),
        Vector3::new(r.y, -r.x, 0.0),
        Vector3::new(-k, 0.0, s),
        Vector3::new(-s * r.y, s * r.x + k * r.z, -k * r.y),
        Vector3::new(-r.z, 0.0, r.x),
        Vector3::new(r.z, 0.0, 0.0),
        Vector3::new(0.0, 0.0, r.y),
        Vector3::new(-r.y, 0.0, 0.0),
    ]
}

#[test]
fn jacobian_equals_the_closed_form_of_the_specification() {
    let chain = Chain::from_urdf(WCBXFZYST).unwrap();
    for (b, c) in [(0.0, 0.0), (0.4, -1.1), (-1.3, 2.5), (1.57, 4.0)] {
        let p = Vector3::new(0.05, -0.03, 0.15);
        let (positions, r) = pose(&chain, p, b, c);
        let sensitivity = chain.sensitivity(&positions, &Isometry3::identity(), &Point3::origin());
        assert!((sensitivity.ball.coords - p).norm() < 1e-15);
        let part_from_foundation = Matrix3::from_columns(&sensitivity.foundation);
        for ((name, component), expected) in ERRORS.iter().zip(closed_form(r, b)) {
            let got = sensitivity.location[joint(&chain, name)][*component];
            assert!(
                (got - part_from_foundation * expected).norm() < 1e-15,
                "E{component} {name} at b {b} c {c}"
            );
        }
    }
}

#[test]
fn mismatch_sensitivities_equal_the_table_of_the_specification() {
    let chain = Chain::from_urdf(WCBXFZYST).unwrap();
    let degree = std::f64::consts::PI / 180.0;
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    // p (mm), index 1, index 2, directions a and b, rows a and b (µm for +50 µrad each, EX0C +20 µm).
    let table = [
        (
            (50., 50., 150.),
            (0., 0.),
            (0., 180.),
            z,
            y,
            [5., 0., 0., 5., -5., 0., -5., 0.],
            [-15., 0., 0., -15., 0., 0., 0., 0.],
        ),
        (
            (-50., 50., 150.),
            (0., 0.),
            (0., 90.),
            z,
            x,
            [5., 0., 0., 5., 0., 0., -5., 0.],
            [7.5, 0., 20., 7.5, 7.5, -7.5, 0., 2.5],
        ),
        (
            (50., -50., 150.),
            (0., 90.),
            (0., 180.),
            z,
            x,
            [0., 0., 0., 0., -5., 0., 0., 0.],
            [-7.5, 0., 20., -7.5, 7.5, -7.5, 0., 2.5],
        ),
        (
            (40., 60., 130.),
            (90., 90.),
            (-90., 270.),
            y,
            x,
            [4., 0., -40., 0., -13., 0., -4., 0.],
            [-6., 0., 0., -13., 0., 0., 0., 0.],
        ),
        (
            (-60., -40., 90.),
            (90., 0.),
            (-90., 180.),
            -x,
            z,
            [-4., 0., -40., 0., -9., 0., 4., 0.],
            [0., 0., 0., -4., 6., -6., 0., 0.],
        ),
        (
            (-60., 40., 150.),
            (-90., 180.),
            (0., 180.),
            -x,
            z,
            [-2., -2., 0., 0., 0., 7.5, 2., 2.],
            [2., -2., 0., 0., 0., 3., -2., 2.],
        ),
        (
            (-60., 60., 110.),
            (-90., 270.),
            (90., 0.),
            y,
            -x,
            [6., -5.5, 20., 5.5, 5.5, 0., -3., 0.],
            [-6., -5.5, 20., -5.5, 5.5, 0., 3., 0.],
        ),
    ];
    let mut rows = Vec::new();
    for (p, first, second, a, b, row_a, row_b) in table {
        let p = Vector3::new(p.0, p.1, p.2) * 1e-3;
        for (direction, expected) in [(a, row_a), (b, row_b)] {
            let mut row = [0.0; 8];
            for (sign, index) in [(-1.0, first), (1.0, second)] {
                let (positions, _) = pose(&chain, p, index.0 * degree, index.1 * degree);
                let sensitivity =
                    chain.sensitivity(&positions, &Isometry3::identity(), &Point3::origin());
                for (value, (name, component)) in row.iter_mut().zip(ERRORS) {
                    let size = if component == 0 { 20.0 } else { 50.0 };
                    *value += sign
                        * size
                        * direction.dot(&sensitivity.location[joint(&chain, name)][component]);
                }
            }
            for (got, expected) in row.iter().zip(expected) {
                assert!(
                    (got - expected).abs() < 1e-6,
                    "got {row:?}, table {expected}"
                );
            }
            rows.push(row);
        }
    }
    let matrix = nalgebra::DMatrix::from_fn(14, 8, |row, column| rows[row][column]);
    assert_eq!(matrix.rank(1e-6), 8);
}

#[test]
fn derivatives_agree_with_finite_errors() {
    let chain = Chain::from_urdf(WCBXFZYST).unwrap();
    let part = Isometry3::new(
        Vector3::new(0.01, -0.02, 0.05),
        Vector3::new(0.1, 0.2, -0.3),
    );
    let ball = Point3::new(0.001, -0.002, -0.15);
    let positions = [0.1, 0.7, -1.2, 0.05, -0.04, 0.9];
    let sensitivity = chain.sensitivity(&positions, &part, &ball);
    let step = 1e-6;
    let central = |set: &dyn Fn(&mut ChainErrors, f64)| {
        let at = |size| {
            let mut errors = ChainErrors::none(chain.joints().len());
            set(&mut errors, size);
            chain.ball_in_part_with(&positions, &part, &ball, &errors)
        };
        (at(step) - at(-step)) / (2.0 * step)
    };
    for component in 0..6 {
        for joint in 0..chain.joints().len() {
            let location = central(&|errors, size| errors.location[joint][component] = size);
            assert!((location - sensitivity.location[joint][component]).norm() < 1e-9);
            let motion = central(&|errors, size| errors.motion[joint][component] = size);
            assert!((motion - sensitivity.motion[joint][component]).norm() < 1e-9);
        }
        let moved = central(&|errors, size| errors.part[component] = size);
        assert!((moved - sensitivity.part[component]).norm() < 1e-9);
    }
    for axis in 0..positions.len() {
        let at = |size: f64| {
            let mut moved = positions;
            moved[axis] += size;
            chain.ball_in_part(&moved, &part, &ball)
        };
        assert!(((at(step) - at(-step)) / (2.0 * step) - sensitivity.axes[axis]).norm() < 1e-9);
    }
    for component in 0..3 {
        let moved = central(&|errors, size| errors.ball[component] = size);
        assert!((moved - sensitivity.mount[component]).norm() < 1e-9);
    }
}

#[test]
fn linear_axes_are_found_for_prescribed_rotary_axes() {
    let chain = Chain::from_urdf(WCBXFZYST).unwrap();
    let part = Isometry3::translation(0.0, 0.0, 0.05);
    let ball = Point3::new(0.0, 0.0, -0.15);
    let wanted = Point3::new(0.03, -0.05, 0.09);
    let prescribed: Vec<_> = chain
        .axis_names()
        .map(|name| match name {
            "B" => Some(0.6),
            "C" => Some(2.0),
            "S" => Some(0.0),
            _ => None,
        })
        .collect();
    let target = Target {
        ball: wanted,
        orientation: None,
    };
    let found = chain
        .reach(&target, &prescribed, &[0.0; 6], &part, &ball)
        .unwrap();
    assert!((chain.ball_in_part(&found, &part, &ball) - wanted).norm() < 1e-9);
    let far = Target {
        ball: Point3::new(0.0, 0.0, 2.0),
        orientation: None,
    };
    let error = chain
        .reach(&far, &prescribed, &[0.0; 6], &part, &ball)
        .unwrap_err();
    assert!(error.to_string().contains("end of travel"), "{error}");
}

#[test]
fn an_arm_reaches_a_point_with_a_prescribed_orientation() {
    let chain = Chain::from_urdf(ARM).unwrap();
    let part = Isometry3::translation(0.5, 0.1, 0.2);
    let ball = Point3::new(0.0, 0.0, 0.1);
    let there = [0.3, -0.9, 1.4, 0.2, 0.8, -0.4];
    let mount = chain.part_from_mount(&there, &part);
    let target = Target {
        ball: mount * ball,
        orientation: Some(mount.rotation),
    };
    let start = [0.1, -0.7, 1.2, 0.0, 0.6, 0.0];
    let found = chain
        .reach(&target, &[None; 6], &start, &part, &ball)
        .unwrap();
    let reached = chain.part_from_mount(&found, &part);
    assert!((reached * ball - target.ball).norm() < 1e-9);
    assert!(reached.rotation.angle_to(&mount.rotation) < 1e-7);
    assert!(
        chain
            .branch(Side::Part)
            .iter()
            .all(|&index| !chain.joints()[index].moves())
    );
}

const ARM: &str = r#"<robot name="arm">
  <link name="foundation"/><link name="workpiece"/><link name="l1"/><link name="l2"/><link name="l3"/>
  <link name="l4"/><link name="l5"/><link name="probe_mount"/>
  <joint name="table" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
  <joint name="A1" type="revolute"><parent link="foundation"/><child link="l1"/><origin xyz="0 0 0.3"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="0" velocity="1"/></joint>
  <joint name="A2" type="revolute"><parent link="l1"/><child link="l2"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="0" velocity="1"/></joint>
  <joint name="A3" type="revolute"><parent link="l2"/><child link="l3"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="0" velocity="1"/></joint>
  <joint name="A4" type="revolute"><parent link="l3"/><child link="l4"/><origin xyz="0 0 0.2"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="0" velocity="1"/></joint>
  <joint name="A5" type="revolute"><parent link="l4"/><child link="l5"/><origin xyz="0 0 0.2"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="0" velocity="1"/></joint>
  <joint name="A6" type="revolute"><parent link="l5"/><child link="probe_mount"/><origin xyz="0 0 0.1"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="0" velocity="1"/></joint>
</robot>"#;
