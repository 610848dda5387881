//! A node hears nothing that the recorder does not: others may publish before either of them is there.

#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::{
    collections::BTreeMap,
    net::TcpListener,
    sync::mpsc::{Sender, channel},
    time::{Duration, Instant},
};

use graph::{DeliverError, Emitted, Instance, RestoreError, Stamp, Topic, topics};
use host::{
    NodeProcess,
    bus::{Bus, BusConfig, Router, RouterConfig},
    bus_qos, run_node,
};
use probecell_msgs::{ControllerStatus, Message, from_cdr, to_cdr};

use crate::common::PATIENCE;

/// Wait in which a node would subscribe that waits for nobody.
const NOBODY: Duration = Duration::from_secs(2);

/// Passes the programs of the samples on that it takes.
struct Listener(Sender<String>);

impl Instance for Listener {
    fn name(&self) -> &'static str {
        "listener"
    }

    fn inputs(&self) -> &'static [Topic] {
        const { &[topics::CONTROLLER_STATUS] }
    }

    fn outputs(&self) -> &'static [Topic] {
        &[]
    }

    fn fault_codes(&self) -> Vec<&'static str> {
        Vec::new()
    }

    fn deliver(&mut self, _: Stamp, _: usize, cdr: &[u8]) -> Result<Emitted, DeliverError> {
        let sample: ControllerStatus = from_cdr(cdr).unwrap();
        self.0.send(sample.program).unwrap();
        Ok(Emitted::default())
    }

    fn timer(&mut self, _: Stamp, _: u32) -> Emitted {
        Emitted::default()
    }

    fn snapshot(&self) -> serde_json::Value {
        serde_json::Value::Null
    }

    fn restore(&mut self, _: serde_json::Value) -> Result<(), RestoreError> {
        Ok(())
    }
}

#[test]
fn a_node_hears_a_driver_that_publishes_already_only_after_the_recorder() {
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr();
    let endpoint = format!("tcp/{}", free.unwrap());
    let router = RouterConfig {
        listen: vec![endpoint.clone()],
        ..RouterConfig::default()
    };
    let router = Router::start(&router).unwrap();
    let config = BusConfig {
        endpoints: vec![endpoint],
        ..BusConfig::default()
    };
    let open = |name: &str| Bus::open(&config, name, "/cell").unwrap();
    let topic = topics::CONTROLLER_STATUS;
    let driver = open("driver");
    let publisher = driver
        .publisher("/cell/controller_status", topic.message, bus_qos(topic.qos))
        .unwrap();
    let publish = |program: &str| {
        let sample = ControllerStatus {
            program: program.to_owned(),
            ..ControllerStatus::default()
        };
        publisher.publish(to_cdr(&sample), 0).unwrap();
    };
    assert_eq!(topic.message.name, ControllerStatus::TYPE.name);

    let journal = topics::journal_name("listener");
    let settings = NodeProcess {
        namespace: "/cell".to_owned(),
        incarnation: 0,
        awaited: BTreeMap::from([(topic.name.to_owned(), 2), (journal.clone(), 1)]),
    };
    let (taken, received) = channel();
    let (stops, stop) = channel();
    let of_listener = config.clone();
    let node = std::thread::spawn(move || {
        let bus = Bus::open(&of_listener, "listener", "/cell")?;
        run_node(bus, Box::new(Listener(taken)), &settings, move |stop| {
            stops.send(stop).unwrap();
        })
    });
    let stop = stop.recv_timeout(PATIENCE).unwrap();
    assert!(
        !driver.wait_for_subscribers(&publisher, 1, Instant::now() + NOBODY),
        "it subscribes although nobody records"
    );
    publish("before the recorder");

    let recorder = open("recorder");
    let (heard, recorded) = channel();
    let of_driver = recorder
        .subscribe(
            "/cell/controller_status",
            topic.message,
            bus_qos(topic.qos),
            Box::new(move |sample| {
                let sample: ControllerStatus = from_cdr(&sample.payload).unwrap();
                heard.send(sample.program).unwrap();
            }),
            Box::new(|_| {}),
        )
        .unwrap();
    let (message, qos) = topics::JOURNAL;
    let of_node = recorder
        .subscribe(
            &format!("/cell/{journal}"),
            message,
            bus_qos(qos),
            Box::new(|_| {}),
            Box::new(|_| {}),
        )
        .unwrap();
    assert!(driver.wait_for_subscribers(&publisher, 2, Instant::now() + PATIENCE));
    publish("after it");
    assert_eq!(received.recv_timeout(PATIENCE).unwrap(), "after it");
    assert_eq!(recorded.recv_timeout(PATIENCE).unwrap(), "after it");

    stop.stop();
    node.join().unwrap().unwrap();
    drop((of_driver, of_node));
    recorder.close(PATIENCE).unwrap();
    driver.close(PATIENCE).unwrap();
    router.close().unwrap();
}
