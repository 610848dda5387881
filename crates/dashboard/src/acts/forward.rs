//! The services of a cell, as an operator's commands call them: a session for each act, gone when it is answered.

use std::time::{Duration, Instant};

use host::bus::{Bus, BusError};
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{Service, from_cdr, srv, to_cdr};

use super::{ActionEndpoint, Answer, Deed, Signed};

/// Timeout of a service, longer than a cell waits for its nodes.
const REPLY: Duration = Duration::from_secs(15);
/// Planning that takes longer starts nothing: whoever asked may have left.
const PLANNING: Duration = Duration::from_secs(300);
/// Time in which a session ends.
const END: Duration = Duration::from_secs(2);
/// Name of its node, that of an operator's command.
const NODE: &str = "operator_call";

/// The instant by the clock of the cell.
pub(super) fn clock_of(desk: &ActionEndpoint) -> Result<Time, String> {
    with(desk, |cell| {
        let status = cell.call::<srv::Status>("status", &srv::StatusRequest::default(), REPLY)?;
        Ok(status.header.stamp)
    })
}

/// Hands a signed act to the cell.
pub(super) fn forward(
    desk: &ActionEndpoint,
    deed: &Deed,
    at: Time,
    signed: &Signed,
    signature: Vec<u8>,
) -> Result<Answer, String> {
    let (operator_name, shown) = (signed.operator.clone(), signed.shown.clone());
    with(desk, |cell| match deed {
        Deed::Answer {
            correction,
            approve,
        } => {
            let request = srv::ApproveCorrectionRequest {
                correction_id: correction.clone(),
                operator_name,
                approve: *approve,
                signed_at: at,
                shown,
                signature,
            };
            let reply =
                cell.call::<srv::ApproveCorrection>("approve_correction", &request, REPLY)?;
            Ok(answer(reply.accepted, reply.text, "accepted"))
        }
        Deed::Stop => {
            let request = srv::StopRequest {
                operator_name,
                signed_at: at,
                shown,
                signature,
            };
            let reply = cell.call::<srv::Stop>("stop", &request, REPLY)?;
            Ok(answer(reply.accepted, reply.text, "the machine stands"))
        }
        Deed::Make { part } => {
            let request = srv::RunRequest {
                part_id: part.clone(),
                operator_name,
                signed_at: at,
                shown,
                signature,
                ..srv::RunRequest::default()
            };
            let reply = cell.call::<srv::Run>("run", &request, REPLY)?;
            Ok(answer(reply.accepted, reply.text, "begun"))
        }
        Deed::Touch { part, plan, points } => {
            let begun = Instant::now();
            let request = srv::PlanRequest {
                plan_id: plan.clone(),
                points: points.clone(),
            };
            let planned = cell.call::<srv::Plan>("plan", &request, PLANNING)?;
            if !planned.accepted {
                return Ok(answer(false, planned.text, ""));
            }
            if begun.elapsed() > PLANNING {
                return Err("planning took too long: nothing was begun".to_owned());
            }
            let request = srv::RunRequest {
                part_id: part.clone(),
                plan_id: plan.clone(),
                operator_name,
                signed_at: at,
                shown,
                signature,
                ..srv::RunRequest::default()
            };
            let reply = cell.call::<srv::Run>("run", &request, REPLY)?;
            Ok(answer(reply.accepted, reply.text, "begun"))
        }
    })
}

fn answer(accepted: bool, text: String, otherwise: &str) -> Answer {
    let text = if text.is_empty() {
        otherwise.to_owned()
    } else {
        text
    };
    Answer { accepted, text }
}

struct Services<'a> {
    bus: &'a Bus,
    cell: &'a str,
}

impl Services<'_> {
    fn call<S: Service>(
        &self,
        name: &str,
        request: &S::Request,
        timeout: Duration,
    ) -> Result<S::Response, String> {
        let name = format!("/{}/{name}", self.cell);
        let reply = self
            .bus
            .call_with_timeouts(&name, S::TYPE, &to_cdr(request), REPLY, timeout);
        let reply = reply.map_err(|error: BusError| error.to_string())?;
        from_cdr(&reply).map_err(|error| format!("the reply of {name} cannot be read: {error}"))
    }
}

fn with<T>(
    desk: &ActionEndpoint,
    work: impl FnOnce(&Services<'_>) -> Result<T, String>,
) -> Result<T, String> {
    let namespace = format!("/{}", desk.cell);
    let bus = Bus::open(&(desk.bus)()?, NODE, &namespace).map_err(|error| error.to_string())?;
    let result = work(&Services {
        bus: &bus,
        cell: &desk.cell,
    });
    if let Err(error) = bus.close(END) {
        tracing::debug!(%error, "the session of an act did not end by itself");
    }
    result
}
