//! The plant of a blind session: finite kinematics and contact solved for the true ball on the true surface.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, MachineState, MachiningOperation,
    ProbeEvent, Stylus, geometry_msgs, std_msgs,
};

use super::causes::{Cause, Moment, warmth};
use super::scene::{Axis, Scene, Shape, Touch};
use crate::session::{Session, seconds};

/// Begin of every blind session, s since 1970.
const EPOCH: f64 = 1.7e9;

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
            .map(|touch| plant.positions(&contact(touch), &touch.fixed))
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
        let positions = self.positions(&centre, &touch.fixed);
        let ahead = self.positions(&(centre - touch.normal * 1e-4), &touch.fixed);
        let speeds: Vec<f64> = positions
            .iter()
            .zip(&ahead)
            .map(|(now, next)| clean((next - now) / 1e-4) * touch.feed)
            .collect();
        let moment = |cutting: bool, speed: f64| Moment {
            touch,
            index,
            count: self.planned,
            span: self.scene.touches[self.planned - 1].time,
            speed,
            cutting,
            middle: 0.0,
            half: 1.0,
        };
        let (ball, mount) = self.ball(&positions, &speeds, &moment(false, 0.0));
        let still = moment(false, 0.0);
        let mut left = 0.0;
        if self.scene.cut_here {
            let rotary = vec![0.0; touch.fixed.len()];
            let at = self.positions(&touch.point, &rotary);
            let (cut, _) = self.ball(&at, &vec![0.0; at.len()], &moment(true, 0.0));
            left += touch.normal.dot(&(cut - touch.point));
        }
        let touched = mount.inverse_transform_vector(&touch.normal);
        for cause in self.causes {
            left += cause.material(&still) + cause.reading(&touched, &still);
        }
        let feature = &self.scene.features[touch.feature];
        let mut true_ball = ball;
        for cause in self.causes {
            true_ball -= cause.part(&touch.point, &still);
        }
        let distance = match &feature.shape {
            Shape::Plane => feature.axis.dot(&(true_ball - feature.origin)),
            Shape::Round { centre, axis, hole } => {
                let arm = true_ball - centre;
                let from = (arm - axis * axis.dot(&arm)).norm();
                if *hole {
                    feature.radius - from
                } else {
                    from - feature.radius
                }
            }
            Shape::Ball { centre } => (true_ball - centre).norm() - feature.radius,
        };
        distance - self.scene.ball_radius - left
    }

    /// True ball centre in the part frame, and the mount in the part frame.
    fn ball(
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
                pose *= Isometry3::translation(axis.origin.x, axis.origin.y, axis.origin.z);
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
        let part = branch(&self.scene.part_axes, 0)
            * Isometry3::translation(0.0, 0.0, self.scene.part_height);
        let mount = part.inverse() * branch(&self.scene.tool_axes, count);
        let mut centre = self.scene.stylus;
        for cause in self.causes {
            centre += cause.ball(moment);
        }
        (mount * Point3::from(centre), mount)
    }

    /// Axis positions (part branch, then tool branch) that put the nominal ball at `centre`.
    fn positions(&self, centre: &Point3<f64>, fixed: &[f64]) -> Vec<f64> {
        let nominal = Plant {
            scene: self.scene,
            causes: &[],
            travels: Vec::new(),
            planned: self.planned,
        };
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
        let moment = Moment {
            touch: &self.scene.touches[0],
            index: 0,
            count: 1,
            span: 1.0,
            speed: 0.0,
            cutting: false,
            middle: 0.0,
            half: 1.0,
        };
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
        let axes: Vec<String> = scene
            .part_axes
            .iter()
            .chain(&scene.tool_axes)
            .map(|axis| axis.name.to_owned())
            .collect();
        let events = (0..scene.touches.len())
            .map(|index| {
                let touch = &scene.touches[index];
                let away = self.contact(index) + errors[index];
                let centre = touch.point + touch.normal * (scene.ball_radius + away);
                let positions = self.positions(&centre, &touch.fixed);
                ProbeEvent {
                    header: header(touch.time),
                    sequence: index as u64,
                    plan_id: "blind".to_owned(),
                    point_index: index as u32,
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
        let machine_states = (0..=(last / 10.0) as usize + 1)
            .map(|index| {
                let time = index as f64 * 10.0;
                MachineState {
                    header: header(time),
                    temperature_names: vec!["part".to_owned()],
                    temperatures: vec![20.0 + warmth(time)],
                    ..MachineState::default()
                }
            })
            .collect();
        Session {
            name: format!("blind-{seed}"),
            robot_description: scene.urdf(),
            plan: Some(self.plan()),
            events,
            machine_states,
            ..Session::default()
        }
    }

    /// The messages of the touches after the first session, as a session of their own plan.
    pub(super) fn measured(&self, seed: u64, errors: &[f64], plan: &InspectionPlan) -> Session {
        let whole = self.session(seed, errors);
        let further = |event: &ProbeEvent| event.sequence as usize >= self.planned;
        let began = seconds(&header(self.scene.touches[self.planned].time - 10.0).stamp);
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

    fn plan(&self) -> InspectionPlan {
        let scene = self.scene;
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
                position: geometry_msgs::Point {
                    x: 0.0,
                    y: 0.0,
                    z: scene.part_height,
                },
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
            rotary_names: scene.fixed.iter().map(|name| (*name).to_owned()).collect(),
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

fn header(time: f64) -> std_msgs::Header {
    let whole = (EPOCH + time).floor();
    std_msgs::Header {
        stamp: Time {
            sec: whole as i32,
            nanosec: ((EPOCH + time - whole) * 1e9) as u32,
        },
        frame_id: "foundation".to_owned(),
    }
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
