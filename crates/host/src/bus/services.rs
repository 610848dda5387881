//! Services in the format of rmw_zenoh: a complete queryable, a query to all complete ones, and an attachment that
//! comes back with the response.

use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Instant;

use zenoh::Session;
use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::query::{ConsolidationMode, Querier, Query, QueryTarget, Queryable};

use super::qos::Qos;
use super::session::{Announced, Core, ZenohBus};
use super::types::{ServiceId, TypeId};
use super::wire::{Attachment, EntityKind};
use super::{BusError, OnRequest, Request, wall_ns};

pub(super) struct ZenohServer {
    _queryable: Queryable<()>,
    _token: Option<LivelinessToken>,
}

pub(super) struct ZenohClient {
    core: Arc<Core>,
    name: String,
    ty: TypeId,
    announced: Announced,
    /// Knows whether the service can be reached; its announcement may come earlier than its declaration.
    querier: Querier<'static>,
    next: AtomicI64,
}

impl ZenohBus {
    pub(super) fn serve(
        &self,
        name: &str,
        ty: ServiceId,
        on_request: OnRequest,
    ) -> Result<ZenohServer, BusError> {
        let core = self.core();
        let queryable = core
            .session
            .declare_queryable(core.key(name, &ty.0))
            .complete(true)
            .callback(move |query| {
                if let Some(request) = request_of(query) {
                    on_request(request);
                }
            })
            .wait()
            .map_err(|reason| BusError::transport("declare a service", &reason))?;
        let announced = core.announce_channel(EntityKind::Server, name, ty.0, Qos::services())?;
        Ok(ZenohServer {
            _queryable: queryable,
            _token: announced.token,
        })
    }

    pub(super) fn client(&self, name: &str, ty: ServiceId) -> Result<ZenohClient, BusError> {
        let core = Arc::clone(self.core());
        let announced =
            core.announce_channel(EntityKind::Client, name, ty.0.clone(), Qos::services())?;
        let querier = core
            .session
            .declare_querier(core.key(name, &ty.0))
            .target(QueryTarget::AllComplete)
            .wait()
            .map_err(|reason| BusError::transport("declare a client", &reason))?;
        Ok(ZenohClient {
            core,
            name: name.to_owned(),
            ty: ty.0,
            announced,
            querier,
            next: AtomicI64::new(1),
        })
    }
}

/// The request that a query carries.
fn request_of(query: Query) -> Option<Request> {
    let payload = query.payload().map(|payload| payload.to_bytes());
    let attachment = query
        .attachment()
        .and_then(|bytes| Attachment::from_bytes(&bytes.to_bytes()));
    let (Some(payload), Some(attachment)) = (payload, attachment) else {
        tracing::warn!(key = %query.key_expr(), "a request without payload or attachment is left out");
        return None;
    };
    let payload = payload.into_owned();
    let reply = move |answer| answer_query(&query, attachment, answer);
    Some(Request {
        payload,
        reply: Box::new(reply),
    })
}

fn answer_query(query: &Query, attachment: Attachment, answer: Result<Vec<u8>, String>) {
    let sent = match answer {
        Ok(response) => query
            .reply(query.key_expr().clone(), response)
            .attachment(
                Attachment {
                    source_time_ns: wall_ns(),
                    ..attachment
                }
                .to_bytes(),
            )
            .wait(),
        Err(reason) => query.reply_err(reason).wait(),
    };
    if let Err(reason) = sent {
        tracing::error!(%reason, key = %query.key_expr(), "a response could not be sent");
    }
}

impl ZenohClient {
    /// False when there is no server by `deadline`.
    fn wait_for_server(&self, deadline: Instant) -> Result<bool, BusError> {
        let failed = |reason| BusError::transport("look for a server", &reason);
        let (sender, changes) = mpsc::channel();
        let _listener = self
            .querier
            .matching_listener()
            .callback(move |status| {
                // The wait may be over.
                sender.send(status.matching()).ok();
            })
            .wait()
            .map_err(failed)?;
        let mut served = self
            .querier
            .matching_status()
            .wait()
            .map_err(failed)?
            .matching();
        while !served {
            let left = deadline.saturating_duration_since(Instant::now());
            let Ok(change) = changes.recv_timeout(left) else {
                return Ok(false);
            };
            served = change;
        }
        Ok(true)
    }

    /// A server must be found by the instant `found`, and have answered by `deadline`.
    pub(super) fn call(
        &self,
        request: &[u8],
        found: Instant,
        deadline: Instant,
    ) -> Result<Vec<u8>, BusError> {
        let begun = Instant::now();
        let served = self.wait_for_server(found)?;
        if !served {
            return Err(BusError::NoServer {
                name: self.name.clone(),
            });
        }
        let attachment = Attachment {
            sequence: self.next.fetch_add(1, Ordering::Relaxed),
            source_time_ns: wall_ns(),
            gid: self.announced.gid,
        };
        ask(
            &self.core.session,
            (&self.name, self.core.key(&self.name, &self.ty)),
            request,
            attachment,
            (begun, deadline),
        )
    }
}

/// Sends a request to every server of a service; the answer to it that comes first, or why there is none.
pub(super) fn ask(
    session: &Session,
    (name, key): (&str, String),
    request: &[u8],
    attachment: Attachment,
    (begun, deadline): (Instant, Instant),
) -> Result<Vec<u8>, BusError> {
    let replies = session
        .get(key)
        .target(QueryTarget::AllComplete)
        .consolidation(ConsolidationMode::None)
        .payload(request)
        .attachment(attachment.to_bytes())
        .timeout(deadline.saturating_duration_since(Instant::now()))
        .wait()
        .map_err(|reason| BusError::transport("send a request", &reason))?;
    let mut refusal = None;
    while let Ok(reply) = replies.recv() {
        match reply.result() {
            Ok(sample) => {
                let echo = sample
                    .attachment()
                    .and_then(|bytes| Attachment::from_bytes(&bytes.to_bytes()));
                if echo.is_some_and(|echo| {
                    echo.sequence == attachment.sequence && echo.gid == attachment.gid
                }) {
                    return Ok(sample.payload().to_bytes().into_owned());
                }
            }
            Err(error) => {
                let text = error.payload().to_bytes();
                refusal = Some(String::from_utf8_lossy(&text).into_owned());
            }
        }
    }
    let name = name.to_owned();
    let seconds = deadline.saturating_duration_since(begun).as_secs_f64();
    Err(match refusal {
        // Zenoh itself answers so when time is up.
        Some(reason) if reason == "Timeout" => BusError::Timeout { name, seconds },
        Some(reason) => BusError::Refused { name, reason },
        None if Instant::now() >= deadline => BusError::Timeout { name, seconds },
        None => BusError::NoServer { name },
    })
}
