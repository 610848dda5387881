//! The rules of `machine_state`.

use graph::{Node, Outbox, START, Stamp};
use probecell_msgs::{PartReport, PlanProgress, std_msgs};

use crate::{
    config::Config,
    operation,
    ports::{Input, MachineFault, Output},
    state::{Awaited, State},
    status, writing,
};

/// Timer of the check of timeouts.
const WATCH: u32 = 1;
/// s between two checks.
const WATCH_PERIOD: f64 = 0.1;

/// The node.
pub struct MachineStateNode;

impl Node for MachineStateNode {
    const NAME: &'static str = "machine_state";
    type Config = Config;
    type State = State;
    type Input = Input;
    type Output = Output;
    type Fault = MachineFault;

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
            Input::Timer(id) => {
                if id == START {
                    // The driver may still answer commands of an earlier process.
                    state.next_command = now.0.unsigned_abs();
                    let description = std_msgs::String {
                        data: config.robot_description.clone(),
                    };
                    out.send(Output::RobotDescription(description));
                }
                status::watch(config, state, now, out);
                writing::expire(config, state, now, out);
                writing::write_deferred(config, state, now, out);
                out.wake_at(now.after_s(WATCH_PERIOD), WATCH);
            }
            Input::Status(sample) => {
                status::sample(config, state, now, sample, out);
                // An operation may have failed with this sample.
                writing::write_deferred(config, state, now, out);
            }
            Input::Reply(reply) => {
                operation::answer(state, now, &reply, out);
                writing::write_deferred(config, state, now, out);
            }
            Input::Request(request) => operation::request(config, state, now, request, out),
            Input::Order(order) => {
                // The order of a request that is refused must not be taken for that of a later request.
                if operation::refusal(config, state).is_none() {
                    state.order = Some((order.plan_id, order.order));
                }
                if let Some(awaited) = state.awaited.take() {
                    operation::request(config, state, now, awaited.request, out);
                }
            }
            Input::Progress(progress) => {
                // Planning that makes progress is not late.
                let of_plan = |one: &&mut Awaited| one.request.plan_id == progress.plan_id;
                if progress.phase != PlanProgress::GIVEN_UP
                    && let Some(awaited) = state.awaited.as_mut().filter(of_plan)
                {
                    awaited.until = now.after_s(config.order_limit);
                }
            }
            Input::Correction(correction) => writing::correct(config, state, now, correction, out),
            Input::Part(report) => {
                if [PartReport::STOPPED, PartReport::SCRAP].contains(&report.verdict) {
                    state.ended = state.ended.max(Some(Stamp::from(&report.header.stamp)));
                }
            }
        }
    }
}
