//! Messages of the contract, declared by hand as hiroz's serde takes them, and the two actions of a cell.

use std::{collections::BTreeMap, sync::RwLock};

use hiroz::{
    ServiceTypeInfo, TypeHash, TypeInfo,
    action::ZAction,
    msg::{SerdeCdrSerdes, ZMessage, ZService},
};
use serde::{Deserialize, Serialize};

/// Types of services and topics below the namespace of the cell, as its nodes announce them.
pub(crate) static ANNOUNCED: RwLock<BTreeMap<String, TypeInfo>> = RwLock::new(BTreeMap::new());

fn announced(name: &str) -> TypeInfo {
    let known = ANNOUNCED.read().ok().and_then(|all| all.get(name).cloned());
    known.unwrap_or_else(|| TypeInfo::new(name, TypeHash::zero()))
}

macro_rules! messages {
    ($($name:ident { $($field:ident: $kind:ty),* $(,)? })*) => {$(
        #[derive(Clone, Debug, Default, Serialize, Deserialize)]
        pub(crate) struct $name {
            $(pub(crate) $field: $kind,)*
        }

        impl ZMessage for $name {
            type Serdes = SerdeCdrSerdes<Self>;
        }
    )*};
}

messages! {
    Time { sec: i32, nanosec: u32 }
    Header { stamp: Time, frame_id: String }
    PartReport { header: Header, part_id: String, verdict: u8, passes: u32, text: String, plan_id: String, run_id: String }
    PartStatus {
        header: Header, stage: u8, run_number: u64, run_id: String, part_id: String, pass_number: u32, operation: String, plan_id: String,
        since: Time, deadline: Time,
    }
    PlanProgress {
        header: Header, plan_id: String, touches: u32, phase: u8, share: f64, air_time: f64, given_air_time: f64, air_length: f64,
        given_air_length: f64,
    }
    RecordingStatus { header: Header, state: u8, uri: String, validity: f64 }
    StatusRequest { structure_needs_at_least_one_member: u8 }
    StatusResponse {
        header: Header, execution: u8, alarms: Vec<String>, machine_known: bool, part: PartStatus, recording: RecordingStatus,
        processes: Vec<String>, running: Vec<bool>, starts: Vec<u32>, faults: Vec<String>,
    }
    RunGoal {
        part_id: String, plan_id: String, expires: Time, operator_name: String, signed_at: Time, shown: String, signature: Vec<u8>,
    }
    RunResult { report: PartReport, text: String }
    RunFeedback { status: PartStatus }
    PlanGoal { plan_id: String, count_of_points: u32 }
    PlanResult {
        plan_id: String, touches: u32, air_time: f64, given_air_time: f64, air_length: f64, given_air_length: f64, text: String,
    }
    PlanFeedback { progress: PlanProgress }
}

/// The service `status` of a cell.
pub(crate) struct Status;

impl ZService for Status {
    type Request = StatusRequest;
    type Response = StatusResponse;
}

impl ServiceTypeInfo for Status {
    fn service_type_info() -> TypeInfo {
        announced("status")
    }
}

macro_rules! action {
    ($name:ident, $below:literal, $goal:ty, $result:ty, $feedback:ty) => {
        /// An action of a cell; its name is that below the namespace.
        pub(crate) struct $name;

        impl ZAction for $name {
            type Goal = $goal;
            type Result = $result;
            type Feedback = $feedback;

            fn name() -> &'static str {
                $below
            }

            fn send_goal_type_info() -> TypeInfo {
                announced(concat!($below, "/_action/send_goal"))
            }

            fn get_result_type_info() -> TypeInfo {
                announced(concat!($below, "/_action/get_result"))
            }

            fn cancel_goal_type_info() -> TypeInfo {
                announced(concat!($below, "/_action/cancel_goal"))
            }

            fn feedback_type_info() -> TypeInfo {
                announced(concat!($below, "/_action/feedback"))
            }

            fn status_type_info() -> TypeInfo {
                announced(concat!($below, "/_action/status"))
            }
        }
    };
}

action!(Run, "run", RunGoal, RunResult, RunFeedback);
action!(Plan, "plan", PlanGoal, PlanResult, PlanFeedback);
