//! A node on the bus that does what lines on its standard input say, for the interoperability scripts.
//!
//! `bus_peer NODE [setting=value …]` with the settings `transport` (zenoh, dds), `namespace`, `domain`, `endpoint`,
//! `listen`, `depth` (of keep-all caches), `services` (enhanced, cyclone), `zenoh` (JSON laid over the session's
//! settings), `interface` (address, for DDS). `bus_peer router [listen=…] [connect=…]` routes instead.
//!
//! Commands; every answer is one line of JSON on standard output:
//!
//! ```text
//! subscribe TOPIC TYPE QOS          samples then come as {"sample": …}, losses as {"lost": …}
//! publish TOPIC TYPE QOS HEX        one message, CDR in hexadecimal
//! flood TOPIC TYPE QOS COUNT MS     COUNT messages of eight counted bytes, one every MS milliseconds
//! await TOPIC COUNT                 until COUNT subscriptions want what was published on TOPIC
//! serve NAME TYPE HEX               answers every request with HEX, and tells it as {"request": …}
//! call NAME TYPE HEX                {"response": …} or {"error": …}
//! graph                             {"nodes": […], "topics": […], "services": […]}
//! close                             leaves the bus, having delivered what it published
//! ```
//!
//! QOS is `reliable:N`, `best_effort:N`, `latched:N` or `events`.

use std::collections::BTreeMap;
use std::io::{BufRead, Write};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use host::bus::{
    Bus, BusConfig, DdsServices, Publisher, Qos, Router, RouterConfig, Transport, TypeId,
};
use probecell_msgs::{MessageType, ServiceType};
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(20);

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let node = arguments
        .next()
        .context("the first argument is the node's name")?;
    let settings: Vec<(String, String)> = arguments
        .map(|setting| {
            let (key, value) = setting.split_once('=').context("settings are key=value")?;
            Ok((key.to_owned(), value.to_owned()))
        })
        .collect::<anyhow::Result<_>>()?;
    if node == "router" {
        return route(&settings);
    }
    let mut config = BusConfig {
        connect_timeout: PATIENCE,
        ..BusConfig::default()
    };
    let mut namespace = "/".to_owned();
    for (key, value) in settings {
        match key.as_str() {
            "transport" if value == "dds" => config.transport = Transport::Dds,
            "transport" => config.transport = Transport::Zenoh,
            "services" if value == "cyclone" => config.dds_services = DdsServices::Cyclone,
            "services" => config.dds_services = DdsServices::Enhanced,
            "namespace" => namespace = value,
            "domain" => config.domain_id = value.parse()?,
            "endpoint" => config.endpoints = vec![value],
            "listen" => config.listen = vec![value],
            "depth" => config.keep_all_depth = value.parse()?,
            "zenoh" => config.zenoh = serde_json::from_str(&value)?,
            "interface" => config.dds_interfaces = vec![value.parse()?],
            _ => bail!("unknown setting {key}"),
        }
    }
    Peer::new(Bus::open(&config, &node, &namespace)?).run()
}

fn route(settings: &[(String, String)]) -> anyhow::Result<()> {
    let mut config = RouterConfig::default();
    for (key, value) in settings {
        match key.as_str() {
            "listen" => config.listen = vec![value.clone()],
            "connect" => config.connect = vec![value.clone()],
            _ => bail!("unknown setting {key}"),
        }
    }
    let router = Router::start(&config)?;
    tell(&json!({ "router": router.id() }));
    std::io::stdin()
        .lock()
        .lines()
        .try_for_each(|line| line.map(|_| ()))?;
    router.close()?;
    Ok(())
}

struct Peer {
    bus: Bus,
    publishers: BTreeMap<String, Publisher>,
    kept: Vec<Kept>,
}

#[expect(dead_code, reason = "held for their drop")]
enum Kept {
    Subscription(host::bus::Subscription),
    Server(host::bus::Server),
}

impl Peer {
    fn new(bus: Bus) -> Self {
        Self {
            bus,
            publishers: BTreeMap::new(),
            kept: Vec::new(),
        }
    }

    fn run(mut self) -> anyhow::Result<()> {
        tell(&json!({ "ready": true }));
        for line in std::io::stdin().lock().lines() {
            let line = line?;
            let words: Vec<&str> = line.split_whitespace().collect();
            if words == ["close"] {
                self.bus.close(PATIENCE)?;
                tell(&json!({ "closed": true }));
                return Ok(());
            }
            let answer = self
                .command(&words)
                .unwrap_or_else(|error| json!({ "error": format!("{error:#}") }));
            tell(&answer);
        }
        Ok(())
    }

    fn command(&mut self, words: &[&str]) -> anyhow::Result<Value> {
        Ok(match *words {
            ["subscribe", topic, ty, qos] => self.subscribe(topic, ty, qos)?,
            ["publish", topic, ty, qos, cdr] => {
                let number = self.publisher(topic, ty, qos)?.publish(bytes(cdr)?, 42)?;
                json!({ "published": number })
            }
            ["flood", topic, ty, qos, count, period] => {
                let period = Duration::from_millis(period.parse()?);
                let publisher = self.publisher(topic, ty, qos)?;
                for count in 0..count.parse::<u64>()? {
                    let cdr = [[0, 1, 0, 0].as_slice(), &count.to_le_bytes()].concat();
                    publisher.publish(cdr, 42)?;
                    std::thread::sleep(period);
                }
                json!({ "flooded": topic })
            }
            ["await", topic, count] => {
                let publisher = self
                    .publishers
                    .get(topic)
                    .context("nothing is published there")?;
                let deadline = Instant::now() + PATIENCE;
                json!({ "found": self.bus.wait_for_subscribers(publisher, count.parse()?, deadline) })
            }
            ["offer", topic, ty, qos] => {
                json!({ "gid": hex(&self.publisher(topic, ty, qos)?.gid()) })
            }
            ["serve", name, ty, cdr] => self.serve(name, ty, bytes(cdr)?)?,
            ["call", name, ty, cdr] => {
                let response = self.bus.call(name, service(ty)?, &bytes(cdr)?, PATIENCE)?;
                json!({ "response": hex(&response) })
            }
            ["graph"] => self.graph(),
            _ => bail!("unknown command {words:?}"),
        })
    }

    fn publisher(&mut self, topic: &str, ty: &str, qos: &str) -> anyhow::Result<&Publisher> {
        if !self.publishers.contains_key(topic) {
            let publisher = self.bus.publisher(topic, message(ty)?, self::qos(qos)?)?;
            self.publishers.insert(topic.to_owned(), publisher);
        }
        self.publishers.get(topic).context("just inserted")
    }

    fn subscribe(&mut self, topic: &str, ty: &str, qos: &str) -> anyhow::Result<Value> {
        let ty = message(ty)?;
        let (name, lost_name) = (topic.to_owned(), topic.to_owned());
        let subscription = self.bus.subscribe(
            topic,
            TypeId::from(ty),
            self::qos(qos)?,
            Box::new(move |sample| {
                // Of a flood only the number is wanted; its payload is no message of that type.
                let canonical = ty
                    .canonical(&sample.payload)
                    .is_ok_and(|cdr| cdr == *sample.payload);
                tell(&json!({ "sample": name, "number": sample.sequence,
                    "source_time": sample.source_time_ns, "publisher": hex(&sample.publisher),
                    "cdr": hex(&sample.payload), "canonical": canonical }));
            }),
            Box::new(move |lost| {
                tell(
                    &json!({ "lost": lost_name, "first": lost.first, "count": lost.count,
                    "publisher": hex(&lost.publisher) }),
                );
            }),
        )?;
        self.kept.push(Kept::Subscription(subscription));
        Ok(json!({ "subscribed": topic }))
    }

    fn serve(&mut self, name: &str, ty: &str, response: Vec<u8>) -> anyhow::Result<Value> {
        let server = self.bus.serve(
            name,
            service(ty)?,
            Box::new(move |request| {
                tell(&json!({ "request": hex(request) }));
                Ok(response.clone())
            }),
        )?;
        self.kept.push(Kept::Server(server));
        Ok(json!({ "serving": name }))
    }

    fn graph(&self) -> Value {
        let graph = self.bus.graph();
        let topics: Vec<Value> = graph
            .topics()
            .iter()
            .map(|topic| {
                json!({ "name": topic.name, "type": topic.ty.ros_name(), "hash": topic.ty.hash(),
                    "publishers": topic.offered.len(), "subscriptions": topic.subscriptions })
            })
            .collect();
        let services: Vec<Value> = graph
            .services()
            .iter()
            .map(|(name, ty)| json!({ "name": name, "type": ty.ros_name() }))
            .collect();
        json!({ "nodes": graph.nodes(), "topics": topics, "services": services })
    }
}

fn message(name: &str) -> anyhow::Result<&'static MessageType> {
    probecell_msgs::by_name(name).with_context(|| format!("no message type {name}"))
}

fn service(name: &str) -> anyhow::Result<&'static ServiceType> {
    probecell_msgs::services()
        .iter()
        .find(|ty| ty.name == name)
        .copied()
        .with_context(|| format!("no service type {name}"))
}

fn qos(text: &str) -> anyhow::Result<Qos> {
    if text == "events" {
        return Ok(Qos::events());
    }
    let (kind, depth) = text.split_once(':').context("QOS is kind:depth")?;
    let depth = depth.parse()?;
    Ok(match kind {
        "reliable" => Qos::reliable(depth),
        "best_effort" => Qos::best_effort(depth),
        "latched" => Qos::latched(depth),
        _ => bail!("unknown quality of service {kind}"),
    })
}

fn hex(bytes: &[u8]) -> String {
    bytes
        .iter()
        .flat_map(|byte| [byte >> 4, byte & 15])
        .filter_map(|digit| char::from_digit(u32::from(digit), 16))
        .collect()
}

fn bytes(hex: &str) -> anyhow::Result<Vec<u8>> {
    (0..hex.len())
        .step_by(2)
        .map(|at| {
            let digits = hex.get(at..at + 2).context("an odd number of digits")?;
            Ok(u8::from_str_radix(digits, 16)?)
        })
        .collect()
}

/// One line, whole, whatever other threads tell meanwhile.
fn tell(answer: &Value) {
    let mut out = std::io::stdout().lock();
    if writeln!(out, "{answer}")
        .and_then(|()| out.flush())
        .is_err()
    {
        std::process::exit(1);
    }
}
