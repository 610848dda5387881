//! The action by which the robot moves, and what its other clients share.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use probecell_msgs::{builtin_interfaces::Time, std_msgs};

use super::{calls::Pending, wire};
use crate::driver::{ConnectError, RosBus, RosService};

/// Longest time for an answer of a service that moves nothing.
pub(super) const ANSWER_LIMIT: Duration = Duration::from_secs(4);

/// Sends a goal.
const SEND: &str = "send_goal";
/// Answers when a goal has ended.
const RESULT: &str = "get_result";
/// Cancels goals.
const CANCEL: &str = "cancel_goal";

/// Services of the action.
#[derive(Clone)]
pub(super) struct Action {
    pub(super) send: Arc<dyn RosService>,
    pub(super) result: Arc<dyn RosService>,
    cancel: Arc<dyn RosService>,
}

impl Action {
    pub(super) fn join(name: &str, bus: &dyn RosBus) -> Result<Self, ConnectError> {
        let service = |last, ty| bus.service(&service_name(name, last), ty);
        Ok(Self {
            send: service(SEND, wire::SEND_GOAL)?,
            result: service(RESULT, wire::GET_RESULT)?,
            cancel: service(CANCEL, wire::CANCEL_GOAL)?,
        })
    }

    /// Cancels all goals, whoever has sent them.
    pub(super) fn cancel(&self, at: Instant) -> Pending {
        Pending::call(&self.cancel, wire::cancel_all(), ANSWER_LIMIT, at)
    }
}

/// Names of the services of an action.
pub(super) fn services(action: &str) -> [String; 3] {
    [SEND, RESULT, CANCEL].map(|last| service_name(action, last))
}

fn service_name(action: &str, last: &str) -> String {
    format!("{action}/_action/{last}")
}

/// Header of a message of this instant, ns.
pub(super) fn header(instant: i64) -> std_msgs::Header {
    std_msgs::Header {
        stamp: Time::from_nanos(instant),
        frame_id: String::new(),
    }
}
