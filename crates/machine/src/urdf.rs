//! The part of a URDF that is a machine: links with their masses, joints with their limits.
//!
//! Of shapes, cylinders and spheres of `collision` are read; everything else (visuals, transmissions) is passed over. m, rad, kg. What the format requires and a text lacks
//! is named with its joint or link (<http://wiki.ros.org/urdf/XML>).

use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};
use roxmltree::{Document, Node, ParsingOptions};

use crate::description::{ChainError, check_links, check_text};

/// Most elements, texts and comments.
const MAX_NODES: u32 = 1_000_000;

/// End of the namespace of the macros from which packages make their URDF (<http://wiki.ros.org/xacro>).
const XACRO: &str = "/xacro";

/// A robot.
pub(crate) struct Robot {
    pub(crate) name: String,
    pub(crate) links: Vec<Link>,
    pub(crate) joints: Vec<RawJoint>,
}

/// A link and its mass; all 0 where it has none.
pub(crate) struct Link {
    pub(crate) name: String,
    /// Frame of the inertia.
    pub(crate) origin: Pose,
    pub(crate) mass: f64,
    pub(crate) inertia: Matrix3<f64>,
    /// Cylinders and spheres of its `collision` elements.
    pub(crate) rounds: Vec<Round>,
}

/// A cylinder about the z axis of its frame, or a sphere (of length 0), m.
pub(crate) struct Round {
    pub(crate) origin: Pose,
    pub(crate) radius: f64,
    pub(crate) length: f64,
}

/// A joint as it is written.
#[derive(Clone)]
pub(crate) struct RawJoint {
    pub(crate) name: String,
    /// `type`, as written.
    pub(crate) kind: String,
    pub(crate) parent: String,
    pub(crate) child: String,
    pub(crate) origin: Pose,
    pub(crate) axis: Vector3<f64>,
    /// Lowest, highest and largest speed, if it has a `limit`.
    pub(crate) limit: Option<[f64; 3]>,
    /// `damping` and `friction` of its `dynamics`; 0 where it has none.
    pub(crate) friction: [f64; 2],
    pub(crate) mimics: bool,
}

/// A position and a turn, which may be no numbers.
#[derive(Clone, Copy, Default)]
pub(crate) struct Pose {
    xyz: Vector3<f64>,
    turn: Turn,
}

#[derive(Clone, Copy)]
enum Turn {
    /// Roll, pitch and yaw.
    Angles(Vector3<f64>),
    /// x, y, z, w.
    Quaternion([f64; 4]),
}

impl Default for Turn {
    fn default() -> Self {
        Self::Angles(Vector3::zeros())
    }
}

impl Pose {
    /// As a transformation; `None` where it is none.
    pub(crate) fn isometry(&self) -> Option<Isometry3<f64>> {
        let rotation = match self.turn {
            Turn::Angles(rpy) => rpy
                .iter()
                .all(|value| value.is_finite())
                .then(|| UnitQuaternion::from_euler_angles(rpy.x, rpy.y, rpy.z)),
            Turn::Quaternion([x, y, z, w]) => {
                let quaternion = Quaternion::new(w, x, y, z);
                let finite = quaternion.norm().is_finite();
                finite
                    .then(|| UnitQuaternion::try_new(quaternion, 1e-9))
                    .flatten()
            }
        };
        let finite = self.xyz.iter().all(|value| value.is_finite());
        finite.then_some(())?;
        Some(Isometry3::from_parts(
            Translation3::from(self.xyz),
            rotation?,
        ))
    }
}

impl Robot {
    /// Reads a text.
    pub(crate) fn read(text: &str) -> Result<Self, ChainError> {
        check_text(text)?;
        let options = ParsingOptions {
            allow_dtd: true,
            nodes_limit: MAX_NODES,
            ..ParsingOptions::default()
        };
        let document = Document::parse_with_options(text, options);
        let document = document.map_err(|error| ChainError::Urdf(error.to_string()))?;
        let robot = document.root_element();
        if robot.descendants().any(|one| {
            one.tag_name()
                .namespace()
                .is_some_and(|space| space.ends_with(XACRO))
        }) {
            let what = "it is a xacro that is not expanded: `xacro FILE -o robot.urdf` of ROS writes the URDF";
            return Err(ChainError::Urdf(what.to_owned()));
        }
        if robot.tag_name().name() != "robot" {
            let name = robot.tag_name().name();
            return Err(ChainError::Urdf(format!(
                "its root is `{name}`, not `robot`"
            )));
        }
        let of_kind =
            |kind: &'static str| robot.children().filter(move |one| one.has_tag_name(kind));
        check_links(of_kind("link").count(), of_kind("joint").count())?;
        Ok(Self {
            name: robot.attribute("name").unwrap_or_default().to_owned(),
            links: of_kind("link").map(link).collect::<Result<_, _>>()?,
            joints: of_kind("joint").map(joint).collect::<Result<_, _>>()?,
        })
    }
}

/// Element and name, for a sentence.
fn location(of: Node<'_, '_>) -> String {
    let name = of.attribute("name").unwrap_or_default();
    format!("{} `{name}`", of.tag_name().name())
}

fn wrong(of: Node<'_, '_>, what: &str) -> ChainError {
    ChainError::Urdf(format!("{} {what}", location(of)))
}

fn child<'a, 'i>(of: Node<'a, 'i>, tag: &str) -> Option<Node<'a, 'i>> {
    of.children().find(|one| one.has_tag_name(tag))
}

/// An attribute that must be there.
fn attribute<'a>(
    of: Node<'_, '_>,
    element: Node<'a, '_>,
    key: &str,
) -> Result<&'a str, ChainError> {
    let tag = element.tag_name().name();
    let absent = || wrong(of, &format!("has no attribute `{key}` in its `{tag}`"));
    element.attribute(key).ok_or_else(absent)
}

/// Numbers between white space.
fn numbers<const N: usize>(
    of: Node<'_, '_>,
    element: Node<'_, '_>,
    key: &str,
) -> Result<Option<[f64; N]>, ChainError> {
    let Some(text) = element.attribute(key) else {
        return Ok(None);
    };
    let values: Option<Vec<f64>> = text
        .split_whitespace()
        .map(|word| word.parse().ok())
        .collect();
    let values = values.and_then(|values| <[f64; N]>::try_from(values).ok());
    let tag = element.tag_name().name();
    let refused = || {
        wrong(
            of,
            &format!("has {key}={text:?} in its `{tag}`, expected {N} numbers"),
        )
    };
    values.map(Some).ok_or_else(refused)
}

/// A number that must be there.
fn number(of: Node<'_, '_>, element: Node<'_, '_>, key: &str) -> Result<f64, ChainError> {
    attribute(of, element, key)?;
    Ok(numbers::<1>(of, element, key)?.map_or(0.0, |[value]| value))
}

fn pose(of: Node<'_, '_>, parent: Node<'_, '_>) -> Result<Pose, ChainError> {
    let Some(origin) = child(parent, "origin") else {
        return Ok(Pose::default());
    };
    let turn = match numbers::<4>(of, origin, "quat_xyzw")? {
        Some(quaternion) => Turn::Quaternion(quaternion),
        None => Turn::Angles(numbers(of, origin, "rpy")?.unwrap_or_default().into()),
    };
    let xyz = numbers(of, origin, "xyz")?.unwrap_or_default().into();
    Ok(Pose { xyz, turn })
}

/// Cylinders and spheres of a link's `collision` elements; boxes and meshes are left out.
fn rounds(of: Node<'_, '_>) -> Result<Vec<Round>, ChainError> {
    let mut rounds = Vec::new();
    for collision in of.children().filter(|one| one.has_tag_name("collision")) {
        let shape = child(collision, "geometry");
        let shape = shape.and_then(|shape| shape.children().find(Node::is_element));
        let Some(shape) = shape else { continue };
        let length = match shape.tag_name().name() {
            "cylinder" => number(of, shape, "length")?,
            "sphere" => 0.0,
            _ => continue,
        };
        rounds.push(Round {
            origin: pose(of, collision)?,
            radius: number(of, shape, "radius")?,
            length,
        });
    }
    Ok(rounds)
}

fn link(of: Node<'_, '_>) -> Result<Link, ChainError> {
    let name = attribute(of, of, "name")?.to_owned();
    let rounds = rounds(of)?;
    let Some(inertial) = child(of, "inertial") else {
        return Ok(Link {
            rounds,
            name,
            origin: Pose::default(),
            mass: 0.0,
            inertia: Matrix3::zeros(),
        });
    };
    let required = |tag: &str| {
        child(inertial, tag).ok_or_else(|| wrong(of, &format!("has no `{tag}` in its `inertial`")))
    };
    let about = required("inertia")?;
    let moment = |key: &str| number(of, about, key);
    let [xx, xy, xz] = [moment("ixx")?, moment("ixy")?, moment("ixz")?];
    let [yy, yz, zz] = [moment("iyy")?, moment("iyz")?, moment("izz")?];
    Ok(Link {
        rounds,
        name,
        origin: pose(of, inertial)?,
        mass: number(of, required("mass")?, "value")?,
        inertia: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
    })
}

fn joint(of: Node<'_, '_>) -> Result<RawJoint, ChainError> {
    let link = |tag: &str| -> Result<String, ChainError> {
        let element = child(of, tag).ok_or_else(|| wrong(of, &format!("has no `{tag}`")))?;
        Ok(attribute(of, element, "link")?.to_owned())
    };
    let axis = match child(of, "axis") {
        None => [1.0, 0.0, 0.0],
        Some(axis) => {
            attribute(of, axis, "xyz")?;
            numbers(of, axis, "xyz")?.unwrap_or_default()
        }
    };
    let limit = match child(of, "limit") {
        None => None,
        Some(limit) => {
            let bound = |key: &str| -> Result<f64, ChainError> {
                Ok(numbers::<1>(of, limit, key)?.map_or(0.0, |[value]| value))
            };
            Some([
                bound("lower")?,
                bound("upper")?,
                number(of, limit, "velocity")?,
            ])
        }
    };
    let friction = |key: &str| -> Result<f64, ChainError> {
        let Some(dynamics) = child(of, "dynamics") else {
            return Ok(0.0);
        };
        Ok(numbers::<1>(of, dynamics, key)?.map_or(0.0, |[value]| value))
    };
    Ok(RawJoint {
        friction: [friction("damping")?, friction("friction")?],
        name: attribute(of, of, "name")?.to_owned(),
        kind: attribute(of, of, "type")?.to_owned(),
        parent: link("parent")?,
        child: link("child")?,
        origin: pose(of, of)?,
        axis: axis.into(),
        limit,
        mimics: child(of, "mimic").is_some(),
    })
}
