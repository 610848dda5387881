//! The rules of `visualization`.

use graph::{Node, Outbox, START, Stamp, faults, inputs, outputs, topics};
use probecell_msgs::{
    Fault, InspectionPlan, MeasurementOrder, TouchDeviation, Verdict, sensor_msgs::JointState,
    tf2_msgs::TFMessage, visualization_msgs::MarkerArray,
};
use serde::{Deserialize, Serialize};

use crate::{
    config::Config,
    markers::{Scene, Touched},
    transforms,
};

inputs! {
    /// What `visualization` subscribes to.
    pub enum Input {
        /// Positions of the joints.
        Joints(JointState) = topics::JOINT_STATES,
        /// What is measured.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
        /// In which order.
        Order(MeasurementOrder) = topics::MEASUREMENT_ORDER,
        /// What a touch said.
        Deviation(TouchDeviation) = topics::TOUCH_DEVIATIONS,
        /// What was decided.
        Verdict(Verdict) = topics::VERDICTS,
    }
}

outputs! {
    /// What `visualization` publishes.
    pub enum Output {
        /// Frames of the links that move.
        Transforms(TFMessage) = topics::TF,
        /// Frames of the others, and of part and stylus.
        Fixed(TFMessage) = topics::TF_STATIC,
        /// Points, touches, deviations and verdicts.
        Markers(MarkerArray) = topics::TOUCH_MARKERS,
        /// A fault.
        Fault(Fault) = topics::VISUALIZATION_FAULTS,
    }
}

faults! {
    /// What `visualization` can find wrong.
    pub enum VisualizationFault of "visualization" {
        /// A state of the joints cannot be shown.
        JointsNotUsable = WARNING "joints_not_usable",
    }
}

/// Least time between two transforms of a link, s: the default of `robot_state_publisher`.
const TRANSFORM_PERIOD_S: f64 = 0.05;
/// Least time between two sets of markers, s.
const MARKER_PERIOD_S: f64 = 1.0;
/// Most points that are published in a second.
const POINTS_PER_S: f64 = 100.0;
/// Timer of the next set of markers.
const MARKERS: u32 = 1;

/// The state of `visualization`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// What is drawn, once there is a plan.
    pub scene: Option<Scene>,
    /// An order whose plan has not arrived yet.
    pub early: Option<MeasurementOrder>,
    /// Stamp of the last joint state that was shown.
    pub shown: Option<Stamp>,
    /// The state of the joints could not be shown, which was reported.
    pub is_reported: bool,
    /// When the markers were published last.
    pub drawn: Option<Stamp>,
    /// Markers will be published by a timer that is set.
    pub is_due: bool,
}

/// The node.
pub struct VisualizationNode;

impl Node for VisualizationNode {
    const NAME: &'static str = "visualization";
    type Config = Config;
    type State = State;
    type Input = Input;
    type Output = Output;
    type Fault = VisualizationFault;

    fn start(_config: &Config) -> State {
        State::default()
    }

    fn step(
        config: &Config,
        state: &mut State,
        now: Stamp,
        input: Input,
        out: &mut Outbox<Output>,
    ) {
        match input {
            Input::Timer(START) => out.send(Output::Fixed(transforms::fixed(config, now, None))),
            Input::Timer(_) => {
                state.is_due = false;
                draw(config, state, now, out);
            }
            Input::Joints(joints) => show(config, state, now, &joints, out),
            Input::Plan(plan) => {
                let fixed = transforms::fixed(config, now, Some(&plan));
                out.send(Output::Fixed(fixed));
                let mut scene = Scene::of(plan);
                let early = state.early.take();
                if let Some(early) = early.filter(|early| early.plan_id == scene.plan.plan_id) {
                    scene.order = early.order;
                }
                state.scene = Some(scene);
                draw(config, state, now, out);
            }
            Input::Order(order) => match scene(state, &order.plan_id) {
                Some(scene) => {
                    scene.order = order.order;
                    redraw(state, now, out);
                }
                None => state.early = Some(order),
            },
            Input::Deviation(touch) => {
                if let Some(scene) = scene(state, &touch.plan_id) {
                    let touched = Touched {
                        deviation: touch.deviation,
                        uncertainty: touch.standard_uncertainty,
                    };
                    scene.touches.insert(touch.point_index, touched);
                    redraw(state, now, out);
                }
            }
            Input::Verdict(verdict) => {
                if let Some(scene) = scene(state, &verdict.plan_id) {
                    scene.verdicts.insert(verdict.feature_id, verdict.verdict);
                    redraw(state, now, out);
                }
            }
        }
    }
}

/// The scene of that plan, if it is the one shown.
fn scene<'a>(state: &'a mut State, plan_id: &str) -> Option<&'a mut Scene> {
    let scene = state.scene.as_mut();
    scene.filter(|scene| scene.plan.plan_id == plan_id)
}

fn show(
    config: &Config,
    state: &mut State,
    now: Stamp,
    joints: &JointState,
    out: &mut Outbox<Output>,
) {
    let stamp = Stamp::from(&joints.header.stamp);
    // A clock that was set back begins anew.
    let is_early = |shown: Stamp| (0.0..TRANSFORM_PERIOD_S).contains(&stamp.since_s(shown));
    if state.shown.is_some_and(is_early) {
        return;
    }
    let transforms = transforms::moving(config, joints);
    let usable = transforms.transforms.len() == joints.name.len();
    if !usable && !state.is_reported {
        let text = format!(
            "of {} joints in joint_states {} are joints of the robot description with a finite position",
            joints.name.len(),
            transforms.transforms.len()
        );
        out.fault(now, VisualizationFault::JointsNotUsable, text);
    }
    state.is_reported = !usable;
    state.shown = Some(stamp);
    out.send(Output::Transforms(transforms));
}

/// Sees to it that the markers are published when their time has come.
fn redraw(state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
    if state.is_due {
        return;
    }
    let points = state
        .scene
        .as_ref()
        .map_or(0, |scene| scene.plan.points.len());
    let period = MARKER_PERIOD_S.max(points as f64 / POINTS_PER_S);
    let next = state.drawn.map_or(now, |drawn| drawn.after_s(period));
    state.is_due = true;
    out.wake_at(next, MARKERS);
}

fn draw(config: &Config, state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
    if let Some(scene) = &state.scene {
        out.send(Output::Markers(scene.markers(config, now)));
        state.drawn = Some(now);
    }
}
