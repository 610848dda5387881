//! The order that the node is making, and what for. There is one at a time.
//!
//! Each stretch of the work ([`Task`]) is a step of its own, made by a timer at once, and ends in a `plan_progress`; in
//! between the node hears everything else. What makes the answer void ends the work: any measurement that the cycle asks
//! for, a cut (but not the work on a preview), a stop and the report on the measurement that it is for. An operator who
//! waits for it is told. Another wish of an operator is refused until it is done.

use probecell_msgs::{InspectionPoint, OperationRequest};
use serde::{Deserialize, Serialize};

use crate::task::Task;

/// What an order is for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Purpose {
    /// The measurement of that request: plan and order are published.
    Measurement(u64),
    /// What is left of the last measurement, by that request: only the order is published.
    Rest(u64),
    /// An operator's request: plan and order are published.
    Preview(u64),
    /// An operator's request, and the points to be measured again: the order is told.
    Again(u64, Vec<InspectionPoint>),
    /// An operator's request: plan and order are kept until the cycle measures them.
    Further(u64),
}

impl Purpose {
    /// Number of the cycle's request.
    fn of_cycle(&self) -> Option<u64> {
        match self {
            Self::Measurement(request_id) | Self::Rest(request_id) => Some(*request_id),
            _ => None,
        }
    }

    /// Number of the operator's request.
    pub(crate) fn of_operator(&self) -> Option<u64> {
        match self {
            Self::Preview(request_id) | Self::Again(request_id, _) | Self::Further(request_id) => {
                Some(*request_id)
            }
            _ => None,
        }
    }
}

/// An order that is being made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Underway {
    /// Number of its timer: a late timer of work that was ended is no stretch of other work.
    pub number: u32,
    /// The work.
    pub task: Task,
    /// What for.
    pub purpose: Purpose,
}

impl Underway {
    /// What the cycle wants now makes it void.
    pub(crate) fn is_ended_by(&self, request: &OperationRequest) -> bool {
        match request.kind {
            OperationRequest::MEASURE => true,
            OperationRequest::CUT => !matches!(self.purpose, Purpose::Preview(_)),
            _ => self.purpose.of_cycle().is_some(),
        }
    }

    /// What came of that request makes it void.
    pub(crate) fn is_for(&self, request_id: u64) -> bool {
        self.purpose.of_cycle() == Some(request_id)
    }
}
