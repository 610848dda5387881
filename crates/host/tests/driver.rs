//! The process of a driver on a bus: what the connection publishes arrives, and what the cell sends reaches the connection.

#![expect(
    clippy::unwrap_used,
    reason = "the helpers of a test stop at the first surprise, as the test does"
)]

use std::{
    net::TcpListener,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{Sender, channel},
    },
    time::{Duration, Instant},
};

use controllers::driver::{Connection, DriverOutput};
use graph::topics;
use host::{
    SUBSCRIBED,
    bus::{Bus, BusConfig, Router, RouterConfig, TypeId},
    bus_qos, run_driver,
};
use probecell_msgs::{
    ControllerCommand, ControllerReply, InspectionPlan, MeasurementOrder, from_cdr, to_cdr,
};

/// Long enough for any machine; the test ends as soon as the answer is there.
const TIMEOUT: Duration = Duration::from_secs(20);

/// Replies to every command, and reports which messages came.
struct Toy {
    commands: Vec<ControllerCommand>,
    seen: Sender<&'static str>,
}

impl Connection for Toy {
    fn plan(&mut self, _plan: InspectionPlan) {
        self.seen.send("plan").unwrap();
    }

    fn order(&mut self, _order: MeasurementOrder) {
        self.seen.send("order").unwrap();
    }

    fn command(&mut self, command: ControllerCommand) {
        self.commands.push(command);
    }

    fn poll(&mut self, _now: i64) -> Vec<DriverOutput> {
        let replies = self.commands.drain(..).map(|command| {
            DriverOutput::Reply(ControllerReply {
                command_id: command.command_id,
                ..ControllerReply::default()
            })
        });
        replies.collect()
    }
}

#[test]
fn a_command_reaches_the_connection_and_its_reply_the_bus() {
    let probe = TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/{}", probe.local_addr().unwrap());
    drop(probe);
    let _router = Router::start(&RouterConfig {
        listen: vec![endpoint.clone()],
        ..RouterConfig::default()
    })
    .unwrap();
    let config = BusConfig {
        endpoints: vec![endpoint],
        connect_timeout: TIMEOUT,
        ..BusConfig::default()
    };
    let open = |name| Bus::open(&config, name, "/cell").unwrap();
    let (driver_bus, cell_bus) = (open("toy"), open("cell"));
    let (seen, seen_by_toy) = channel();
    let toy = Toy {
        commands: Vec::new(),
        seen,
    };
    let end = Arc::new(AtomicBool::new(false));
    let ended = Arc::clone(&end);
    let process = std::thread::spawn(move || {
        run_driver(driver_bus, Box::new(toy), "/cell", &|| {
            ended.load(Ordering::SeqCst)
        })
    });
    let (sender, replies) = channel();
    let topic = topics::CONTROLLER_REPLIES;
    let _subscription = cell_bus
        .subscribe(
            "/cell/controller_replies",
            topic.message,
            bus_qos(topic.qos),
            Box::new(move |received| {
                sender
                    .send(from_cdr::<ControllerReply>(&received.payload).unwrap())
                    .unwrap();
            }),
            Box::new(|_| {}),
        )
        .unwrap();
    let deadline = Instant::now() + TIMEOUT;
    let publishers = SUBSCRIBED.map(|topic| {
        let name = format!("/cell/{}", topic.name);
        let publisher = cell_bus.publisher(&name, TypeId::from(topic.message), bus_qos(topic.qos));
        let publisher = publisher.unwrap();
        assert!(
            cell_bus.wait_for_subscribers(&publisher, 1, deadline),
            "{name}"
        );
        publisher
    });
    let command = ControllerCommand {
        command_id: 41,
        ..ControllerCommand::default()
    };
    let messages = [
        to_cdr(&command),
        to_cdr(&InspectionPlan::default()),
        to_cdr(&MeasurementOrder::default()),
    ];
    for (publisher, message) in publishers.iter().zip(messages) {
        publisher.publish(message, 1).unwrap();
    }
    assert_eq!(replies.recv_timeout(TIMEOUT).unwrap().command_id, 41);
    let mut seen = [0; 2].map(|_| seen_by_toy.recv_timeout(TIMEOUT).unwrap());
    seen.sort_unstable();
    assert_eq!(seen, ["order", "plan"]);
    end.store(true, Ordering::SeqCst);
    process.join().unwrap().unwrap();
}
