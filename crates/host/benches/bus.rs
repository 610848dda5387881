//! What the bus costs over the libraries it stands on: round trip and throughput of a `ProbeEvent`, in one run.
//!
//! `cargo bench -p host` measures Zenoh, on a loopback router of its own. `cargo bench -p host -- dds` measures DDS, and
//! belongs into a network namespace (`tests/interop/bus/run.sh bench`). Both sides encode and decode the message, use
//! the same transport settings, and take turns; printed are the medians over the rounds and their ratio. The bare side
//! has no sequence numbers, no cache, no recovery and no duplicates to tell.
#![expect(clippy::print_stdout, reason = "a benchmark tells its figures")]

use std::net::TcpListener;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

use anyhow::Context;
use futures::StreamExt;
use host::bus::{Bus, BusConfig, Publisher, Qos, Router, RouterConfig, Transport};
use probecell_msgs::{Message, ProbeEvent, from_cdr, to_cdr};
use rustdds::no_key::{DataWriterCdr, SimpleDataReaderCdr};
use rustdds::{DomainParticipantBuilder, QosPolicyBuilder, TopicKind, policy};
use zenoh::Wait;
use zenoh::qos::CongestionControl;

const ROUNDS: usize = 9;
const TRIPS: usize = 2_000;
const PATIENCE: Duration = Duration::from_secs(60);

/// Messages in one measurement of throughput; DDS is slower by two orders.
const ZENOH_BURST: u64 = 100_000;
const DDS_BURST: u64 = 10_000;

/// Messages under way at most: publishers do not block, and would drop what no queue can hold.
const WINDOW: u64 = 1_000;

type Send = Box<dyn Fn(&ProbeEvent) -> anyhow::Result<()>>;
type SendBack = Box<dyn Fn(&ProbeEvent) + std::marker::Send + Sync>;
type Take = Box<dyn Fn(ProbeEvent) + std::marker::Send + Sync>;

/// Two ends and a topic each way: what `near` sends arrives at `far`'s callback, and back.
struct Pair {
    name: &'static str,
    near: Send,
    /// One for each message that came back.
    echoes: mpsc::Receiver<()>,
    /// Messages that the far end has taken.
    arrived: Arc<AtomicU64>,
    /// The far end sends back what it takes.
    echoing: Arc<AtomicBool>,
    _kept: Vec<Box<dyn std::any::Any>>,
}

impl Pair {
    fn round_trip(&self, event: &ProbeEvent) -> anyhow::Result<f64> {
        self.echoing.store(true, Ordering::SeqCst);
        let mut times = Vec::with_capacity(TRIPS);
        for _ in 0..TRIPS {
            let start = Instant::now();
            (self.near)(event)?;
            self.echoes.recv_timeout(PATIENCE).context("no echo")?;
            times.push(start.elapsed().as_secs_f64() * 1e6);
        }
        Ok(median(times))
    }

    fn throughput(&self, event: &ProbeEvent, burst: u64) -> anyhow::Result<f64> {
        self.echoing.store(false, Ordering::SeqCst);
        let goal = self.arrived.load(Ordering::SeqCst) + burst;
        let start = Instant::now();
        for sent in 1..=burst {
            (self.near)(event)?;
            while self.arrived.load(Ordering::Relaxed) + WINDOW < goal - burst + sent {
                anyhow::ensure!(
                    start.elapsed() < PATIENCE,
                    "{}: messages are missing",
                    self.name
                );
                std::thread::yield_now();
            }
        }
        while self.arrived.load(Ordering::SeqCst) < goal {
            anyhow::ensure!(
                start.elapsed() < PATIENCE,
                "{}: messages are missing",
                self.name
            );
            std::thread::yield_now();
        }
        Ok(burst as f64 / start.elapsed().as_secs_f64())
    }
}

fn main() -> anyhow::Result<()> {
    let dds = std::env::args().any(|argument| argument == "dds");
    let event = event();
    println!(
        "ProbeEvent of {} bytes, {ROUNDS} rounds",
        to_cdr(&event).len()
    );
    if dds {
        compare(&ours(&dds_config())?, &bare_dds()?, &event, DDS_BURST)
    } else {
        let (endpoint, _router) = router()?;
        let config = BusConfig {
            endpoints: vec![endpoint],
            ..BusConfig::default()
        };
        compare(&ours(&config)?, &bare_zenoh(&config)?, &event, ZENOH_BURST)
    }
}

fn compare(ours: &Pair, bare: &Pair, event: &ProbeEvent, burst: u64) -> anyhow::Result<()> {
    let mut trips = [Vec::new(), Vec::new()];
    let mut rates = [Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        for (index, pair) in [ours, bare].into_iter().enumerate() {
            trips[index].push(pair.round_trip(event)?);
            rates[index].push(pair.throughput(event, burst)?);
        }
    }
    let [our_trip, bare_trip] = trips.map(median);
    let [our_rate, bare_rate] = rates.map(median);
    println!(
        "round trip   {} {our_trip:8.1} µs   {} {bare_trip:8.1} µs   ratio {:.3}",
        ours.name,
        bare.name,
        our_trip / bare_trip
    );
    println!(
        "throughput   {} {our_rate:8.0} /s   {} {bare_rate:8.0} /s   ratio of times {:.3}",
        ours.name,
        bare.name,
        bare_rate / our_rate
    );
    Ok(())
}

fn event() -> ProbeEvent {
    ProbeEvent {
        plan_id: "housing 7".to_owned(),
        axis_names: ["X", "Y", "Z", "B", "C"].map(str::to_owned).to_vec(),
        axis_positions: vec![0.123, -0.045, 0.2, 1.5, -0.7],
        feed: 5e-3,
        ..ProbeEvent::default()
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The far end: counts, and sends back when told to.
fn far_end(back: SendBack) -> (Take, Arc<AtomicU64>, Arc<AtomicBool>) {
    let arrived = Arc::new(AtomicU64::new(0));
    let echoing = Arc::new(AtomicBool::new(false));
    let take: Take = Box::new({
        let (arrived, echoing) = (Arc::clone(&arrived), Arc::clone(&echoing));
        move |event| {
            if echoing.load(Ordering::Relaxed) {
                back(&event);
            }
            arrived.fetch_add(1, Ordering::SeqCst);
        }
    });
    (take, arrived, echoing)
}

fn router() -> anyhow::Result<(String, Router)> {
    let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let router = Router::start(&RouterConfig {
        listen: vec![endpoint.clone()],
        ..RouterConfig::default()
    })?;
    Ok((endpoint, router))
}

fn dds_config() -> BusConfig {
    BusConfig {
        transport: Transport::Dds,
        ..BusConfig::default()
    }
}

/// The bus, whichever transport it is on.
fn ours(config: &BusConfig) -> anyhow::Result<Pair> {
    let near = Bus::open(config, "near", "/bench")?;
    let far = Bus::open(config, "far", "/bench")?;
    let send = |publisher: Publisher| {
        move |event: &ProbeEvent| publisher.publish(to_cdr(event), 0).map(|_| ())
    };
    let forth = near.publisher("/bench/forth", ProbeEvent::TYPE, Qos::events())?;
    let back = far.publisher("/bench/back", ProbeEvent::TYPE, Qos::events())?;
    let (echo, echoes) = mpsc::channel();
    let returned = near.subscribe(
        "/bench/back",
        ProbeEvent::TYPE,
        Qos::events(),
        Box::new(move |sample| {
            if from_cdr::<ProbeEvent>(&sample.payload).is_ok() {
                echo.send(()).ok();
            }
        }),
        Box::new(|lost| println!("lost {lost:?}")),
    )?;
    let deadline = Instant::now() + PATIENCE;
    anyhow::ensure!(far.wait_for_subscribers(&back, 1, deadline), "no way back");
    let back = send(back);
    let (take, arrived, echoing) = far_end(Box::new(move |event| {
        if let Err(reason) = back(event) {
            println!("{reason}");
        }
    }));
    let taken = far.subscribe(
        "/bench/forth",
        ProbeEvent::TYPE,
        Qos::events(),
        Box::new(move |sample| {
            if let Ok(event) = from_cdr(&sample.payload) {
                take(event);
            }
        }),
        Box::new(|lost| println!("lost {lost:?}")),
    )?;
    anyhow::ensure!(
        near.wait_for_subscribers(&forth, 1, deadline),
        "no way forth"
    );
    let forth = send(forth);
    Ok(Pair {
        name: "bus",
        near: Box::new(move |event| Ok(forth(event)?)),
        echoes,
        arrived,
        echoing,
        _kept: vec![Box::new(returned), Box::new(taken), Box::new((near, far))],
    })
}

fn bare_zenoh(config: &BusConfig) -> anyhow::Result<Pair> {
    let failed = |reason: zenoh::Error| anyhow::anyhow!("{reason}");
    let open = || {
        let mut settings = zenoh::Config::default();
        let endpoints = serde_json::to_string(&config.endpoints)?;
        for (key, value) in [
            ("mode", r#""peer""#),
            ("connect/endpoints", endpoints.as_str()),
            ("listen/endpoints", r#"["tcp/127.0.0.1:0"]"#),
            ("scouting/multicast/enabled", "false"),
        ] {
            settings.insert_json5(key, value).map_err(failed)?;
        }
        zenoh::open(settings).wait().map_err(failed)
    };
    let (near, far) = (open()?, open()?);
    let publisher = |session: &zenoh::Session, key: &'static str| {
        session
            .declare_publisher(key)
            .congestion_control(CongestionControl::Drop)
            .wait()
            .map_err(failed)
    };
    let forth = publisher(&near, "bare/forth")?;
    let back = publisher(&far, "bare/back")?;
    let (echo, echoes) = mpsc::channel();
    let returned = near
        .declare_subscriber("bare/back")
        .callback(move |sample| {
            if from_cdr::<ProbeEvent>(&sample.payload().to_bytes()).is_ok() {
                echo.send(()).ok();
            }
        })
        .wait()
        .map_err(failed)?;
    let (take, arrived, echoing) = far_end(Box::new(move |event| {
        if let Err(reason) = back.put(to_cdr(event)).wait() {
            println!("{reason}");
        }
    }));
    let taken = far
        .declare_subscriber("bare/forth")
        .callback(move |sample| {
            if let Ok(event) = from_cdr(&sample.payload().to_bytes()) {
                take(event);
            }
        })
        .wait()
        .map_err(failed)?;
    while !forth.matching_status().wait().map_err(failed)?.matching() {
        std::thread::yield_now();
    }
    Ok(Pair {
        name: "zenoh",
        near: Box::new(move |event| forth.put(to_cdr(event)).wait().map_err(failed)),
        echoes,
        arrived,
        echoing,
        _kept: vec![Box::new(returned), Box::new(taken), Box::new((near, far))],
    })
}

fn bare_dds() -> anyhow::Result<Pair> {
    let qos = QosPolicyBuilder::new()
        .reliable(rustdds::Duration::INFINITE)
        .durability(policy::Durability::Volatile)
        .history(policy::History::KeepAll)
        .build();
    let participant = || {
        DomainParticipantBuilder::new(0)
            .with_only_networks([std::net::Ipv4Addr::LOCALHOST])
            .build()
    };
    let (near, far) = (participant()?, participant()?);
    let writer = |end: &rustdds::DomainParticipant, topic: &str| -> anyhow::Result<_> {
        let ty = ProbeEvent::TYPE.dds_name.to_owned();
        let topic = end.create_topic(topic.to_owned(), ty, &qos, TopicKind::NoKey)?;
        let writer: DataWriterCdr<ProbeEvent> = end
            .create_publisher(&qos)?
            .create_datawriter_no_key_cdr(&topic, None)?;
        Ok(writer)
    };
    let reader = |end: &rustdds::DomainParticipant, topic: &str| -> anyhow::Result<_> {
        let ty = ProbeEvent::TYPE.dds_name.to_owned();
        let topic = end.create_topic(topic.to_owned(), ty, &qos, TopicKind::NoKey)?;
        let reader: SimpleDataReaderCdr<ProbeEvent> = end
            .create_subscriber(&qos)?
            .create_simple_datareader_no_key(&topic, None)?;
        Ok(reader)
    };
    let forth = writer(&near, "rt/bare/forth")?;
    let back = writer(&far, "rt/bare/back")?;
    let (echo, echoes) = mpsc::channel();
    read(
        reader(&near, "rt/bare/back")?,
        Box::new(move |_| {
            echo.send(()).ok();
        }),
    );
    let (take, arrived, echoing) = far_end(Box::new(move |event| {
        if let Err(reason) = back.write(event.clone(), Some(rustdds::Timestamp::now())) {
            println!("{reason}");
        }
    }));
    read(reader(&far, "rt/bare/forth")?, take);
    let near_end: Send = Box::new(move |event| {
        forth
            .write(event.clone(), Some(rustdds::Timestamp::now()))
            .map_err(|reason| anyhow::anyhow!("{reason}"))
    });
    // RustDDS tells no match of a single writer: write until one arrives and comes back.
    echoing.store(true, Ordering::SeqCst);
    let start = Instant::now();
    loop {
        near_end(&event())?;
        if echoes.recv_timeout(Duration::from_millis(100)).is_ok() {
            break;
        }
        anyhow::ensure!(
            start.elapsed() < PATIENCE,
            "the bare participants do not meet"
        );
    }
    while echoes.recv_timeout(Duration::from_millis(500)).is_ok() {}
    Ok(Pair {
        name: "RustDDS",
        near: near_end,
        echoes,
        arrived,
        echoing,
        _kept: vec![Box::new((near, far))],
    })
}

/// Takes what the reader receives, for as long as the process lives.
fn read(reader: SimpleDataReaderCdr<ProbeEvent>, take: Take) {
    std::thread::spawn(move || {
        futures::executor::block_on(reader.as_async_stream().for_each(|change| {
            if let Ok(change) = change {
                take(change.into_value());
            }
            std::future::ready(())
        }));
    });
}
