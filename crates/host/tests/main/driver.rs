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

use controllers::driver::{Connection, DriverOutput, Inbox};
use graph::topics;
use host::{
    SUBSCRIBED,
    bus::{Bus, BusConfig, Router, RouterConfig, TypeId},
    bus_qos, run_driver,
};
use probecell_msgs::{
    ControllerCommand, ControllerReply, GateHeartbeat, InspectionPlan, MeasurementOrder, from_cdr,
    to_cdr,
};

/// Long enough for any machine; the test ends as soon as the answer is there.
const TIMEOUT: Duration = Duration::from_secs(20);

/// Replies to every command, and reports which messages came.
struct Toy {
    inbox: Inbox,
    seen: Sender<&'static str>,
    stopped: Sender<String>,
}

impl Connection for Toy {
    fn inbox(&mut self) -> &mut Inbox {
        &mut self.inbox
    }

    fn poll(&mut self, _now: i64) -> Vec<DriverOutput> {
        let Inbox {
            plan,
            order,
            commands,
            stop,
        } = std::mem::take(&mut self.inbox);
        let plan = plan.map(|_| "plan");
        let order = order.map(|_| "order");
        let came = commands.iter().map(|_| "command");
        // Nobody listens in the tests that are not about it.
        for seen in plan.into_iter().chain(order).chain(came) {
            self.seen.send(seen).unwrap_or_default();
        }
        if let Some(why) = stop {
            drop(self.stopped.send(why));
        }
        let replies = commands.into_iter().map(|command| {
            DriverOutput::Reply(ControllerReply {
                command_id: command.command_id,
                ..ControllerReply::default()
            })
        });
        replies.collect()
    }
}

/// A bus of its own; opens sessions on it.
fn bus() -> (Router, BusConfig) {
    let probe = TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/{}", probe.local_addr().unwrap());
    drop(probe);
    let router = Router::start(&RouterConfig {
        listen: vec![endpoint.clone()],
        ..RouterConfig::default()
    });
    let config = BusConfig {
        endpoints: vec![endpoint],
        connect_timeout: TIMEOUT,
        ..BusConfig::default()
    };
    (router.unwrap(), config)
}

#[test]
fn what_is_under_way_is_stopped_when_the_gate_leaves_the_bus_and_when_it_falls_silent() {
    let (_router, config) = bus();
    let open = |name| Bus::open(&config, name, "/cell").unwrap();
    let (driver_bus, gate_bus, beat_bus) = (open("toy"), open("gate"), open("heart"));
    let (seen, seen_by_toy) = channel();
    let (stopped, stops) = channel();
    let toy = Toy {
        inbox: Inbox::default(),
        seen,
        stopped,
    };
    let (end, beating) = (
        Arc::new(AtomicBool::new(false)),
        Arc::new(AtomicBool::new(true)),
    );
    let ended = Arc::clone(&end);
    let driver = std::thread::spawn(move || {
        run_driver(driver_bus, Box::new(toy), "/cell", &|| {
            ended.load(Ordering::SeqCst)
        })
    });
    let deadline = Instant::now() + TIMEOUT;
    let publisher = |bus: &Bus, topic: graph::Topic| {
        let name = format!("/cell/{}", topic.name);
        let publisher = bus.publisher(&name, TypeId::from(topic.message), bus_qos(topic.qos));
        let publisher = publisher.unwrap();
        assert!(bus.wait_for_subscribers(&publisher, 1, deadline), "{name}");
        publisher
    };
    let commands = publisher(&gate_bus, topics::CONTROLLER_COMMANDS);
    let beats = publisher(&beat_bus, topics::GATE_HEARTBEAT);
    let still = Arc::clone(&beating);
    let heart = std::thread::spawn(move || {
        let mut count = 0;
        while still.load(Ordering::SeqCst) {
            count += 1;
            let beat = GateHeartbeat {
                started: 1,
                count,
                ..GateHeartbeat::default()
            };
            beats.publish(to_cdr(&beat), 1).unwrap();
            std::thread::sleep(Duration::from_millis(50));
        }
    });
    let until = |wanted: &str| {
        while !stops.recv_timeout(TIMEOUT).unwrap().contains(wanted) {}
    };
    until("has fallen silent");
    let command = to_cdr(&ControllerCommand::default());
    commands.publish(command, 1).unwrap();
    assert_eq!(seen_by_toy.recv_timeout(TIMEOUT), Ok("command"));
    // Its signs of life go on, but the process that commands is gone.
    drop(commands);
    gate_bus.close(TIMEOUT).unwrap();
    until("has left the bus");
    beating.store(false, Ordering::SeqCst);
    heart.join().unwrap();
    until("has fallen silent");
    end.store(true, Ordering::SeqCst);
    driver.join().unwrap().unwrap();
    until("the driver was ended");
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
    let (stopped, _) = channel();
    let toy = Toy {
        inbox: Inbox::default(),
        seen,
        stopped,
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
        to_cdr(&GateHeartbeat::default()),
        to_cdr(&InspectionPlan::default()),
        to_cdr(&MeasurementOrder::default()),
    ];
    for (publisher, message) in publishers.iter().zip(messages) {
        publisher.publish(message, 1).unwrap();
    }
    assert_eq!(replies.recv_timeout(TIMEOUT).unwrap().command_id, 41);
    let mut seen = [0; 3].map(|_| seen_by_toy.recv_timeout(TIMEOUT).unwrap());
    seen.sort_unstable();
    assert_eq!(seen, ["command", "order", "plan"]);
    end.store(true, Ordering::SeqCst);
    process.join().unwrap().unwrap();
}
