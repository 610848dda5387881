//! Nodes on a loopback router of their own: delivery, late joiners, recovery, services, graph.

#![expect(
    clippy::unwrap_used,
    reason = "the helpers of a test stop at the first surprise, as the test does"
)]

use std::net::TcpListener;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use host::bus::{
    Bus, BusConfig, BusError, Durability, EntityKind, Followed, Lost, OnLost, OnSample, Qos,
    Router, RouterConfig, ServiceId, TypeId,
};

/// Long enough for any machine; a test ends as soon as what it waits for is there.
const PATIENCE: Duration = Duration::from_secs(20);

const STRING: &str = "std_msgs::msg::dds_::String_";
const HASH: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";

fn string() -> TypeId {
    TypeId::new(STRING, HASH)
}

/// A cell of its own: a router on a free port.
struct Cell {
    endpoint: String,
    _router: Router,
}

impl Cell {
    fn start() -> Self {
        let port = TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap()
            .port();
        let endpoint = format!("tcp/127.0.0.1:{port}");
        let router = Router::start(&RouterConfig {
            listen: vec![endpoint.clone()],
            ..RouterConfig::default()
        })
        .unwrap();
        Self {
            endpoint,
            _router: router,
        }
    }

    fn config(&self) -> BusConfig {
        BusConfig {
            endpoints: vec![self.endpoint.clone()],
            connect_timeout: PATIENCE,
            ..BusConfig::default()
        }
    }

    fn node(&self, name: &str) -> Bus {
        Bus::open(&self.config(), name, "/cell").unwrap()
    }
}

#[derive(Debug, PartialEq, Eq)]
enum Event {
    Sample(u64, Vec<u8>, i64),
    Lost(Lost),
}

/// Callbacks that hand everything to a queue.
fn queue() -> (OnSample, OnLost, Receiver<Event>) {
    let (sender, events) = mpsc::channel();
    let lost = sender.clone();
    (
        Box::new(move |sample| {
            sender
                .send(Event::Sample(
                    sample.sequence,
                    sample.payload.into_owned(),
                    sample.source_time_ns,
                ))
                .unwrap();
        }),
        Box::new(move |report| lost.send(Event::Lost(report)).unwrap()),
        events,
    )
}

fn message(number: u64) -> Vec<u8> {
    let mut cdr = vec![0, 1, 0, 0];
    cdr.extend(number.to_le_bytes());
    cdr
}

fn sample(number: u64) -> Event {
    Event::Sample(number, message(number), number as i64 * 1000)
}

fn deadline() -> Instant {
    Instant::now() + PATIENCE
}

/// What `from` has published so far has gone where it goes: a message of its own, published after it, has come to `to`.
fn settle(from: &Bus, to: &Bus, topic: &str) {
    let (on_sample, on_lost, events) = queue();
    let _subscription = to
        .subscribe(topic, string(), Qos::events(), on_sample, on_lost)
        .unwrap();
    let publisher = from.publisher(topic, string(), Qos::events()).unwrap();
    assert!(from.wait_for_subscribers(&publisher, 1, deadline()));
    publisher.publish(message(1), 1000).unwrap();
    assert_eq!(events.recv_timeout(PATIENCE).unwrap(), sample(1));
}

#[test]
fn every_message_arrives_once_and_in_order() {
    let cell = Cell::start();
    let (a, b) = (cell.node("a"), cell.node("b"));
    let (on_sample, on_lost, events) = queue();
    let _subscription = b
        .subscribe("/cell/events", string(), Qos::events(), on_sample, on_lost)
        .unwrap();
    let publisher = a
        .publisher("/cell/events", string(), Qos::events())
        .unwrap();
    assert!(a.wait_for_subscribers(&publisher, 1, deadline()));
    for number in 1..=5000 {
        assert_eq!(
            publisher
                .publish(message(number), number as i64 * 1000)
                .unwrap(),
            number
        );
    }
    for number in 1..=5000 {
        assert_eq!(events.recv_timeout(PATIENCE).unwrap(), sample(number));
    }
}

#[test]
fn closing_delivers_what_was_published() {
    let cell = Cell::start();
    let (a, b) = (cell.node("a"), cell.node("b"));
    let (on_sample, on_lost, events) = queue();
    let _subscription = b
        .subscribe("/cell/events", string(), Qos::events(), on_sample, on_lost)
        .unwrap();
    let publisher = a
        .publisher("/cell/events", string(), Qos::events())
        .unwrap();
    assert!(a.wait_for_subscribers(&publisher, 1, deadline()));
    for number in 1..=8_000 {
        publisher
            .publish(message(number), number as i64 * 1000)
            .unwrap();
    }
    a.close(PATIENCE).unwrap();
    for number in 1..=8_000 {
        assert_eq!(events.recv_timeout(PATIENCE).unwrap(), sample(number));
    }
    assert!(publisher.publish(message(0), 0).is_err());
}

#[test]
fn a_late_joiner_of_a_latched_topic_gets_exactly_the_last_samples() {
    let cell = Cell::start();
    let (a, b) = (cell.node("a"), cell.node("b"));
    for depth in [1, 3] {
        let topic = format!("/cell/latched_{depth}");
        let publisher = a.publisher(&topic, string(), Qos::latched(depth)).unwrap();
        for number in 1..=7 {
            publisher
                .publish(message(number), number as i64 * 1000)
                .unwrap();
        }
        settle(&a, &b, &format!("/cell/settled_{depth}"));
        let (on_sample, on_lost, events) = queue();
        let _subscription = b
            .subscribe(&topic, string(), Qos::latched(depth), on_sample, on_lost)
            .unwrap();
        assert!(a.wait_for_subscribers(&publisher, 1, deadline()));
        for number in 8 - depth as u64..=7 {
            assert_eq!(events.recv_timeout(PATIENCE).unwrap(), sample(number));
        }
        // What comes next is the next one published, hence nothing came twice.
        publisher.publish(message(8), 8000).unwrap();
        assert_eq!(events.recv_timeout(PATIENCE).unwrap(), sample(8));
    }
}

#[test]
fn a_late_joiner_of_a_volatile_topic_gets_only_what_follows() {
    let cell = Cell::start();
    let (a, b) = (cell.node("a"), cell.node("b"));
    let publisher = a
        .publisher("/cell/events", string(), Qos::events())
        .unwrap();
    for number in 1..=5 {
        publisher
            .publish(message(number), number as i64 * 1000)
            .unwrap();
    }
    settle(&a, &b, "/cell/settled");
    let (on_sample, on_lost, events) = queue();
    let _subscription = b
        .subscribe("/cell/events", string(), Qos::events(), on_sample, on_lost)
        .unwrap();
    assert!(a.wait_for_subscribers(&publisher, 1, deadline()));
    // Two heartbeats long nothing may come of what is past.
    assert_eq!(
        events.recv_timeout(Duration::from_millis(1100)),
        Err(RecvTimeoutError::Timeout)
    );
    publisher.publish(message(6), 6000).unwrap();
    assert_eq!(events.recv_timeout(PATIENCE).unwrap(), sample(6));
}

#[test]
fn services_answer_refuse_and_are_missed() {
    let cell = Cell::start();
    let (a, b) = (cell.node("a"), cell.node("b"));
    let ty = ServiceId::new("probecell_msgs::srv::dds_::Plan_", HASH);
    let missing = b.call(
        "/cell/plan",
        ty.clone(),
        &message(1),
        Duration::from_millis(50),
    );
    assert!(matches!(missing, Err(BusError::NoServer { .. })));
    let server = a
        .serve(
            "/cell/plan",
            ty.clone(),
            Box::new(|request| {
                let number = u64::from_le_bytes(request[4..].try_into().unwrap());
                if number == 13 {
                    Err("13 is not allowed".to_owned())
                } else {
                    Ok(message(number + 1))
                }
            }),
        )
        .unwrap();
    let client = b.client("/cell/plan", ty.clone()).unwrap();
    for number in [1, 2, 41] {
        assert_eq!(
            client.call(&message(number), PATIENCE).unwrap(),
            message(number + 1)
        );
    }
    match client.call(&message(13), PATIENCE) {
        Err(BusError::Refused { reason, .. }) => assert_eq!(reason, "13 is not allowed"),
        other => panic!("{other:?}"),
    }
    let graph = b.graph();
    assert_eq!(
        graph.services(),
        vec![(
            "/cell/plan".to_owned(),
            TypeId::new("probecell_msgs::srv::dds_::Plan_", HASH)
        )]
    );
    drop(server);
}

#[test]
fn the_graph_shows_nodes_topics_and_types() {
    let cell = Cell::start();
    let (a, b) = (cell.node("a"), cell.node("b"));
    let publisher = a
        .publisher("/cell/events", string(), Qos::events())
        .unwrap();
    let (on_sample, on_lost, _events) = queue();
    let subscription = b
        .subscribe(
            "/cell/events",
            string(),
            Qos::reliable(10),
            on_sample,
            on_lost,
        )
        .unwrap();
    assert!(a.wait_for_subscribers(&publisher, 1, deadline()));
    let graph = a.graph();
    assert_eq!(graph.nodes(), ["/cell/a", "/cell/b"]);
    let topics = graph.topics();
    assert_eq!(topics.len(), 1);
    assert_eq!(topics[0].name, "/cell/events");
    assert_eq!(topics[0].ty.ros_name(), "std_msgs/msg/String");
    assert_eq!(topics[0].offered, [Qos::events()]);
    assert_eq!(topics[0].subscriptions, 1);
    let offered = graph
        .entities()
        .iter()
        .find(|entity| entity.kind == EntityKind::Publisher)
        .unwrap();
    assert_eq!(offered.gid(), publisher.gid());
    drop(subscription);
    assert!(!a.wait_for_subscribers(&publisher, 2, Instant::now()));
}

#[test]
fn a_session_follows_what_it_is_to_follow() {
    let cell = Cell::start();
    let open = |graph, name, namespace| {
        let config = BusConfig {
            graph,
            ..cell.config()
        };
        Bus::open(&config, name, namespace).unwrap()
    };
    let nothing = open(Followed::Nothing, "nothing", "/cell");
    let own = open(Followed::OwnTopics, "own", "/cell");
    let topics = open(Followed::Topics, "topics", "/cell");
    let all = open(Followed::Domain, "all", "/cell");
    let ty = ServiceId::new("probecell_msgs::srv::dds_::Plan_", HASH);
    let _client = all.client("/cell/plan", ty).unwrap();
    let near = all.publisher("/cell/near", string(), Qos::events());
    let elsewhere = open(Followed::Nothing, "elsewhere", "/other");
    let far = elsewhere.publisher("/other/far", string(), Qos::events());
    let count = |bus: &Bus| {
        let graph = bus.graph();
        (graph.entities().len(), graph.topics().len())
    };
    // Five nodes, a client, two publishers; tokens of one session may come in any order.
    let begun = Instant::now();
    while count(&all) != (8, 2) || count(&topics) != (2, 2) || count(&own) != (1, 1) {
        assert!(
            begun.elapsed() < PATIENCE,
            "{:?} {:?} {:?}",
            all.graph(),
            topics.graph(),
            own.graph()
        );
        std::thread::yield_now();
    }
    assert_eq!(own.graph().topics()[0].name, "/cell/near");
    assert_eq!(count(&nothing), (0, 0));
    assert_eq!(all.graph().sessions_of("/cell/own"), 1);
    assert_eq!(topics.graph().sessions_of("/cell/all"), 1);
    drop((near, far));
}

/// Zenoh keeps some KiB of every announcement that has ended (1.10.2), so commands that come and go make none.
#[test]
fn a_visitor_calls_a_service_and_reads_a_topic_without_being_announced() {
    let cell = Cell::start();
    let a = cell.node("a");
    let ty = ServiceId::new("probecell_msgs::srv::dds_::Plan_", HASH);
    let _server = a
        .serve(
            "/cell/plan",
            ty.clone(),
            Box::new(|request| Ok(request.to_vec())),
        )
        .unwrap();
    let latched = Qos {
        durability: Durability::TransientLocal,
        ..Qos::reliable(1)
    };
    let publisher = a.publisher("/cell/kept", string(), latched).unwrap();
    publisher.publish(message(1), 1000).unwrap();
    let visitor = BusConfig {
        graph: Followed::Nothing,
        announced: false,
        ..cell.config()
    };
    let visitor = Bus::open(&visitor, "visitor", "/cell").unwrap();
    let client = visitor.client("/cell/plan", ty).unwrap();
    assert_eq!(client.call(&message(7), PATIENCE).unwrap(), message(7));
    let (on_sample, on_lost, events) = queue();
    let _subscription = visitor
        .subscribe("/cell/kept", string(), latched, on_sample, on_lost)
        .unwrap();
    assert_eq!(events.recv_timeout(PATIENCE).unwrap(), sample(1));
    // What is announced later is there: so would be what was announced before it.
    let b = cell.node("b");
    while a.graph().nodes() != ["/cell/a", "/cell/b"] {
        std::thread::yield_now();
    }
    assert_eq!(a.graph().sessions_of("/cell/visitor"), 0);
    drop(b);
}

#[test]
fn domains_do_not_hear_one_another() {
    let cell = Cell::start();
    let a = cell.node("a");
    let other = Bus::open(
        &BusConfig {
            domain_id: 1,
            ..cell.config()
        },
        "b",
        "/cell",
    )
    .unwrap();
    let (on_sample, on_lost, _events) = queue();
    let _subscription = other
        .subscribe("/cell/events", string(), Qos::events(), on_sample, on_lost)
        .unwrap();
    let publisher = a
        .publisher("/cell/events", string(), Qos::events())
        .unwrap();
    assert!(!a.wait_for_subscribers(&publisher, 1, Instant::now() + Duration::from_millis(300)));
    assert_eq!(a.graph().nodes(), ["/cell/a"]);
}

#[test]
fn a_second_router_on_the_same_port_is_told_to_join_the_first() {
    let cell = Cell::start();
    let second = Router::start(&RouterConfig {
        listen: vec![cell.endpoint.clone()],
        ..RouterConfig::default()
    });
    match second {
        Err(BusError::PortTaken { answers, .. }) => assert!(answers),
        other => panic!("{:?}", other.err()),
    }
}

#[test]
fn a_port_taken_by_something_else_is_told_apart() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/{}", listener.local_addr().unwrap());
    let router = Router::start(&RouterConfig {
        listen: vec![endpoint],
        ..RouterConfig::default()
    });
    match router {
        Err(BusError::PortTaken { answers, .. }) => assert!(!answers),
        other => panic!("{:?}", other.err()),
    }
}

#[test]
fn without_a_router_the_error_says_where_it_was_looked_for() {
    let port = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let config = BusConfig {
        endpoints: vec![format!("tcp/127.0.0.1:{port}")],
        connect_timeout: Duration::from_millis(300),
        ..BusConfig::default()
    };
    match Bus::open(&config, "a", "/cell") {
        Err(BusError::NoRouter { endpoints, .. }) => {
            assert_eq!(endpoints, format!("tcp/127.0.0.1:{port}"));
        }
        other => panic!("{:?}", other.err()),
    }
}
