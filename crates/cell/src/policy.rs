//! Who may do what on the bus of a secured cell: a policy of Zenoh that denies what it does not allow, as a function of the
//! cell's wiring.
//!
//! Every topic has one producer, so each process has a user of its own, who may put on the topics of that process and on no
//! other, and announce itself under its own name and no other. Reading is allowed to every user of the cell. Services are
//! served by the launcher and the recorder, parameters by every process; both are called by `console`, under whom an operator's
//! commands run, and by `ros`.
//!
//! | user | may |
//! |---|---|
//! | a process of the cell | read; put on its own topics; the launcher and the recorder: serve |
//! | `driver`, where others start it | read; put on the driver's topics |
//! | `console` | read, call services |
//! | `ros` | the same, from ROS 2 |
//! | `screen` | read; ask what the types of messages are |
//!
//! Neither `*` nor `**` matches a chunk that begins with `@`: tokens of discovery (`@ros2_lv`) and what is fetched late
//! (`…/@adv/…`) have rules of their own.

use std::collections::BTreeMap;

use graph::{parameters, topics};
use toml::{Table, Value};

use crate::{Cell, CellError, SHARED};

/// Under whom an operator's commands join the bus.
pub const CONSOLE: &str = "console";
/// Under whom ROS 2 nodes join that may call services.
pub const ROS: &str = "ros";
/// Under whom whoever only reads joins.
pub const SCREEN: &str = "screen";
/// The launcher, which serves operators.
pub const LAUNCHER: &str = "operator";
/// A driver that others start, and the name of its node.
pub const DRIVER: &str = "driver";
/// The recorder.
pub const RECORDER: &str = "recorder";

/// Services, and the user who serves them.
pub const SERVICES: [(&str, &str); 8] = [
    ("plan", LAUNCHER),
    ("run", LAUNCHER),
    ("stop", LAUNCHER),
    ("status", LAUNCHER),
    ("approve_correction", LAUNCHER),
    ("manage_orders", LAUNCHER),
    ("start_recording", RECORDER),
    ("stop_recording", RECORDER),
];

/// Services that are actions as well.
const ACTIONS: [&str; 2] = ["plan", "run"];

/// Messages that carry information to a reader.
pub(crate) const TOLD: [&str; 4] = ["put", "delete", "reply", "liveliness_token"];
/// Messages by which somebody listens.
pub(crate) const LISTEN: [&str; 3] = [
    "declare_subscriber",
    "liveliness_query",
    "declare_liveliness_subscriber",
];
/// Messages by which a producer speaks, and serves what a link has dropped.
pub(crate) const SPEAK: [&str; 5] = [
    "put",
    "delete",
    "declare_queryable",
    "reply",
    "liveliness_token",
];
/// Messages by which a server offers and answers.
pub(crate) const SERVE: [&str; 3] = ["declare_queryable", "reply", "liveliness_token"];
/// Every message.
pub(crate) const ALL: [&str; 9] = [
    "put",
    "delete",
    "query",
    "reply",
    "declare_subscriber",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
];

/// Keys at which a reader asks: what a link has dropped, and what a storage keeps of a topic. A query elsewhere is the call of a service,
/// whose key has a type of `srv`.
pub(crate) const ASKED: [&str; 2] = ["**/@adv/**", "**/probecell_msgs::msg::dds_::$*/*"];

/// Keys of data and services, of what is fetched late, and of discovery.
pub(crate) const EVERYTHING: [&str; 3] = ["**", "**/@adv/**", "@ros2_lv/**"];

/// Users of a secured cell.
///
/// # Errors
/// A setting that a node refuses.
pub fn users(cell: &Cell) -> Result<Vec<String>, CellError> {
    let processes = productions(cell)?;
    let others = [CONSOLE, ROS, SCREEN].map(str::to_owned);
    Ok(processes.into_keys().chain(others).collect())
}

/// Topics that each process produces, by absolute name without the first slash.
///
/// # Errors
/// A setting that a node refuses.
pub fn productions(cell: &Cell) -> Result<BTreeMap<String, Vec<String>>, CellError> {
    let name = &cell.cell.name;
    let mut processes: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for node in cell.nodes(false)? {
        let produced = processes.entry(node.name().to_owned()).or_default();
        produced.extend((node.outputs().iter()).map(|topic| format!("{name}/{}", topic.name)));
        produced.push(format!("{name}/{}", topics::journal_name(node.name())));
    }
    let of = |producer: &str| {
        let made = topics::ALL
            .iter()
            .filter(move |topic| topic.producer == producer);
        made.map(|topic| format!("{name}/{}", topic.name))
            .collect::<Vec<_>>()
    };
    if let Some(driver) = cell.driver_process() {
        processes.insert(driver.to_owned(), of(DRIVER));
    }
    if let Some(reader) = cell.signals_process() {
        processes.insert(reader.to_owned(), of(reader));
    }
    if cell.is_driver_external() {
        processes.insert(DRIVER.to_owned(), of(DRIVER));
    }
    // The launcher says that the recording is waived (`up --no-record`).
    let waiver = format!("{name}/{}", topics::RECORDING_STATUS.name);
    let mut launcher = of(LAUNCHER);
    launcher.extend([waiver]);
    for action in ACTIONS {
        launcher
            .extend(["feedback", "status"].map(|topic| format!("{name}/{action}/_action/{topic}")));
    }
    launcher.extend(SHARED.map(|topic| cell.shared(topic).trim_start_matches('/').to_owned()));
    processes.insert(LAUNCHER.to_owned(), launcher);
    processes.insert(RECORDER.to_owned(), of(RECORDER));
    // As every ROS 2 node, each publishes its log and what parameters it has on topics that all share.
    for produced in processes.values_mut() {
        produced.extend(["rosout", "parameter_events"].map(str::to_owned));
    }
    let made = |topic: &String| processes.values().any(|produced| produced.contains(topic));
    let left: Vec<String> = of("instrument")
        .into_iter()
        .filter(|topic| !made(topic))
        .collect();
    if !left.is_empty() {
        processes.insert("instrument".to_owned(), left);
    }
    Ok(processes)
}

/// The section `access_control` of the router of a secured cell.
///
/// # Errors
/// A setting that a node refuses, or a domain that is none.
pub fn access_control(cell: &Cell) -> Result<Table, CellError> {
    let domain = cell.setting(cell.bus.domain())?;
    let everything = EVERYTHING.map(str::to_owned).to_vec();
    let mut policy = Policy::default();
    policy.rule("listen", &["ingress"], &LISTEN, &everything);
    let asked = ASKED.map(str::to_owned);
    policy.rule("fetch_late", &["ingress"], &["query"], &asked);
    policy.rule("be_told", &["egress"], &TOLD, &everything);
    policy.rule("be_asked", &["egress"], &ALL, &everything);
    // Who calls looks first whether anybody serves.
    let offers = ["**", "**/@adv/**"].map(str::to_owned).to_vec();
    policy.rule("be_offered", &["egress"], &["declare_queryable"], &offers);
    let services = |by: Option<&str>| -> Vec<String> {
        let served = SERVICES
            .iter()
            .filter(|(_, server)| by.is_none_or(|by| by == *server));
        served
            .map(|(name, _)| format!("{domain}/{}/{name}/**", cell.cell.name))
            .collect()
    };
    // Of any process.
    let parameters_of = |node: &str| {
        let all = parameters::READING.iter().chain(&parameters::SETTING);
        all.map(|service| format!("{domain}/{}/{node}/{service}/**", cell.cell.name))
            .collect::<Vec<_>>()
    };
    let mut called = services(None);
    called.extend(parameters_of("*"));
    policy.rule("call", &["ingress"], &["query"], &called);
    let namespace = cell.namespace().replace('/', "%");
    for (user, topics) in productions(cell)? {
        let keys = topics.iter().flat_map(|topic| {
            let key = format!("{domain}/{topic}/**");
            let late = format!("{key}/@adv/**");
            [key, late]
        });
        let mut keys: Vec<String> = keys.collect();
        keys.extend(services(Some(&user)));
        keys.extend(parameters_of(&user));
        // Session, node, entity, kind, enclave; then namespace and name, and of an endpoint its topic.
        keys.push(format!("@ros2_lv/{domain}/*/*/*/*/*/{namespace}/{user}/**"));
        let speaks = format!("speak_as_{user}");
        policy.rule(&speaks, &["ingress"], &SPEAK, &keys);
        policy.subject(
            &user,
            &["listen", "fetch_late", "be_told", "be_asked", &speaks],
        );
    }
    // Nodes, subscriptions and clients of any name: not publishers and servers.
    let tokens = |kinds: &[&str]| {
        let token = |kind: &&str| format!("@ros2_lv/{domain}/*/*/*/{kind}/**");
        kinds.iter().map(token).collect::<Vec<_>>()
    };
    policy.rule(
        "show_reader",
        &["ingress"],
        &["liveliness_token"],
        &tokens(&["NN", "MS"]),
    );
    policy.rule(
        "show_caller",
        &["ingress"],
        &["liveliness_token"],
        &tokens(&["NN", "MS", "SC"]),
    );
    for user in [CONSOLE, ROS] {
        policy.subject(
            user,
            &[
                "listen",
                "fetch_late",
                "be_told",
                "be_offered",
                "call",
                "show_caller",
            ],
        );
    }
    let (name, service) = (&cell.cell.name, parameters::TYPE_DESCRIPTION);
    let types = format!("{domain}/{name}/*/{service}/**");
    policy.rule("learn_types", &["ingress"], &["query"], &[types]);
    let read = [
        "listen",
        "fetch_late",
        "be_told",
        "show_reader",
        "learn_types",
    ];
    policy.subject(SCREEN, &read);
    Ok(policy.table())
}

/// Rules, subjects and policies as Zenoh lists them.
#[derive(Default)]
pub(crate) struct Policy {
    rules: Vec<Value>,
    subjects: Vec<Value>,
    policies: Vec<Value>,
}

impl Policy {
    pub(crate) fn rule(&mut self, id: &str, flows: &[&str], messages: &[&str], keys: &[String]) {
        self.add(id, "allow", flows, messages, keys);
    }

    /// Nobody whom this rule names may, whatever another allows.
    pub(crate) fn deny(&mut self, id: &str, flows: &[&str], messages: &[&str], keys: &[String]) {
        self.add(id, "deny", flows, messages, keys);
    }

    fn add(&mut self, id: &str, effect: &str, flows: &[&str], messages: &[&str], keys: &[String]) {
        let mut rule = Table::new();
        rule.insert("id".to_owned(), id.into());
        rule.insert("permission".to_owned(), effect.into());
        rule.insert("flows".to_owned(), list(flows));
        rule.insert("messages".to_owned(), list(messages));
        rule.insert("key_exprs".to_owned(), list(keys));
        self.rules.push(rule.into());
    }

    fn subject(&mut self, user: &str, rules: &[&str]) {
        self.who(user, "usernames", &[user], rules);
    }

    /// Whoever is one of `values` by the property of that name is given these rules.
    pub(crate) fn who(&mut self, id: &str, property: &str, values: &[&str], rules: &[&str]) {
        let mut subject = Table::new();
        subject.insert("id".to_owned(), id.into());
        subject.insert(property.to_owned(), list(values));
        self.subjects.push(subject.into());
        let mut policy = Table::new();
        policy.insert("rules".to_owned(), list(rules));
        policy.insert("subjects".to_owned(), list(&[id]));
        self.policies.push(policy.into());
    }

    pub(crate) fn table(self) -> Table {
        let mut table = Table::new();
        table.insert("enabled".to_owned(), true.into());
        table.insert("default_permission".to_owned(), "deny".into());
        table.insert("rules".to_owned(), self.rules.into());
        table.insert("subjects".to_owned(), self.subjects.into());
        table.insert("policies".to_owned(), self.policies.into());
        table
    }
}

pub(crate) fn list<T: AsRef<str>>(texts: &[T]) -> Value {
    let texts = texts.iter().map(|text| Value::from(text.as_ref()));
    Value::Array(texts.collect())
}
