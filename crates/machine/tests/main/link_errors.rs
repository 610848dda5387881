//! Link errors by name, their compensation (D.2) and the swivel head (E.4) against forms written out by hand.

use machine::{Chain, ChainErrors, HEAD_AXES, LinkError, SwivelHead, Volumetric};
use nalgebra::{Isometry3, Matrix4, Point3, Rotation3, Unit, Vector3, Vector4};

use machine::models::WCBXFZYST;
use machine::models::XFYZBA;

/// Case E1 of D.4.
const E1: [(&str, f64); 8] = [
    ("EA0B", 50e-6),
    ("EC0B", -50e-6),
    ("EX0C", 20e-6),
    ("EA0C", 50e-6),
    ("EB0C", -50e-6),
    ("EB0Z", 50e-6),
    ("EA0Y", -50e-6),
    ("EC0Y", 50e-6),
];

fn links(chain: &Chain, sizes: &[(&str, f64)]) -> ChainErrors {
    let links: Vec<LinkError> = sizes
        .iter()
        .map(|(name, value)| LinkError::named(chain, name, *value).unwrap())
        .collect();
    ChainErrors::of_links(chain, &links)
}

/// Positions of WCBXFZYSt that bring the tip to `r` = Ry(b) Rz(c) p.
fn positions(chain: &Chain, r: &Vector3<f64>, b: f64, c: f64) -> Vec<f64> {
    let names = ["X", "B", "C", "Z", "Y", "S"].map(String::from);
    chain
        .positions(&names, &[-r.x, b, c, r.z, r.y, 0.0])
        .unwrap()
}

fn turned(p: &Vector3<f64>, b: f64, c: f64) -> Vector3<f64> {
    Rotation3::from_axis_angle(&Vector3::y_axis(), b)
        * (Rotation3::from_axis_angle(&Vector3::z_axis(), c) * p)
}

/// D.2: tool minus feature in the tool frame, times the errors of E1.
fn closed_form(r: &Vector3<f64>, b: f64) -> Vector3<f64> {
    crate::five_axis::closed_form(*r, b)
        .iter()
        .zip(E1)
        .map(|(column, (_, size))| column * size)
        .sum()
}

#[test]
fn names_are_read_and_written_as_iso_230_has_them() {
    let chain = Chain::from_urdf(WCBXFZYST).unwrap();
    for (name, value) in E1 {
        let link = LinkError::named(&chain, name, value).unwrap();
        assert_eq!(link.name(&chain), name);
        assert_eq!(link.turns(), name != "EX0C");
    }
    for (name, said) in [
        ("EXX", "not a location error"),
        ("", "not a location error"),
        ("ED0B", "not a location error"),
        ("EA0A", "axis `A`"),
        ("EA0", "axis ``"),
    ] {
        let error = LinkError::named(&chain, name, 1e-6).unwrap_err();
        assert!(error.to_string().contains(said), "{error}");
    }
    assert!(LinkError::named(&chain, "EA0B", f64::NAN).is_err());
}

#[test]
fn first_order_compensation_is_that_of_the_specification_and_leaves_nanometres() {
    let chain = Chain::from_urdf(WCBXFZYST).unwrap();
    let errors = links(&chain, &E1);
    let (part, tip) = (Isometry3::identity(), Point3::origin());
    let volumetric = Volumetric::new(chain.clone(), part, tip, errors.clone()).unwrap();
    let mut worst = 0.0_f64;
    for (b, c) in [(0.0, 0.0), (0.7, -2.0), (-1.57, 3.1), (1.57, 1.5)] {
        for p in [
            Vector3::new(0.05, 0.05, 0.15),
            Vector3::new(-0.06, -0.04, 0.09),
        ] {
            let r = turned(&p, b, c);
            let wanted = positions(&chain, &r, b, c);
            let e = closed_form(&r, b);
            let found = volumetric.first_order(&wanted).unwrap();
            let at = |name| found.axes[chain.axis_index(name).unwrap()];
            // Δx = +e_x, Δy = −e_y, Δz = −e_z: x moves the part.
            assert!((at("X") - e.x).abs() < 1e-15);
            assert!((at("Y") + e.y).abs() < 1e-15);
            assert!((at("Z") + e.z).abs() < 1e-15);
            assert_eq!((at("B"), at("C"), at("S")), (0.0, 0.0, 0.0));
            let left = |correction: &[f64]| {
                let moved: Vec<f64> = wanted.iter().zip(correction).map(|(a, b)| a + b).collect();
                (chain.ball_in_part_with(&moved, &part, &tip, &errors).coords - p).norm()
            };
            assert!(left(&[0.0; 6]) > 5e-6, "the errors show without correction");
            worst = worst.max(left(&found.axes));
            let exact = volumetric.corrections(&wanted).unwrap();
            assert!(left(&exact.axes) < 1e-15 && exact.left.norm() < 1e-15);
        }
    }
    assert!(
        worst > 1e-10 && worst < 3e-9,
        "second order leaves {worst} m"
    );
}

#[test]
fn what_the_linear_axes_cannot_correct_is_told() {
    let lathe = Chain::from_urdf(
        r#"<robot name="lathe"><link name="foundation"/><link name="workpiece"/><link name="z"/><link name="probe_mount"/>
        <joint name="C" type="continuous"><parent link="foundation"/><child link="workpiece"/><axis xyz="0 0 1"/></joint>
        <joint name="Z" type="prismatic"><parent link="foundation"/><child link="z"/><axis xyz="0 0 1"/>
          <limit lower="-1" upper="1" effort="0" velocity="1"/></joint>
        <joint name="X" type="prismatic"><parent link="z"/><child link="probe_mount"/><axis xyz="1 0 0"/>
          <limit lower="-1" upper="1" effort="0" velocity="1"/></joint></robot>"#,
    )
    .unwrap();
    let errors = links(&lathe, &[("EX0X", 4e-6), ("EY0X", 3e-6)]);
    let volumetric = Volumetric::new(
        lathe.clone(),
        Isometry3::identity(),
        Point3::origin(),
        errors,
    )
    .unwrap();
    for found in [
        volumetric.first_order(&[0.0, 0.1, 0.2]).unwrap(),
        volumetric.corrections(&[0.0, 0.1, 0.2]).unwrap(),
    ] {
        assert!((found.axes[lathe.axis_index("X").unwrap()] + 4e-6).abs() < 1e-15);
        assert!((found.left - Vector3::new(0.0, 3e-6, 0.0)).norm() < 1e-15);
    }
    assert!(volumetric.corrections(&[0.0, f64::NAN, 0.0]).is_err());
    assert!(volumetric.first_order(&[0.0]).is_err());
    let none = ChainErrors::default();
    assert!(Volumetric::new(lathe, Isometry3::identity(), Point3::origin(), none).is_err());
}

fn shift(x: f64, y: f64, z: f64) -> Matrix4<f64> {
    Matrix4::new_translation(&Vector3::new(x, y, z))
}

fn turn(axis: Unit<Vector3<f64>>, angle: f64) -> Matrix4<f64> {
    Rotation3::from_axis_angle(&axis, angle).to_homogeneous()
}

/// Positions of XFYZBA in the order of the chain.
fn head_positions(chain: &Chain, of_head: &[f64; 5]) -> Vec<f64> {
    let names: Vec<String> = HEAD_AXES
        .iter()
        .chain(&["S"])
        .map(ToString::to_string)
        .collect();
    let values: Vec<f64> = of_head.iter().copied().chain([0.0]).collect();
    chain.positions(&names, &values).unwrap()
}

#[test]
fn head_inverse_and_chain_forward_close() {
    let chain = Chain::from_urdf(XFYZBA).unwrap();
    let head = SwivelHead { pivot_length: 0.25 };
    let part = Isometry3::identity();
    for (x, y) in [(0.0, 0.0), (0.18, -0.05), (-0.2, 0.3), (0.4, 0.4)] {
        let point = Point3::new(0.1 + x, -0.05, 0.03 + y);
        let axis = Unit::new_normalize(Vector3::new(x, y, 0.95));
        let positions = head_positions(&chain, &head.positions(&point, &axis));
        let mount = chain.part_from_mount(&positions, &part);
        assert!((mount * head.tip() - point).norm() < 1e-15);
        assert!((mount.rotation * Vector3::z() - axis.into_inner()).norm() < 1e-15);
    }
}

#[test]
fn erring_head_equals_the_product_of_the_specification() {
    let chain = Chain::from_urdf(XFYZBA).unwrap();
    let head = SwivelHead { pivot_length: 0.25 };
    let sizes = [
        ("EC0Y", 20e-6),
        ("EA0Z", -25e-6),
        ("EB0Z", 15e-6),
        ("EX0B", 5e-6),
        ("EZ0B", -3e-6),
        ("EA0B", 30e-6),
        ("EC0B", -15e-6),
        ("EY0A", 4e-6),
        ("EB0A", -20e-6),
        ("EC0A", 25e-6),
    ];
    let e = |name| {
        sizes
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, value)| *value)
            .unwrap()
    };
    let errors = links(&chain, &sizes);
    let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
    let mut moved = 0.0_f64;
    for lean in [(0.0, 0.0), (0.2, -0.1), (-0.15, 0.25)] {
        let point = Point3::new(0.12, 0.04, 0.01);
        let axis = Unit::new_normalize(Vector3::new(lean.0, lean.1, 1.0));
        let at = head.positions(&point, &axis);
        let [px, py, pz, b, a] = at;
        let product = shift(-px, 0.0, 0.0)
            * turn(z, e("EC0Y"))
            * shift(0.0, py, 0.0)
            * turn(x, e("EA0Z"))
            * turn(y, e("EB0Z"))
            * shift(0.0, 0.0, pz)
            * shift(e("EX0B"), 0.0, e("EZ0B"))
            * turn(x, e("EA0B"))
            * turn(z, e("EC0B"))
            * turn(y, b)
            * shift(0.0, e("EY0A"), 0.0)
            * turn(y, e("EB0A"))
            * turn(z, e("EC0A"))
            * turn(x, a);
        let mount = chain.part_from_mount_with(
            &head_positions(&chain, &at),
            &Isometry3::identity(),
            &errors,
        );
        let tip = product * Vector4::new(0.0, 0.0, -0.25, 1.0);
        // The product turns about x, then z; the twist about both at once: they differ in second order.
        assert!((mount * head.tip() - Point3::from(tip.xyz())).norm() < 1e-9);
        assert!(
            (mount.rotation * Vector3::z() - product.column(2).xyz()).norm() < 2e-9,
            "tool axis"
        );
        moved = moved.max((mount * head.tip() - point).norm());
    }
    assert!(moved > 5e-6, "the errors show");
}
