//! The rules of `visualization`.

use graph::{START, Stamp};
use probecell_msgs::sensor_msgs::JointState;

use crate::{
    config::Config,
    markers::{Scene, Touched},
    ports::{Input, Out, Output, VisualizationFault},
    state::State,
    transforms,
};

/// Least time between two transforms of a link, s: the default of `robot_state_publisher`.
const TRANSFORM_PERIOD_S: f64 = 0.05;
/// Least time between two sets of markers, s.
const MARKER_PERIOD_S: f64 = 1.0;
/// Most points that are published in a second.
const POINTS_PER_S: f64 = 100.0;
/// Timer of the next set of markers.
const MARKERS: u32 = 1;

/// Processes one input at the instant `now`.
pub(crate) fn step(config: &Config, state: &mut State, now: Stamp, input: Input, out: &mut Out) {
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

/// The scene of that plan, if it is the one shown.
fn scene<'a>(state: &'a mut State, plan_id: &str) -> Option<&'a mut Scene> {
    let scene = state.scene.as_mut();
    scene.filter(|scene| scene.plan.plan_id == plan_id)
}

fn show(config: &Config, state: &mut State, now: Stamp, joints: &JointState, out: &mut Out) {
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
fn redraw(state: &mut State, now: Stamp, out: &mut Out) {
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

fn draw(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    if let Some(scene) = &state.scene {
        out.send(Output::Markers(scene.markers(config, now)));
        state.drawn = Some(now);
    }
}
