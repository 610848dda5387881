//! The bus as a robot's driver sees it: topics and services of nodes that are not the cell's.

use std::{
    any::Any,
    sync::Arc,
    time::{Duration, Instant},
};

use controllers::driver::{ConnectError, RosBus, RosSample, RosService, RosType};
use tracing::error;

use crate::bus::{Bus, Client, Lost, Qos, Received, ServiceId, TypeId};

/// Depth of a subscription to topics of a robot.
const DEPTH: usize = 100;

impl RosBus for Bus {
    fn subscribe(
        &self,
        topic: &str,
        ty: RosType,
        reliable: bool,
        on_sample: Box<dyn Fn(RosSample<'_>) + Send + Sync>,
    ) -> Result<Box<dyn Any>, ConnectError> {
        let qos = if reliable {
            Qos::reliable(DEPTH)
        } else {
            Qos::best_effort(DEPTH)
        };
        let name = topic.to_owned();
        let subscription = Bus::subscribe(
            self,
            topic,
            TypeId::new(ty.dds_name, ty.type_hash),
            qos,
            Box::new(move |received: Received<'_>| {
                on_sample(RosSample {
                    payload: &received.payload,
                    source_time: received.source_time_ns,
                    arrival: Instant::now(),
                    publisher: received.publisher,
                });
            }),
            Box::new(move |lost: Lost| {
                if reliable {
                    error!("lost {} messages on {name}", lost.count);
                }
            }),
        )?;
        Ok(Box::new(subscription))
    }

    fn service(&self, service: &str, ty: RosType) -> Result<Arc<dyn RosService>, ConnectError> {
        let id = ServiceId::new(ty.dds_name, ty.type_hash);
        Ok(Arc::new(Bus::client(self, service, id)?))
    }
}

impl RosService for Client {
    fn call(&self, request: &[u8], found: Duration, answered: Duration) -> Result<Vec<u8>, String> {
        self.call_with_timeouts(request, found, answered)
            .map_err(|error| error.to_string())
    }
}
