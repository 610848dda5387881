//! Services on DDS: two topics, `rq/…Request` and `rr/…Reply`, in the two mappings that ROS 2 uses.
//!
//! *Enhanced* (Fast DDS, Connext) carries the identity of the request outside of the payload, as related sample identity.
//! *Cyclone* puts 16 bytes before the payload: half of the client's identifier, and its number of the request; the
//! server sends them back as they came.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

use rustdds::no_key::DeserializedCacheChange;
use rustdds::{GUID, RTPSEntity, SampleIdentity, SequenceNumber, WriteOptionsBuilder};

use super::super::config::DdsServices;
use super::super::graph::lock;
use super::super::qos::Qos;
use super::super::types::ServiceId;
use super::super::{BusError, OnRequest, Request, wall_ns};
use super::payload::{Payload, timestamp};
use super::{DdsBus, Discovery, Reading, Writer};

const CYCLONE_HEADER: usize = 16;

/// How long a response waits for the client's reader of responses to be found; the request may have come before.
const CLIENT_WAIT: Duration = Duration::from_secs(1);

/// Identity of a request.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum RequestId {
    Enhanced(SampleIdentity),
    Cyclone([u8; CYCLONE_HEADER]),
}

pub(in super::super) struct DdsServer {
    _reading: Reading,
}

pub(in super::super) struct DdsClient {
    name: String,
    mapping: DdsServices,
    discovery: Arc<Discovery>,
    writer: Arc<Writer>,
    reader: GUID,
    next: AtomicI64,
    waiting: Arc<Mutex<Waiting>>,
    _reading: Reading,
}

/// Calls under way.
type Waiting = BTreeMap<RequestId, mpsc::Sender<Vec<u8>>>;

impl DdsBus {
    pub(in super::super) fn serve(
        &self,
        name: &str,
        ty: &ServiceId,
        on_request: OnRequest,
    ) -> Result<DdsServer, BusError> {
        let (requests, replies) = self.service_topics(name, ty)?;
        let writer = self.writer(&replies)?;
        let mapping = self.services;
        let discovery = Arc::clone(&self.discovery);
        let name = name.to_owned();
        let reading = Reading::start(self.reader(&requests)?, move |change| {
            let Some((id, payload)) = request_of(mapping, &change) else {
                tracing::warn!(service = name, "a request without identity is left out");
                return;
            };
            let (writer, discovery) = (Arc::clone(&writer), Arc::clone(&discovery));
            let (name, client) = (name.clone(), change.writer_guid);
            let answer = move |answer: Result<Vec<u8>, String>| {
                let answered = answer.and_then(|response| {
                    let deadline = Instant::now() + CLIENT_WAIT;
                    discovery.wait_for_reader_beside(writer.guid(), client, deadline);
                    reply(&writer, id, response).map_err(|reason| reason.to_string())
                });
                if let Err(reason) = answered {
                    // DDS has no way to refuse: the client runs into its timeout.
                    tracing::error!(service = name, reason, "a request is not answered");
                }
            };
            on_request(Request {
                payload,
                reply: Box::new(answer),
            });
        })?;
        Ok(DdsServer { _reading: reading })
    }

    pub(in super::super) fn client(
        &self,
        name: &str,
        ty: &ServiceId,
    ) -> Result<DdsClient, BusError> {
        let (requests, replies) = self.service_topics(name, ty)?;
        let writer = self.writer(&requests)?;
        let mapping = self.services;
        let waiting = Arc::new(Mutex::new(Waiting::default()));
        let reader = self.reader(&replies)?;
        let reader_guid = reader.guid();
        let reading = Reading::start(reader, {
            let waiting = Arc::clone(&waiting);
            move |change| {
                // The lock is held by a call that is being sent, so that no reply overtakes its identity.
                if let Some((id, response)) = response_of(mapping, &change)
                    && let Some(call) = lock(&waiting).remove(&id)
                {
                    // The caller may have run into its timeout meanwhile.
                    drop(call.send(response));
                }
            }
        })?;
        Ok(DdsClient {
            name: name.to_owned(),
            mapping,
            discovery: Arc::clone(&self.discovery),
            writer,
            reader: reader_guid,
            next: AtomicI64::new(1),
            waiting,
            _reading: reading,
        })
    }

    fn service_topics(
        &self,
        name: &str,
        ty: &ServiceId,
    ) -> Result<(rustdds::Topic, rustdds::Topic), BusError> {
        let qos = Qos::services();
        let ty = ty.0.dds_name();
        Ok((
            self.topic("rq", name, "Request", &format!("{ty}Request_"), qos)?,
            self.topic("rr", name, "Reply", &format!("{ty}Response_"), qos)?,
        ))
    }
}

fn request_of(
    mapping: DdsServices,
    change: &DeserializedCacheChange<Payload>,
) -> Option<(RequestId, Vec<u8>)> {
    match mapping {
        DdsServices::Enhanced => {
            let own = SampleIdentity {
                writer_guid: change.writer_guid,
                sequence_number: change.sequence_number,
            };
            let mut id = change.related_sample_identity().unwrap_or(own);
            // Fast DDS names itself there, but leaves the number open.
            if id.sequence_number == SequenceNumber::UNKNOWN {
                id.sequence_number = change.sequence_number;
            }
            Some((RequestId::Enhanced(id), change.sample.with_header()))
        }
        DdsServices::Cyclone => {
            let (front, request) = change.sample.split_front()?;
            Some((RequestId::Cyclone(front), request))
        }
    }
}

fn response_of(
    mapping: DdsServices,
    change: &DeserializedCacheChange<Payload>,
) -> Option<(RequestId, Vec<u8>)> {
    match mapping {
        DdsServices::Enhanced => Some((
            RequestId::Enhanced(change.related_sample_identity()?),
            change.sample.with_header(),
        )),
        DdsServices::Cyclone => {
            let (front, response) = change.sample.split_front()?;
            Some((RequestId::Cyclone(front), response))
        }
    }
}

fn reply(writer: &Writer, id: RequestId, response: Vec<u8>) -> Result<(), BusError> {
    let options = WriteOptionsBuilder::new().source_timestamp(timestamp(wall_ns()));
    let (payload, options) = match id {
        RequestId::Enhanced(id) => (
            Payload::from_cdr(response)?,
            options.related_sample_identity(id),
        ),
        RequestId::Cyclone(front) => (Payload::from_parts(&response, &front)?, options),
    };
    writer
        .write_with_options(payload, options.build())
        .map_err(|reason| BusError::transport("send a response", &reason.forget_data()))?;
    Ok(())
}

impl DdsClient {
    pub(in super::super) fn call(
        &self,
        request: &[u8],
        found: Instant,
        deadline: Instant,
    ) -> Result<Vec<u8>, BusError> {
        let begun = Instant::now();
        let served = self.discovery.wait_for_writer(self.reader, found)
            && self
                .discovery
                .wait_for_readers(self.writer.guid(), 1, found);
        if !served {
            return Err(BusError::NoServer {
                name: self.name.clone(),
            });
        }
        let (sender, receiver) = mpsc::channel();
        let id = self.send(request, sender)?;
        let left = deadline.saturating_duration_since(Instant::now());
        receiver.recv_timeout(left).map_err(|_| {
            lock(&self.waiting).remove(&id);
            BusError::Timeout {
                name: self.name.clone(),
                seconds: deadline.saturating_duration_since(begun).as_secs_f64(),
            }
        })
    }

    fn send(&self, request: &[u8], call: mpsc::Sender<Vec<u8>>) -> Result<RequestId, BusError> {
        let mut front = [0; CYCLONE_HEADER];
        let payload = match self.mapping {
            DdsServices::Enhanced => Payload::from_cdr(request.to_vec())?,
            DdsServices::Cyclone => {
                let number = self.next.fetch_add(1, Ordering::Relaxed);
                front[..8].copy_from_slice(&self.writer.guid().to_bytes()[8..]);
                front[8..].copy_from_slice(&number.to_le_bytes());
                Payload::from_parts(request, &front)?
            }
        };
        let options = WriteOptionsBuilder::new()
            .source_timestamp(timestamp(wall_ns()))
            .build();
        let mut waiting = lock(&self.waiting);
        let sent = self
            .writer
            .write_with_options(payload, options)
            .map_err(|reason| BusError::transport("send a request", &reason.forget_data()))?;
        let id = match self.mapping {
            DdsServices::Enhanced => RequestId::Enhanced(sent),
            DdsServices::Cyclone => RequestId::Cyclone(front),
        };
        waiting.insert(id, call);
        Ok(id)
    }
}
