//! The services of a cell, as an operator's commands call them: a session for each act, gone when it is answered.

use std::cell::OnceCell;
use std::time::{Duration, Instant};

use host::bus::{Bus, BusError};
use host::private;
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{Service, ServiceType, from_cdr, srv, to_cdr};

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
        Deed::Order(request) => {
            let request = srv::ManageOrdersRequest {
                operator_name,
                ..request.clone()
            };
            let reply = cell.call::<srv::ManageOrders>("manage_orders", &request, REPLY)?;
            Ok(answer(reply.accepted, reply.text, "changed"))
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

/// The services of a cell: by its private socket, where it answers there, else by the bus, which is joined when it is needed.
struct Services<'a> {
    desk: &'a ActionEndpoint,
    bus: OnceCell<Bus>,
}

impl Services<'_> {
    fn call<S: Service>(
        &self,
        name: &str,
        request: &S::Request,
        timeout: Duration,
    ) -> Result<S::Response, String> {
        let request = to_cdr(request);
        let private = self.desk.private.as_deref();
        let answered = private.and_then(|path| private::call(path, name, &request, timeout));
        let reply = match answered {
            Some(reply) => reply,
            None => self.by_bus(name, S::TYPE, &request, timeout)?,
        };
        from_cdr(&reply).map_err(|error| format!("the reply of {name} cannot be read: {error}"))
    }

    fn by_bus(
        &self,
        name: &str,
        kind: &'static ServiceType,
        request: &[u8],
        timeout: Duration,
    ) -> Result<Vec<u8>, String> {
        let namespace = format!("/{}", self.desk.cell);
        if self.bus.get().is_none() {
            let bus = Bus::open(&(self.desk.bus)()?, NODE, &namespace);
            // No other call of this act can have opened one.
            drop(self.bus.set(bus.map_err(|error| error.to_string())?));
        }
        let bus = self.bus.get().ok_or("the cell cannot be reached")?;
        let name = format!("{namespace}/{name}");
        let reply = bus.call_with_timeouts(&name, kind, request, REPLY, timeout);
        reply.map_err(|error: BusError| error.to_string())
    }
}

fn with<T>(
    desk: &ActionEndpoint,
    work: impl FnOnce(&Services<'_>) -> Result<T, String>,
) -> Result<T, String> {
    let services = Services {
        desk,
        bus: OnceCell::new(),
    };
    let result = work(&services);
    if let Some(Err(error)) = services.bus.into_inner().map(|bus| bus.close(END)) {
        tracing::debug!(%error, "the session of an act did not end by itself");
    }
    result
}
