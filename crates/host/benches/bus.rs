//! What the bus costs over the libraries it stands on: round trip and throughput of a `ProbeEvent`, in one run.
//!
//! `cargo bench -p host` measures Zenoh, on a loopback router of its own. `cargo bench -p host -- dds` measures DDS, and
//! belongs into a network namespace (`tests/interop/bus/run.sh bench`). Both sides encode and decode the message, use
//! the same transport settings, and take turns; printed are the medians over the rounds and their ratio. The bare sides
//! have no sequence numbers, no cache, no recovery and no duplicates to tell; bare Zenoh blocks when a queue is full,
//! since it would lose what the bus drops and fetches again. What the wire format of rmw_zenoh and recovery cost by
//! themselves shows in the third pair, `zenoh-ext`.
#![expect(clippy::print_stdout, reason = "a benchmark tells its figures")]

use std::net::TcpListener;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::Context;
use futures::StreamExt;
use host::bus::{Bus, BusConfig, Publisher, Qos, Router, RouterConfig, Transport};
use probecell_msgs::{Message, ProbeEvent, from_cdr, to_cdr};
use rustdds::no_key::{DataWriterCdr, SimpleDataReaderCdr};
use rustdds::{DomainParticipantBuilder, QosPolicyBuilder, TopicKind, policy};
use zenoh::Wait;
use zenoh::qos::CongestionControl;
use zenoh::sample::Sample;
use zenoh_ext::{
    AdvancedPublisherBuilderExt, AdvancedSubscriberBuilderExt, CacheConfig, MissDetectionConfig,
    RecoveryConfig,
};

const ROUNDS: usize = 9;
const TRIPS: usize = 2_000;
const PATIENCE: Duration = Duration::from_secs(60);

/// Messages in one measurement of throughput.
const BURST: u64 = 400 * PORTION;

/// Messages under way at most, in portions that the far end gives back: publishers do not block, and would drop what no
/// queue can hold.
const PORTION: u64 = 250;
const PORTIONS: u64 = 4;

type Send = Box<dyn Fn(&ProbeEvent) -> anyhow::Result<()>>;
type SendBack = Box<dyn Fn(&ProbeEvent) + std::marker::Send + Sync>;
type Take = Box<dyn Fn(ProbeEvent) + std::marker::Send + Sync>;

/// Two ends and a topic each way: what `near` sends arrives at `far`'s callback, and back.
struct Pair {
    name: &'static str,
    near: Send,
    /// One for each message that came back.
    echoes: mpsc::Receiver<()>,
    /// One for each portion that the far end has taken.
    taken: mpsc::Receiver<()>,
    /// The far end sends back what it takes, and counts no portions.
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

    fn throughput(&self, event: &ProbeEvent) -> anyhow::Result<f64> {
        self.echoing.store(false, Ordering::SeqCst);
        let start = Instant::now();
        for sent in 0..BURST {
            if sent.is_multiple_of(PORTION) && sent >= PORTION * PORTIONS {
                self.taken()?;
            }
            (self.near)(event)?;
        }
        for _ in 0..PORTIONS {
            self.taken()?;
        }
        Ok(BURST as f64 / start.elapsed().as_secs_f64())
    }

    fn taken(&self) -> anyhow::Result<()> {
        self.taken
            .recv_timeout(PATIENCE)
            .with_context(|| format!("{}: messages are missing", self.name))
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
        compare(&[ours(&dds_config())?, bare_dds()?], &event)
    } else {
        let (endpoint, _router) = router()?;
        let config = BusConfig {
            endpoints: vec![endpoint],
            ..BusConfig::default()
        };
        let pairs = [ours(&config)?, bare_zenoh(&config)?, rmw_zenoh(&config)?];
        compare(&pairs, &event)
    }
}

/// The first pair against each other one.
fn compare(pairs: &[Pair], event: &ProbeEvent) -> anyhow::Result<()> {
    let mut trips = vec![Vec::new(); pairs.len()];
    let mut rates = vec![Vec::new(); pairs.len()];
    for _ in 0..ROUNDS {
        for (index, pair) in pairs.iter().enumerate() {
            trips[index].push(pair.round_trip(event)?);
            rates[index].push(pair.throughput(event)?);
        }
    }
    let trips: Vec<f64> = trips.into_iter().map(median).collect();
    let rates: Vec<f64> = rates.into_iter().map(median).collect();
    for (index, other) in pairs.iter().enumerate().skip(1) {
        let (name, other) = (pairs[0].name, other.name);
        println!(
            "round trip   {name} {:8.1} µs   {other} {:8.1} µs   ratio {:.3}",
            trips[0],
            trips[index],
            trips[0] / trips[index]
        );
        println!(
            "throughput   {name} {:8.0} /s   {other} {:8.0} /s   ratio of times {:.3}",
            rates[0],
            rates[index],
            rates[index] / rates[0]
        );
    }
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

/// The far end: sends back when told to, and tells each portion that it has taken when not.
fn far_end(back: SendBack) -> (Take, mpsc::Receiver<()>, Arc<AtomicBool>) {
    let (portion, taken) = mpsc::channel();
    let arrived = AtomicU64::new(0);
    let echoing = Arc::new(AtomicBool::new(false));
    let take: Take = Box::new({
        let echoing = Arc::clone(&echoing);
        move |event| {
            if echoing.load(Ordering::SeqCst) {
                back(&event);
            } else if (arrived.fetch_add(1, Ordering::Relaxed) + 1).is_multiple_of(PORTION) {
                portion.send(()).ok();
            }
        }
    });
    (take, taken, echoing)
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
    let (take, taken, echoing) = far_end(Box::new(move |event| {
        if let Err(reason) = back(event) {
            println!("{reason}");
        }
    }));
    let there = far.subscribe(
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
        taken,
        echoing,
        _kept: vec![Box::new(returned), Box::new(there), Box::new((near, far))],
    })
}

/// Sessions of the bare crate on the same router, with the bus's depth of queue.
fn zenoh_sessions(config: &BusConfig) -> anyhow::Result<[zenoh::Session; 2]> {
    let open = || {
        let mut settings = zenoh::Config::default();
        let endpoints = serde_json::to_string(&config.endpoints)?;
        for (key, value) in [
            ("mode", r#""peer""#),
            ("connect/endpoints", endpoints.as_str()),
            ("listen/endpoints", r#"["tcp/127.0.0.1:0"]"#),
            ("scouting/multicast/enabled", "false"),
            ("transport/link/tx/queue/size/data", "8"),
        ] {
            settings.insert_json5(key, value).map_err(failed)?;
        }
        zenoh::open(settings).wait().map_err(failed)
    };
    Ok([open()?, open()?])
}

#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
fn failed(reason: zenoh::Error) -> anyhow::Error {
    anyhow::anyhow!("{reason}")
}

/// What takes a sample of the bare crate.
fn decoded(take: impl Fn(ProbeEvent)) -> impl Fn(Sample) {
    move |sample| {
        if let Ok(event) = from_cdr(&sample.payload().to_bytes()) {
            take(event);
        }
    }
}

/// Nothing but put and callback.
fn bare_zenoh(config: &BusConfig) -> anyhow::Result<Pair> {
    let [near, far] = zenoh_sessions(config)?;
    let publisher = |session: &zenoh::Session, key: &'static str| {
        session
            .declare_publisher(key)
            .congestion_control(CongestionControl::Block)
            .wait()
            .map_err(failed)
    };
    let forth = publisher(&near, "bare/forth")?;
    let back = publisher(&far, "bare/back")?;
    let (echo, echoes) = mpsc::channel();
    let returned = near
        .declare_subscriber("bare/back")
        .callback(decoded(move |_| {
            echo.send(()).ok();
        }))
        .wait()
        .map_err(failed)?;
    let (take, taken, echoing) = far_end(Box::new(move |event| {
        if let Err(reason) = back.put(to_cdr(event)).wait() {
            println!("{reason}");
        }
    }));
    let there = far
        .declare_subscriber("bare/forth")
        .callback(decoded(take))
        .wait()
        .map_err(failed)?;
    while !forth.matching_status().wait().map_err(failed)?.matching() {
        std::thread::yield_now();
    }
    Ok(Pair {
        name: "zenoh",
        near: Box::new(move |event| forth.put(to_cdr(event)).wait().map_err(failed)),
        echoes,
        taken,
        echoing,
        _kept: vec![Box::new(returned), Box::new(there), Box::new((near, far))],
    })
}

/// As rmw_zenoh sends a reliable topic with `zenoh-ext`: an attachment, a cache of the bus's depth, and recovery.
fn rmw_zenoh(config: &BusConfig) -> anyhow::Result<Pair> {
    let [near, far] = zenoh_sessions(config)?;
    let publisher = |session: &zenoh::Session, key: &'static str| {
        let publisher = session
            .declare_publisher(key)
            .congestion_control(CongestionControl::Block)
            .advanced()
            .cache(CacheConfig::default().max_samples(config.keep_all_depth))
            .sample_miss_detection(
                MissDetectionConfig::default().heartbeat(Duration::from_millis(500)),
            )
            .wait()
            .map_err(failed)?;
        let sequence = AtomicU64::new(0);
        anyhow::Ok(move |event: &ProbeEvent| {
            let sequence = sequence.fetch_add(1, Ordering::Relaxed);
            let time = SystemTime::now().duration_since(UNIX_EPOCH)?.as_nanos() as u64;
            let mut attachment = Vec::with_capacity(33);
            attachment.extend(sequence.to_le_bytes());
            attachment.extend(time.to_le_bytes());
            attachment.extend([16; 17]);
            publisher
                .put(to_cdr(event))
                .attachment(attachment)
                .wait()
                .map_err(failed)
        })
    };
    let forth = publisher(&near, "rmw/forth")?;
    let back = publisher(&far, "rmw/back")?;
    let recovery = || RecoveryConfig::default().heartbeat();
    let (echo, echoes) = mpsc::channel();
    let returned = near
        .declare_subscriber("rmw/back")
        .callback(decoded(move |_| {
            echo.send(()).ok();
        }))
        .recovery(recovery())
        .wait()
        .map_err(failed)?;
    let (take, taken, echoing) = far_end(Box::new(move |event| {
        if let Err(reason) = back(event) {
            println!("{reason}");
        }
    }));
    let there = far
        .declare_subscriber("rmw/forth")
        .callback(decoded(take))
        .recovery(recovery())
        .wait()
        .map_err(failed)?;
    echoing.store(true, Ordering::SeqCst);
    meet(&forth, &echoes)?;
    Ok(Pair {
        name: "zenoh-ext",
        near: Box::new(forth),
        echoes,
        taken,
        echoing,
        _kept: vec![Box::new(returned), Box::new(there), Box::new((near, far))],
    })
}

/// Writes until one message arrives and comes back.
fn meet(
    near: &impl Fn(&ProbeEvent) -> anyhow::Result<()>,
    echoes: &mpsc::Receiver<()>,
) -> anyhow::Result<()> {
    let start = Instant::now();
    loop {
        near(&event())?;
        if echoes.recv_timeout(Duration::from_millis(100)).is_ok() {
            break;
        }
        anyhow::ensure!(start.elapsed() < PATIENCE, "the two ends do not meet");
    }
    while echoes.recv_timeout(Duration::from_millis(500)).is_ok() {}
    Ok(())
}

fn bare_dds() -> anyhow::Result<Pair> {
    // As many as the bus keeps: RustDDS drops what is beyond 64 samples otherwise.
    let kept = i32::try_from(BusConfig::default().keep_all_depth)?;
    let qos = QosPolicyBuilder::new()
        .resource_limits(policy::ResourceLimits {
            max_samples: kept,
            max_instances: kept,
            max_samples_per_instance: kept,
        })
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
    let (take, taken, echoing) = far_end(Box::new(move |event| {
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
    meet(&near_end, &echoes)?;
    Ok(Pair {
        name: "RustDDS",
        near: near_end,
        echoes,
        taken,
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
