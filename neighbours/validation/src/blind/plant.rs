//! The plant of a blind session: finite kinematics and contact solved for the true ball on the true surface.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, MachineState, MachiningOperation,
    ProbeEvent, ReferenceMeasurement, Stylus, geometry_msgs, std_msgs,
};
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::causes::{Cause, Moment};
use super::scene::{Axis, Scene, Shape, Touch, warmth};
use effects::session::{Session, seconds};

/// Start of every blind session, s since 1970.
const EPOCH: f64 = 1.7e9;
/// Keeps the noise of references apart from the other draws of a seed.
const REFERENCE: u64 = 0x5e7e_11e5;

/// Machine and part with causes at work.
pub(super) struct Plant<'a> {
    scene: &'a Scene,
    causes: &'a [Cause],
    travels: Vec<(f64, f64)>,
    /// Touches of the first session: causes that last a session know no others.
    planned: usize,
}

impl<'a> Plant<'a> {
    /// The scene with these causes at work.
    pub(super) fn new(scene: &'a Scene, causes: &'a [Cause]) -> Self {
        Self::further(scene, causes, scene.touches.len())
    }

    /// The same where only the first `planned` touches belong to the first session.
    pub(super) fn further(scene: &'a Scene, causes: &'a [Cause], planned: usize) -> Self {
        let mut plant = Self {
            scene,
            causes,
            travels: Vec::new(),
            planned,
        };
        let contact = |touch: &Touch| touch.point + touch.normal * scene.ball_radius;
        let all: Vec<Vec<f64>> = scene
            .touches
            .iter()
            .take(planned)
            .map(|touch| plant.positions(&contact(touch), touch, &touch.fixed))
            .collect();
        let count = scene.part_axes.len() + scene.tool_axes.len();
        plant.travels = (0..count)
            .map(|axis| {
                let (low, high) = all
                    .iter()
                    .fold((f64::MAX, f64::MIN), |(low, high), positions| {
                        (low.min(positions[axis]), high.max(positions[axis]))
                    });
                (0.5 * (low + high), (0.5 * (high - low)).max(1e-3))
            })
            .collect();
        plant
    }

    /// The scene with nothing wrong in it.
    pub(super) fn nominal(scene: &'a Scene, planned: usize) -> Self {
        Self {
            scene,
            causes: &[],
            travels: Vec::new(),
            planned,
        }
    }

    /// Deviation at every touch, without noise.
    pub(super) fn deviations(&self) -> Vec<f64> {
        (0..self.scene.touches.len())
            .map(|index| self.contact(index))
            .collect()
    }

    /// Distance of the nominal ball from nominal contact, along the normal, at which the true ball touches.
    fn contact(&self, index: usize) -> f64 {
        let (mut a, mut b) = (0.0, 1e-5);
        let (mut fa, mut fb) = (self.gap(index, a), self.gap(index, b));
        for _ in 0..30 {
            if (fb - fa).abs() < 1e-18 || fb.abs() < 1e-13 {
                break;
            }
            let next = b - fb * (b - a) / (fb - fa);
            (a, fa) = (b, fb);
            b = next;
            fb = self.gap(index, b);
        }
        b
    }

    /// Distance between true ball and true surface when the nominal ball is `away` from contact.
    fn gap(&self, index: usize, away: f64) -> f64 {
        let touch = &self.scene.touches[index];
        let centre = touch.point + touch.normal * (self.scene.ball_radius + away);
        let positions = self.positions(&centre, touch, &touch.fixed);
        let ahead = self.positions(&(centre - touch.normal * 1e-4), touch, &touch.fixed);
        let speeds: Vec<f64> = positions
            .iter()
            .zip(&ahead)
            .map(|(now, next)| clean((next - now) / 1e-4) * touch.feed)
            .collect();
        let still = self.moment(touch, index, false);
        let (ball, mount) = self.ball(&positions, &speeds, &still);
        let mut left = self.left(touch, index);
        let touched = mount.inverse_transform_vector(&touch.normal);
        for cause in self.causes {
            left += cause.reading(&touched, &still);
        }
        let feature = &self.scene.features[touch.feature];
        let mut true_ball = ball;
        for cause in self.causes {
            true_ball -= cause.part(&touch.point, &still);
        }
        let distance = match &feature.shape {
            Shape::Plane => feature.axis.dot(&(true_ball - feature.origin)),
            Shape::Round { centre, axis, hole } => {
                let from = |point: &Point3<f64>| {
                    let arm = point - centre;
                    (arm - axis * axis.dot(&arm)).norm()
                };
                let outside = from(&true_ball) - from(&touch.point);
                if *hole { -outside } else { outside }
            }
            Shape::Ball { centre } => (true_ball - centre).norm() - (touch.point - centre).norm(),
            Shape::Free => touch.normal.dot(&(true_ball - touch.point)),
        };
        distance - self.scene.ball_radius - left
    }

    /// What machine and process left on the part at a point, along its normal.
    fn left(&self, touch: &Touch, index: usize) -> f64 {
        let mut left = 0.0;
        if self.scene.cut_here && touch.operation >= 0 {
            let operation = usize::try_from(touch.operation).unwrap_or(usize::MAX);
            let given = self.scene.given.as_ref();
            let rotary = given.and_then(|given| given.operations.get(operation).cloned());
            let rotary = rotary.unwrap_or_else(|| vec![0.0; touch.fixed.len()]);
            let at = self.positions(&touch.point, touch, &rotary);
            let cutting = self.moment(touch, index, true);
            let (cut, _) = self.ball(&at, &vec![0.0; at.len()], &cutting);
            left += touch.normal.dot(&(cut - touch.point));
        }
        let still = self.moment(touch, index, false);
        left + (self.causes.iter())
            .map(|cause| cause.material(&still))
            .sum::<f64>()
    }

    pub(super) fn moment<'m>(&self, touch: &'m Touch, index: usize, cutting: bool) -> Moment<'m> {
        Moment {
            touch,
            index,
            count: self.planned,
            span: self.scene.touches[self.planned - 1].time,
            speed: 0.0,
            cutting,
            middle: 0.0,
            half: 1.0,
        }
    }

    /// True ball centre in the part frame, and the mount in the part frame.
    pub(super) fn ball(
        &self,
        positions: &[f64],
        speeds: &[f64],
        moment: &Moment<'_>,
    ) -> (Point3<f64>, Isometry3<f64>) {
        let count = self.scene.part_axes.len();
        let branch = |axes: &[Axis], first: usize| {
            let mut pose = Isometry3::identity();
            for (offset, axis) in axes.iter().enumerate() {
                let position = positions[first + offset];
                let (middle, half) = self.travels.get(first + offset).map_or((0.0, 1.0), |&t| t);
                let at = Moment {
                    speed: speeds[first + offset],
                    middle,
                    half,
                    ..*moment
                };
                pose *= axis.origin;
                let mut after = Isometry3::identity();
                let mut off = 0.0;
                for cause in self.causes {
                    let (before, by, behind) = cause.joint(axis, position, &at);
                    pose *= before;
                    off += by;
                    after *= behind;
                }
                pose *= axis.motion(position + off) * after;
            }
            pose
        };
        let part = branch(&self.scene.part_axes, 0) * self.scene.part;
        let mount = part.inverse() * branch(&self.scene.tool_axes, count) * self.scene.mount;
        let mut centre = self.scene.stylus;
        for cause in self.causes {
            centre += cause.ball(moment);
        }
        (mount * Point3::from(centre), mount)
    }

    /// Axis positions (part branch, then tool branch) that put the nominal ball at `centre`.
    fn positions(&self, centre: &Point3<f64>, touch: &Touch, fixed: &[f64]) -> Vec<f64> {
        let nominal = Plant::nominal(self.scene, self.planned);
        if let Some(reach) = &touch.reach {
            return nominal.followed(reach, centre, touch);
        }
        let axes: Vec<&Axis> = self
            .scene
            .part_axes
            .iter()
            .chain(&self.scene.tool_axes)
            .collect();
        let mut positions: Vec<f64> = axes
            .iter()
            .map(|axis| {
                self.scene
                    .fixed
                    .iter()
                    .position(|name| *name == axis.name)
                    .map_or(0.0, |place| fixed[place])
            })
            .collect();
        let linear: Vec<usize> = (0..axes.len())
            .filter(|&index| !axes[index].turns)
            .collect();
        let moment = nominal.moment(touch, 0, false);
        let still = vec![0.0; positions.len()];
        let (start, _) = nominal.ball(&positions, &still, &moment);
        let mut matrix = Matrix3::zeros();
        for (column, &axis) in linear.iter().enumerate() {
            let mut moved = positions.clone();
            moved[axis] += 1.0;
            matrix.set_column(column, &(nominal.ball(&moved, &still, &moment).0 - start));
        }
        if let Some(step) = matrix.lu().solve(&(centre - start)) {
            for (value, &axis) in step.iter().zip(&linear) {
                positions[axis] = *value;
            }
        }
        positions
    }

    /// The messages of the session, with these errors (m) on the touches.
    pub(super) fn session(&self, seed: u64, errors: &[f64]) -> Session {
        let scene = self.scene;
        let plan = self.plan();
        let axes: Vec<String> = scene
            .part_axes
            .iter()
            .chain(&scene.tool_axes)
            .map(|axis| axis.name.clone())
            .collect();
        let events = (0..scene.touches.len())
            .map(|index| {
                let touch = &scene.touches[index];
                let away = self.contact(index) + errors[index];
                let centre = touch.point + touch.normal * (scene.ball_radius + away);
                let positions = self.positions(&centre, touch, &touch.fixed);
                ProbeEvent {
                    header: self.header(touch.time),
                    sequence: index as u64,
                    plan_id: plan.plan_id.clone(),
                    point_index: touch.number,
                    outcome: ProbeEvent::OUTCOME_TOUCHED,
                    axis_names: axes.clone(),
                    axis_positions: positions
                        .iter()
                        .map(|position| (position * 1e7).round() / 1e7)
                        .collect(),
                    tip: point(&centre),
                    approach: vector(&-touch.normal),
                    feed: touch.feed,
                }
            })
            .collect();
        let last = scene.touches.last().map_or(0.0, |touch| touch.time);
        let made_up = (0..=(last / 10.0) as usize + 1)
            .map(|index| {
                let time = index as f64 * 10.0;
                MachineState {
                    header: self.header(time),
                    temperature_names: vec!["part".to_owned()],
                    temperatures: vec![20.0 + warmth(time)],
                    ..MachineState::default()
                }
            })
            .collect();
        let given = scene.given.as_ref();
        Session {
            name: format!("blind-{seed}"),
            robot_description: scene.urdf(),
            plan: Some(plan),
            events,
            machine_states: given.map_or(made_up, |given| given.machine_states.clone()),
            references: self.references(seed),
            ..Session::default()
        }
    }

    /// What outside instruments measure of the part, each with noise of its standard uncertainty.
    fn references(&self, seed: u64) -> Vec<ReferenceMeasurement> {
        let mut random = Pcg64Mcg::seed_from_u64(seed ^ REFERENCE);
        let given = self.scene.given.iter();
        given
            .flat_map(|given| &given.references)
            .map(|reference| {
                let noise = reference.message.standard_uncertainty.max(0.0);
                let deviation = reference.points.iter().map(|touch| {
                    self.left(touch, 0) + noise * random.sample::<f64, _>(StandardNormal)
                });
                ReferenceMeasurement {
                    deviation: deviation.collect(),
                    ..reference.message.clone()
                }
            })
            .collect()
    }

    /// The messages of the touches after the first session, as a session of their own plan.
    pub(super) fn measured(&self, seed: u64, errors: &[f64], plan: &InspectionPlan) -> Session {
        let whole = self.session(seed, errors);
        let further = |event: &ProbeEvent| event.sequence as usize >= self.planned;
        let began = seconds(
            &self
                .header(self.scene.touches[self.planned].time - 10.0)
                .stamp,
        );
        Session {
            name: format!("blind-{seed}-further"),
            plan: Some(plan.clone()),
            events: (whole.events.into_iter().filter(further))
                .map(|event| ProbeEvent {
                    sequence: event.sequence - self.planned as u64,
                    point_index: event.point_index - self.planned as u32,
                    plan_id: plan.plan_id.clone(),
                    ..event
                })
                .collect(),
            machine_states: (whole.machine_states.into_iter())
                .filter(|state| seconds(&state.header.stamp) >= began)
                .collect(),
            ..whole
        }
    }

    fn header(&self, time: f64) -> std_msgs::Header {
        let began = (self.scene.given.as_ref()).map_or(EPOCH, |given| given.began);
        let whole = (began + time).floor();
        std_msgs::Header {
            stamp: Time {
                sec: whole as i32,
                nanosec: ((began + time - whole) * 1e9) as u32,
            },
            frame_id: "foundation".to_owned(),
        }
    }

    fn plan(&self) -> InspectionPlan {
        let scene = self.scene;
        if let Some(given) = &scene.given {
            return given.plan.clone();
        }
        let features = scene.features.iter().map(|feature| InspectionFeature {
            id: feature.name.clone(),
            kind: feature.kind,
            origin: point(&feature.origin),
            axis: vector(&feature.axis),
            radius: feature.radius,
            ..InspectionFeature::default()
        });
        let operations = if scene.cut_here { 2 } else { 0 };
        let operations = (0..operations).map(|number| MachiningOperation {
            id: format!("operation_{number}"),
            tool_number: number + 1,
            tool_radius: 0.005,
            finish: true,
            rotary_positions: vec![0.0; scene.fixed.len()],
            ..MachiningOperation::default()
        });
        let points = scene.touches.iter().map(|touch: &Touch| InspectionPoint {
            feature: touch.feature as u32,
            position: point(&touch.point),
            normal: vector(&touch.normal),
            rotary_positions: touch.fixed.clone(),
            feed: touch.feed,
            operation: touch.operation,
            cut_length: touch.cut_length,
            tool_height: touch.tool_height,
            overhang: touch.overhang,
            ..InspectionPoint::default()
        });
        InspectionPlan {
            plan_id: "blind".to_owned(),
            machined_on_this_machine: scene.cut_here,
            part_pose: geometry_msgs::Pose {
                position: point(&Point3::from(scene.part.translation.vector)),
                orientation: geometry_msgs::Quaternion {
                    x: 0.0,
                    y: 0.0,
                    z: 0.0,
                    w: 1.0,
                },
            },
            stylus: Stylus {
                id: "stylus".to_owned(),
                ball_center: point(&Point3::from(scene.stylus)),
                ball_radius: scene.ball_radius,
            },
            rotary_names: scene.fixed.clone(),
            features: features.collect(),
            operations: operations.collect(),
            points: points.collect(),
            ..InspectionPlan::default()
        }
    }
}

/// Rounding of the nominal solution does not make a standing axis move.
fn clean(speed: f64) -> f64 {
    if speed.abs() < 1e-6 { 0.0 } else { speed }
}

fn point(point: &Point3<f64>) -> geometry_msgs::Point {
    geometry_msgs::Point {
        x: point.x,
        y: point.y,
        z: point.z,
    }
}

fn vector(vector: &Vector3<f64>) -> geometry_msgs::Vector3 {
    geometry_msgs::Vector3 {
        x: vector.x,
        y: vector.y,
        z: vector.z,
    }
}
