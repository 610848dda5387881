//! The order in the making, and what it is for. There is one at a time.
//!
//! Each slice of the work ([`Task`]) is a step of its own, triggered by a timer that is due at once, and ends in a
//! `plan_progress`; in between the node takes all other inputs. The job is cancelled by what makes its answer void: any
//! other measurement that the cycle requests, a cut (but for a preview), and for a measurement a stop or the report on it.
//! An operator who waits for it is informed. Further requests of operators are refused until it is done.

use probecell_msgs::{InspectionPoint, OperationRequest};
use serde::{Deserialize, Serialize};

use crate::task::Task;

/// What an order is for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Purpose {
    /// The measurement of that request: plan and order are published.
    Measurement(u64),
    /// The remaining points of the last measurement, by that request: only the order is published.
    Resume(u64),
    /// An operator's request: plan and order are published.
    Preview(u64),
    /// An operator's request, and the points to be measured again: the order is described in the reply.
    Repeat(u64, Vec<InspectionPoint>),
    /// An operator's request: plan and order are kept until the cycle measures them.
    Further(u64),
}

impl Purpose {
    /// Number of the cycle's request.
    fn of_cycle(&self) -> Option<u64> {
        match self {
            Self::Measurement(request_id) | Self::Resume(request_id) => Some(*request_id),
            _ => None,
        }
    }

    /// Number of the operator's request.
    pub(crate) fn of_operator(&self) -> Option<u64> {
        match self {
            Self::Preview(request_id) | Self::Repeat(request_id, _) | Self::Further(request_id) => {
                Some(*request_id)
            }
            _ => None,
        }
    }
}

/// An order in the making.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Number of its timer, so that a late timer of a cancelled job triggers no slice of another.
    pub number: u32,
    /// The work.
    pub task: Task,
    /// What for.
    pub purpose: Purpose,
}

impl Job {
    /// A request of the cycle makes it void.
    pub(crate) fn is_cancelled_by(&self, request: &OperationRequest) -> bool {
        match request.kind {
            OperationRequest::MEASURE => true,
            OperationRequest::CUT => !matches!(self.purpose, Purpose::Preview(_)),
            _ => self.purpose.of_cycle().is_some(),
        }
    }

    /// The report on that request makes it void.
    pub(crate) fn is_for(&self, request_id: u64) -> bool {
        self.purpose.of_cycle() == Some(request_id)
    }
}
