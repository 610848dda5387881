//! Machine, part and plan of a sealed session: a made-up one here, that of a recording in [`super::given`].

use std::fmt::Write;

use nalgebra::{DMatrix, Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use probecell_msgs::{InspectionPlan, MachineState, ReferenceMeasurement};
use rand::Rng;
use rand_pcg::Pcg64Mcg;

/// A joint of the made-up machine.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    pub(super) name: String,
    pub(super) turns: bool,
    pub(super) direction: Vector3<f64>,
    /// From the axis before.
    pub(super) origin: Isometry3<f64>,
}

impl Axis {
    pub(super) fn motion(&self, position: f64) -> Isometry3<f64> {
        if self.turns {
            Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_scaled_axis(self.direction * position),
            )
        } else {
            Isometry3::translation(
                self.direction.x * position,
                self.direction.y * position,
                self.direction.z * position,
            )
        }
    }
}

/// What a surface is.
#[derive(Debug, Clone)]
pub(super) enum Shape {
    Plane,
    Round {
        centre: Point3<f64>,
        axis: Vector3<f64>,
        hole: bool,
    },
    Ball {
        centre: Point3<f64>,
    },
    /// Its tangent plane at each touch.
    Free,
}

/// One planned touch.
#[derive(Debug, Clone)]
pub(super) struct Touch {
    /// Place in the plan's points.
    pub(super) number: u32,
    pub(super) feature: usize,
    pub(super) point: Point3<f64>,
    pub(super) normal: Vector3<f64>,
    pub(super) fixed: Vec<f64>,
    pub(super) feed: f64,
    pub(super) time: f64,
    pub(super) operation: i32,
    /// Number of the tool that cut it; 0 where none did.
    pub(super) tool: u32,
    pub(super) cut_length: f64,
    pub(super) tool_height: f64,
    pub(super) overhang: f64,
    /// On a bore or a boss.
    pub(super) round: bool,
    /// Part temperature above 20 °C.
    pub(super) warm: f64,
    /// How axes that the plan leaves free get there, where they are not just three linear ones.
    pub(super) reach: Option<Reach>,
}

/// The posture in which axes touch a point, and how they move the ball from there without turning it.
#[derive(Debug, Clone)]
pub(super) struct Reach {
    /// All positions, part branch first, with the nominal ball in contact.
    pub(super) positions: Vec<f64>,
    /// Positions per metre of the ball, part frame.
    pub(super) follow: DMatrix<f64>,
    /// Attitude of the mount in the part frame.
    pub(super) attitude: UnitQuaternion<f64>,
}

/// What an outside instrument measures of the part.
#[derive(Debug, Clone)]
pub(super) struct Reference {
    pub(super) message: ReferenceMeasurement,
    /// Its points, as if they were touched.
    pub(super) points: Vec<Touch>,
}

/// What a scene takes from a recording as it is.
#[derive(Debug, Clone)]
pub(super) struct Given {
    pub(super) urdf: String,
    pub(super) plan: InspectionPlan,
    pub(super) machine_states: Vec<MachineState>,
    /// When its time begins, s since 1970.
    pub(super) began: f64,
    pub(super) references: Vec<Reference>,
    /// Positions of the prescribed axes in each operation.
    pub(super) operations: Vec<Vec<f64>>,
}

#[derive(Debug, Clone)]
pub(super) struct Feature {
    pub(super) name: String,
    pub(super) kind: u8,
    pub(super) shape: Shape,
    pub(super) origin: Point3<f64>,
    pub(super) axis: Vector3<f64>,
    pub(super) radius: f64,
}

/// Machine, part and plan.
#[derive(Debug, Clone)]
pub(super) struct Scene {
    pub(super) machine: String,
    pub(super) part_axes: Vec<Axis>,
    pub(super) tool_axes: Vec<Axis>,
    /// Names of the axes that the plan prescribes.
    pub(super) fixed: Vec<String>,
    /// Part in the frame of its last axis.
    pub(super) part: Isometry3<f64>,
    /// Mount in the frame of its last axis.
    pub(super) mount: Isometry3<f64>,
    pub(super) stylus: Vector3<f64>,
    pub(super) ball_radius: f64,
    pub(super) features: Vec<Feature>,
    pub(super) touches: Vec<Touch>,
    pub(super) cut_here: bool,
    pub(super) given: Option<Given>,
}

fn axis(name: &'static str, turns: bool, direction: [f64; 3], origin: [f64; 3]) -> Axis {
    Axis {
        name: name.to_owned(),
        turns,
        direction: direction.into(),
        origin: Isometry3::translation(origin[0], origin[1], origin[2]),
    }
}

impl Scene {
    /// One that is made up, with a plan of `touches`; drawn where there is none.
    pub(super) fn random(random: &mut Pcg64Mcg, touches: Option<usize>) -> Self {
        let length = random.random_range(0.1..0.2);
        let (machine, part_axes, tool_axes, fixed) = match random.random_range(0..3) {
            0 => (
                "trunnion",
                vec![
                    axis("X", false, [1., 0., 0.], [0., 0., 0.]),
                    axis("A", true, [1., 0., 0.], [0., 0., 0.]),
                    axis(
                        "C",
                        true,
                        [0., 0., 1.],
                        [0., 0., random.random_range(-0.02..0.02)],
                    ),
                ],
                vec![
                    axis("Y", false, [0., 1., 0.], [0., 0., 0.]),
                    axis("Z", false, [0., 0., 1.], [0., 0., 0.4]),
                    axis("S", true, [0., 0., 1.], [0., 0., 0.]),
                ],
                vec!["A", "C", "S"],
            ),
            1 => (
                "swivel_head",
                vec![
                    axis("X", false, [1., 0., 0.], [0., 0., 0.]),
                    axis("C", true, [0., 0., 1.], [0., 0., 0.]),
                ],
                vec![
                    axis("Y", false, [0., 1., 0.], [0., 0., 0.]),
                    axis("Z", false, [0., 0., 1.], [0., 0., 0.5]),
                    axis("B", true, [0., 1., 0.], [0., 0., 0.]),
                    axis("S", true, [0., 0., 1.], [0., 0., -0.1]),
                ],
                vec!["C", "B", "S"],
            ),
            _ => (
                "table",
                vec![
                    axis("Y", false, [0., 1., 0.], [0., 0., 0.]),
                    axis("B", true, [0., 1., 0.], [0., 0., 0.]),
                    axis("C", true, [0., 0., 1.], [0., 0., 0.03]),
                ],
                vec![
                    axis("X", false, [1., 0., 0.], [0., 0., 0.]),
                    axis("Z", false, [0., 0., 1.], [0., 0., 0.4]),
                    axis("S", true, [0., 0., 1.], [0., 0., 0.]),
                ],
                vec!["B", "C", "S"],
            ),
        };
        let cut_here = random.random_bool(0.4);
        let mut scene = Self {
            machine: machine.to_owned(),
            part_axes,
            tool_axes,
            fixed: fixed.into_iter().map(str::to_owned).collect(),
            part: Isometry3::translation(0.0, 0.0, random.random_range(0.03..0.08)),
            mount: Isometry3::identity(),
            stylus: Vector3::new(0.0, 0.0, -length),
            ball_radius: random.random_range(0.001..0.004),
            features: Vec::new(),
            touches: Vec::new(),
            cut_here,
            given: None,
        };
        scene.part(random);
        scene.plan(random, touches);
        scene
    }

    fn part(&mut self, random: &mut Pcg64Mcg) {
        let (x, y, z) = (
            random.random_range(0.04..0.09),
            random.random_range(0.03..0.08),
            random.random_range(0.03..0.08),
        );
        let mut plane = |name: &str, origin: [f64; 3], axis: [f64; 3]| {
            self.features.push(Feature {
                name: name.to_owned(),
                kind: 0,
                shape: Shape::Plane,
                origin: origin.into(),
                axis: axis.into(),
                radius: 0.0,
            });
        };
        plane("left", [-x, 0., 0.5 * z], [-1., 0., 0.]);
        plane("right", [x, 0., 0.5 * z], [1., 0., 0.]);
        plane("front", [0., -y, 0.5 * z], [0., -1., 0.]);
        plane("back", [0., y, 0.5 * z], [0., 1., 0.]);
        plane("top", [0., 0., z], [0., 0., 1.]);
        let mut round = |name: &str, x: f64, radius: f64, hole: bool| {
            let centre = Point3::new(x, 0.0, z);
            self.features.push(Feature {
                name: name.to_owned(),
                kind: if hole { 2 } else { 1 },
                shape: Shape::Round {
                    centre,
                    axis: Vector3::z(),
                    hole,
                },
                origin: centre,
                axis: Vector3::z(),
                radius,
            });
        };
        round("bore", -0.5 * x, random.random_range(0.010..0.018), true);
        round("boss", 0.5 * x, random.random_range(0.010..0.018), false);
        if random.random_bool(0.3) {
            let centre = Point3::new(0.0, 0.5 * y, z + 0.03);
            let radius = random.random_range(0.008..0.015);
            self.features.push(Feature {
                name: "ball".to_owned(),
                kind: 3,
                shape: Shape::Ball { centre },
                origin: centre,
                axis: Vector3::z(),
                radius,
            });
        }
    }

    fn plan(&mut self, random: &mut Pcg64Mcg, touches: Option<usize>) {
        let count = touches.unwrap_or_else(|| random.random_range(80..160));
        let tilt = random.random_range(0.2..0.7);
        let tilted = random.random_bool(0.85);
        let feeds: Vec<f64> = if random.random_bool(0.6) {
            vec![0.002, 0.005]
        } else {
            vec![0.003]
        };
        let mut time = 5.0;
        for _ in 0..count {
            let feature = random.random_range(0..self.features.len());
            let (point, normal) = self.point(random, feature);
            let first = if tilted {
                [-tilt, 0.0, tilt][random.random_range(0..3)]
            } else {
                0.0
            };
            let turn = std::f64::consts::FRAC_PI_2 * f64::from(random.random_range(-1..3));
            let spindle = if random.random_bool(0.5) {
                std::f64::consts::PI
            } else {
                0.0
            };
            let (first, second) = if self.fixed[0] == "C" {
                (turn, first)
            } else {
                (first, turn)
            };
            time += random.random_range(6.0..12.0);
            let round = matches!(self.features[feature].shape, Shape::Round { .. });
            self.touches.push(Touch {
                number: self.touches.len() as u32,
                feature,
                point,
                normal,
                fixed: vec![first, second, spindle],
                feed: feeds[random.random_range(0..feeds.len())],
                time,
                operation: if self.cut_here { i32::from(round) } else { -1 },
                tool: if self.cut_here {
                    1 + u32::from(round)
                } else {
                    0
                },
                cut_length: if self.cut_here {
                    random.random_range(0.0..30.0)
                } else {
                    0.0
                },
                tool_height: if self.cut_here && !round {
                    point.z.max(0.0)
                } else {
                    0.0
                },
                overhang: if self.cut_here {
                    point.z.max(0.0) + 0.02
                } else {
                    0.0
                },
                round,
                warm: warmth(time),
                reach: None,
            });
        }
    }

    fn point(&self, random: &mut Pcg64Mcg, index: usize) -> (Point3<f64>, Vector3<f64>) {
        let feature = &self.features[index];
        match &feature.shape {
            Shape::Plane | Shape::Free => {
                let normal = feature.axis;
                let mut across = Vector3::new(
                    random.random_range(-0.03..0.03),
                    random.random_range(-0.025..0.025),
                    random.random_range(-0.012..0.012),
                );
                across -= normal * normal.dot(&across);
                (feature.origin + across, normal)
            }
            Shape::Round { centre, hole, .. } => {
                let angle = random.random_range(0.0..std::f64::consts::TAU);
                let out = Vector3::new(angle.cos(), angle.sin(), 0.0);
                let height = random.random_range(0.003..0.012) * if *hole { -1.0 } else { 1.0 };
                let normal = if *hole { -out } else { out };
                (
                    centre + out * feature.radius + Vector3::z() * height,
                    normal,
                )
            }
            Shape::Ball { centre } => {
                let angle = random.random_range(0.0..std::f64::consts::TAU);
                let up: f64 = random.random_range(0.0..1.3);
                let out = Vector3::new(angle.cos() * up.cos(), angle.sin() * up.cos(), up.sin());
                (centre + out * feature.radius, out)
            }
        }
    }

    /// The scene with the touches of another plan of its part after its own, eight seconds apart.
    pub(super) fn with(mut self, plan: &InspectionPlan) -> Self {
        let mut time = self.touches.last().map_or(0.0, |last| last.time) + 60.0;
        for point in &plan.points {
            time += 8.0;
            let shape = (self.features.get(point.feature as usize)).map(|feature| &feature.shape);
            let round = matches!(shape, Some(Shape::Round { .. }));
            let (at, normal) = (&point.position, &point.normal);
            self.touches.push(Touch {
                number: self.touches.len() as u32,
                feature: point.feature as usize,
                point: Point3::new(at.x, at.y, at.z),
                normal: Vector3::new(normal.x, normal.y, normal.z),
                fixed: point.rotary_positions.clone(),
                feed: point.feed,
                time,
                operation: point.operation,
                tool: u32::try_from(point.operation + 1).unwrap_or(0),
                cut_length: point.cut_length,
                tool_height: point.tool_height,
                overhang: point.overhang,
                round,
                warm: warmth(time),
                reach: None,
            });
        }
        self
    }

    /// True where an axis moves along a line.
    pub(super) fn has_linear_axis(&self) -> bool {
        let mut axes = self.part_axes.iter().chain(&self.tool_axes);
        axes.any(|axis| !axis.turns)
    }

    /// The tools that cut it, in the order of their numbers.
    pub(super) fn tools(&self) -> Vec<u32> {
        let mut tools: Vec<u32> = self.touches.iter().map(|touch| touch.tool).collect();
        tools.sort_unstable();
        tools.dedup();
        tools.retain(|&tool| tool > 0);
        tools
    }

    /// Where a patch of the surface lies and how wide it is, in a direction from the part's middle.
    pub(super) fn patch(&self, direction: &Vector3<f64>) -> (Point3<f64>, f64) {
        if self.given.is_none() {
            let place = Point3::new(0.05 * direction.x, 0.04 * direction.y, 0.04);
            return (place, 0.022);
        }
        let (low, high) = self.touches.iter().fold(
            (
                Point3::from(Vector3::repeat(f64::MAX)),
                Point3::from(Vector3::repeat(f64::MIN)),
            ),
            |(low, high), touch| (low.inf(&touch.point), high.sup(&touch.point)),
        );
        let half = (high - low) / 2.0;
        (
            nalgebra::center(&low, &high) + half.component_mul(direction),
            0.3 * half.norm(),
        )
    }

    /// The machine as a robot description.
    pub(super) fn urdf(&self) -> String {
        if let Some(given) = &self.given {
            return given.urdf.clone();
        }
        let mut text = format!(
            "<robot name=\"{}\"><link name=\"foundation\"/>",
            self.machine
        );
        for (axes, end) in [
            (&self.part_axes, "workpiece"),
            (&self.tool_axes, "probe_mount"),
        ] {
            let mut parent = "foundation".to_owned();
            for (index, axis) in axes.iter().enumerate() {
                let child = if index + 1 == axes.len() {
                    end.to_owned()
                } else {
                    format!("{}_link", axis.name)
                };
                let kind = if axis.turns { "revolute" } else { "prismatic" };
                let (o, d) = (axis.origin.translation, axis.direction);
                write!(
 text,
                    "<link name=\"{child}\"/><joint name=\"{}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
                     <origin xyz=\"{} {} {}\"/><axis xyz=\"{} {} {}\"/><limit lower=\"-7\" upper=\"7\" effort=\"0\" velocity=\"1\"/></joint>",
                    axis.name, o.x, o.y, o.z, d.x, d.y, d.z
                )
                .unwrap_or_else(|_| unreachable!("writing to a string cannot fail"));
                parent = child;
            }
        }
        text + "</robot>"
    }
}

/// Part temperature above 20 °C.
pub(super) fn warmth(time: f64) -> f64 {
    3.0 * (1.0 - (-time / 700.0).exp())
}
