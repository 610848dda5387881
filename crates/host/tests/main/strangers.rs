//! A cell that is not secured, on real sessions: its own processes reach the router by a private socket, a stranger over
//! loopback. The stranger tries every topic, every service and every announcement, as a client, a peer and a router.

use std::{collections::BTreeSet, net::TcpListener, path::Path, sync::Arc, time::Instant};

use cell::{Cell, CellText, policy, strangers};
use graph::parameters;
use host::bus::{Router, RouterConfig};
use serde_json::{Value, json};
use zenoh::{
    Session, Wait,
    liveliness::LivelinessToken,
    query::Query,
    sample::{Sample, SampleKind},
};

use crate::common::{self, Heard, PATIENCE, key, reach};

/// Ways to join.
const MODES: [&str; 3] = ["client", "peer", "router"];

/// A cell and the router that `up` would carry for it.
struct Guarded {
    cell: Cell,
    network: String,
    socket: String,
    _router: Router,
    _folder: tempfile::TempDir,
}

impl Guarded {
    /// The shipped cell of that name, with more settings of its section `[bus]`.
    fn start(name: &str, more: &str) -> Self {
        let own = format!("[bus]\n{more}\n");
        Self::start_changed(name, |text| {
            if text.contains("[bus]\n") {
                text.replace("[bus]\n", &own)
            } else {
                format!("{text}\n{own}")
            }
        })
    }

    /// The shipped cell of that name, its file changed.
    fn start_changed(name: &str, change: impl Fn(&str) -> String) -> Self {
        let file = format!("{}/../../launch-scripts/{name}", env!("CARGO_MANIFEST_DIR"));
        let shipped = Cell::read(Path::new(&file)).expect("a shipped cell");
        let text = shipped.text().clone();
        let cell = change(&text.cell);
        let cell = Cell::from_text(CellText { cell, ..text }).expect("a cell");
        let folder = tempfile::tempdir().expect("a folder");
        let port = TcpListener::bind("127.0.0.1:0").and_then(|socket| socket.local_addr());
        let network = format!("tcp/{}", port.expect("a port"));
        let socket = format!("{}/{}/own", strangers::SOCKET, folder.path().display());
        let rules = strangers::access_control(&cell).expect("a policy");
        let zenoh = rules.map_or(json!({}), |rules| json!({ "access_control": rules }));
        let router = Router::start(&RouterConfig {
            listen: vec![socket.clone(), network.clone()],
            zenoh,
            ..RouterConfig::default()
        });
        Self {
            cell,
            network,
            socket,
            _router: router.expect("a router"),
            _folder: folder,
        }
    }

    fn own(&self) -> Session {
        open(&self.socket, "client", &json!({})).expect("an own session")
    }

    fn witness(&self) -> Witness {
        let session = self.own();
        Witness {
            heard: listen(&session),
            sentinel: sentinel(&session),
            session,
        }
    }

    fn stranger(&self, mode: &str) -> Session {
        open(&self.network, mode, &json!({})).expect("a stranger may join")
    }

    /// Every topic of the cell, and two that it does not have.
    fn topics(&self) -> BTreeSet<String> {
        let productions = policy::productions(&self.cell).expect("productions");
        let mut topics: BTreeSet<String> = productions.into_values().flatten().collect();
        topics.extend([
            "camera/image".to_owned(),
            format!("{}/other", self.cell.cell.name),
        ]);
        topics
    }
}

/// A session of the cell that hears everything that is put or deleted.
struct Witness {
    session: Session,
    heard: Heard,
    sentinel: String,
}

impl Witness {
    /// Puts and deletes on `topics` in another session, and what of it is heard.
    fn hears(&self, session: &Session, who: &str, topics: &BTreeSet<String>) -> BTreeSet<String> {
        reach(session, &self.sentinel);
        speak(session, who, topics);
        reach(session, &self.sentinel);
        of(&self.heard, who)
    }
}

fn open(endpoint: &str, mode: &str, more: &Value) -> zenoh::Result<Session> {
    let mut settings = json!({
        "mode": mode,
        "connect": { "endpoints": [endpoint], "timeout_ms": 5000, "exit_on_failure": true },
        "listen": { "endpoints": [] },
        "scouting": { "multicast": { "enabled": false } },
    });
    if let (Some(settings), Some(more)) = (settings.as_object_mut(), more.as_object()) {
        settings.extend(more.clone());
    }
    zenoh::open(zenoh::Config::from_json5(&settings.to_string())?).wait()
}

/// A key that everybody may ask. Its answer comes after all that was said before on the way to this session.
fn sentinel(session: &Session) -> String {
    common::serve(session, "0/any/sentinel/T/H/@adv/sentinel".to_owned())
}

/// Everything that is put or deleted, by who put it.
fn listen(session: &Session) -> Heard {
    let heard = Heard::default();
    for keys in ["**", "**/@adv/**"] {
        let into = Arc::clone(&heard);
        let subscriber = session
            .declare_subscriber(keys)
            .callback(move |sample: Sample| {
                let who = sample.attachment().map(|who| who.to_bytes().into_owned());
                let who = String::from_utf8_lossy(&who.unwrap_or_default()).into_owned();
                let what = match sample.kind() {
                    SampleKind::Put => sample.key_expr().to_string(),
                    SampleKind::Delete => format!("- {}", sample.key_expr()),
                };
                into.lock().expect("no panic").insert((who, what));
            });
        subscriber.background().wait().expect("a subscription");
    }
    heard
}

fn of(heard: &Heard, who: &str) -> BTreeSet<String> {
    let heard = heard.lock().expect("no panic");
    let said = heard.iter().filter(|(by, _)| by == who);
    said.map(|(_, what)| what.clone()).collect()
}

/// Puts and deletes on every topic, and on what is fetched late of it.
fn speak(session: &Session, who: &str, topics: &BTreeSet<String>) {
    for topic in topics {
        for key in [key(topic), format!("{}/@adv/pub/1/2/_", key(topic))] {
            let put = session.put(&key, "x").attachment(who);
            put.wait().expect("said");
            let delete = session.delete(&key).attachment(who);
            delete.wait().expect("said");
        }
    }
}

fn all(topics: &BTreeSet<String>) -> BTreeSet<String> {
    let keys = topics.iter().map(|topic| key(topic));
    let keys = keys.flat_map(|key| [format!("{key}/@adv/pub/1/2/_"), key]);
    keys.flat_map(|key| [format!("- {key}"), key]).collect()
}

#[test]
fn a_stranger_reads_every_topic_and_writes_none() {
    let guarded = Guarded::start("turn_mill.toml", "");
    let (topics, witness) = (guarded.topics(), guarded.witness());
    assert!(topics.len() > 50, "{}", topics.len());
    for mode in MODES {
        let stranger = guarded.stranger(mode);
        let heard = witness.hears(&stranger, mode, &topics);
        assert_eq!(heard, BTreeSet::new(), "{mode}");
        stranger.close().wait().expect("closed");
    }
    // The same by the socket is heard, and a stranger hears it, too.
    let stranger = guarded.stranger("client");
    let read = listen(&stranger);
    let own = guarded.own();
    let deadline = Instant::now() + PATIENCE;
    while witness.hears(&own, "own", &topics) != all(&topics) || of(&read, "own") != all(&topics) {
        assert!(Instant::now() < deadline, "{:?}", of(&read, "own"));
    }
}

#[test]
fn a_stranger_that_takes_the_identity_of_a_process_writes_nothing() {
    let guarded = Guarded::start("turn_mill.toml", "");
    let (topics, witness) = (guarded.topics(), guarded.witness());
    let own = guarded.own();
    let more = json!({
        "id": own.zid().to_string(),
        "transport": { "unicast": { "max_links": 4 }, "auth": { "usrpwd": { "user": "operator", "password": "x" } } },
    });
    // Zenoh may refuse the second session of one identity.
    if let Ok(impostor) = open(&guarded.network, "client", &more) {
        speak(&impostor, "impostor", &topics);
    }
    let other = guarded.stranger("client");
    reach(&other, &witness.sentinel);
    assert_eq!(of(&witness.heard, "impostor"), BTreeSet::new());
}

/// Tokens of every kind on a topic, under the names of the processes and under one that is none.
fn announce(session: &Session, who: &str, names: &[String], topic: &str) -> Vec<LivelinessToken> {
    let topic = format!("/{topic}").replace('/', "%");
    let mut declared = Vec::new();
    for name in names {
        for kind in ["NN", "MP", "MS", "SS", "SC"] {
            let token = format!("@ros2_lv/0/{who}/0/1/{kind}/%/%turn_mill/{name}/{topic}/T/H/q");
            let token = session.liveliness().declare_token(token);
            declared.push(token.wait().expect("said"));
        }
    }
    declared
}

#[test]
fn a_stranger_announces_what_reads_under_a_name_of_its_own() {
    let guarded = Guarded::start("turn_mill.toml", "");
    let productions = policy::productions(&guarded.cell).expect("productions");
    let mut names: Vec<String> = productions.into_keys().collect();
    names.push("rviz".to_owned());
    let witness = guarded.own();
    let heard = Heard::default();
    let into = Arc::clone(&heard);
    let tokens = witness
        .liveliness()
        .declare_subscriber("@ros2_lv/0/**")
        .callback(move |sample: Sample| {
            let key = sample.key_expr().to_string();
            let parts: Vec<&str> = key.split('/').collect();
            let said = (parts[2].to_owned(), format!("{} {}", parts[5], parts[8]));
            into.lock().expect("no panic").insert(said);
        });
    tokens.background().wait().expect("a subscription");
    let sentinel = sentinel(&witness);
    for mode in MODES {
        let stranger = guarded.stranger(mode);
        reach(&stranger, &sentinel);
        let declared = announce(&stranger, mode, &names, "turn_mill/corrections");
        reach(&stranger, &sentinel);
        let expected = ["NN rviz", "MS rviz", "SC rviz"].map(str::to_owned);
        assert_eq!(of(&heard, mode), BTreeSet::from(expected), "{mode}");
        drop(declared);
        stranger.close().wait().expect("closed");
    }
    // A stranger finds the processes of the cell, those that come later and those that are there.
    let own = guarded.own();
    let declared = announce(&own, "own", &names, "turn_mill/corrections");
    reach(&own, &sentinel);
    assert_eq!(of(&heard, "own").len(), declared.len());
    let stranger = guarded.stranger("peer");
    reach(&stranger, &sentinel);
    let found = stranger
        .liveliness()
        .get("@ros2_lv/0/own/**")
        .timeout(PATIENCE);
    assert_eq!(
        found.wait().expect("asked").into_iter().count(),
        declared.len()
    );
}

/// Services of the cell, of the actions `plan` and `run`, and by which a process tells its parameters.
fn services() -> Vec<String> {
    let own = policy::SERVICES.map(|(name, _)| name.to_owned());
    let action = ["plan", "run"].into_iter().flat_map(|action| {
        ["send_goal", "cancel_goal", "get_result"].map(|part| format!("{action}/_action/{part}"))
    });
    let parameters = parameters::READING.iter().chain(&parameters::SETTING);
    let parameters = parameters.map(|name| format!("cycle/{name}"));
    own.into_iter().chain(action).chain(parameters).collect()
}

/// Serves each service of the cell.
fn serve(session: &Session, by: &str, heard: &Heard) {
    for name in services() {
        let (into, by, key) = (Arc::clone(heard), by.to_owned(), service(&name));
        let answer = key.clone();
        let queryable = session
            .declare_queryable(&key)
            .callback(move |query: Query| {
                let who = query.payload().map(|who| who.to_bytes().into_owned());
                let who = String::from_utf8_lossy(&who.unwrap_or_default()).into_owned();
                into.lock()
                    .expect("no panic")
                    .insert((who, format!("{by} {name}")));
                query.reply(&answer, by.as_str()).wait().expect("a reply");
            });
        queryable.background().wait().expect("a queryable");
    }
}

fn service(name: &str) -> String {
    format!("0/turn_mill/{name}/T/H")
}

fn call_all(session: &Session, who: &str) {
    let calls: Vec<_> = services()
        .iter()
        .map(|name| {
            let call = session.get(service(name)).payload(who).timeout(PATIENCE);
            call.wait().expect("asked")
        })
        .collect();
    for replies in calls {
        for reply in replies {
            let reply = reply
                .result()
                .expect("no error")
                .payload()
                .to_bytes()
                .into_owned();
            assert_eq!(reply, b"own", "{who}");
        }
    }
}

#[test]
fn a_stranger_calls_what_reads_and_serves_nothing() {
    for (more, called) in [
        ("", &["status"][..]),
        (
            "strangers_call = [\"stop\", \"run\", \"plan\"]",
            &[
                "plan",
                "plan/_action/send_goal",
                "plan/_action/cancel_goal",
                "plan/_action/get_result",
                "run",
                "run/_action/send_goal",
                "run/_action/cancel_goal",
                "run/_action/get_result",
                "status",
                "stop",
            ],
        ),
    ] {
        let guarded = Guarded::start("turn_mill.toml", more);
        let (own, heard) = (guarded.own(), Heard::default());
        serve(&own, "own", &heard);
        let sentinel = sentinel(&own);
        for mode in MODES {
            let stranger = guarded.stranger(mode);
            reach(&stranger, &sentinel);
            call_all(&stranger, mode);
            reach(&stranger, &sentinel);
            let told = parameters::READING.map(|name| format!("own cycle/{name}"));
            let expected = called.iter().map(|name| format!("own {name}")).chain(told);
            assert_eq!(of(&heard, mode), expected.collect(), "{mode} {more}");
            // Nobody is asked in the place of the cell.
            serve(&stranger, &format!("impostor {mode}"), &heard);
            reach(&stranger, &sentinel);
            let console = guarded.own();
            reach(&console, &sentinel);
            call_all(&console, &format!("console beside {mode}"));
            assert_eq!(
                of(&heard, &format!("console beside {mode}")).len(),
                services().len()
            );
            stranger.close().wait().expect("closed");
        }
    }
}

#[test]
fn an_external_driver_and_what_the_cell_file_names_are_open() {
    let guarded = Guarded::start("external.toml", "strangers_publish = [\"reference\"]");
    let witness = guarded.witness();
    let stranger = guarded.stranger("client");
    let names = [
        "controller_status",
        "probe_triggers",
        "controller_replies",
        "reference",
    ];
    let open = names.map(|name| format!("external/{name}"));
    assert_eq!(
        witness.hears(&stranger, "driver", &guarded.topics()),
        all(&BTreeSet::from(open))
    );
    // It is told what the cell says to it, and asked for what was lost.
    let told = listen(&stranger);
    let commands = BTreeSet::from(["external/controller_commands".to_owned()]);
    let deadline = Instant::now() + PATIENCE;
    while of(&told, "gate") != all(&commands) {
        assert!(Instant::now() < deadline);
        reach(&stranger, &witness.sentinel);
        speak(&witness.session, "gate", &commands);
        reach(&stranger, &witness.sentinel);
    }
    let late = "0/external/probe_triggers/T/H/@adv/pub/1/2/_";
    let cache = stranger
        .declare_queryable(late)
        .callback(move |query: Query| {
            query.reply(late, "late").wait().expect("a reply");
        });
    cache.background().wait().expect("a queryable");
    reach(&witness.session, late);
}

/// What a robot publishes, and what it serves.
const ROBOT_TOPICS: [&str; 2] = ["joint_states", "contact"];
const ROBOT_SERVICES: [&str; 7] = [
    "arm/follow_joint_trajectory/_action/send_goal",
    "arm/follow_joint_trajectory/_action/get_result",
    "arm/follow_joint_trajectory/_action/cancel_goal",
    "program/bore",
    "program/stop",
    "program/set_parameters",
    "program/get_parameters",
];
const ROBOT: &str = r#"
[ros2]
action = "/arm/follow_joint_trajectory"
contact = { topic = "/contact", positions = "interpolated", time_standard_uncertainty_ms = 0.2 }
[ros2.program]
node = "/program"
stop = "/program/stop"
operations = [{ id = "bore", service = "/program/bore" }]
tools = [{ number = 1, parameter = "wear" }]
work_offsets = [{ axis = "X", parameter = "x" }, { axis = "Y", parameter = "y" }, { axis = "Z", parameter = "z" }]
"#;

#[test]
fn a_robot_on_ros_2_speaks_and_serves_what_its_section_names() {
    let guarded = Guarded::start_changed("robot_cell.toml", |text| {
        let source = "source = \"simulator\"";
        assert!(text.contains(source));
        text.replace(source, "source = \"ros2\"") + ROBOT
    });
    let witness = guarded.witness();
    let robot = guarded.stranger("client");
    let mut topics = guarded.topics();
    topics.extend(ROBOT_TOPICS.map(str::to_owned));
    topics.extend(ROBOT_SERVICES.map(str::to_owned));
    let heard = witness.hears(&robot, "robot", &topics);
    let spoken: BTreeSet<String> = ROBOT_TOPICS.into_iter().map(str::to_owned).collect();
    assert_eq!(heard, all(&spoken));
    let into = Heard::default();
    let found = Arc::clone(&into);
    let tokens = witness
        .session
        .liveliness()
        .declare_subscriber("@ros2_lv/0/robot/**")
        .callback(move |sample: Sample| {
            let key = sample.key_expr().to_string();
            let parts: Vec<&str> = key.split('/').collect();
            let said = (parts[5].to_owned(), parts[9].replace('%', "/"));
            found.lock().expect("no panic").insert(said);
        });
    tokens.background().wait().expect("a subscription");
    // The driver finds its services and calls them. By then the router knows that the witness listens to tokens.
    for name in ROBOT_SERVICES {
        let key = common::serve(&robot, format!("0/{name}/T/H"));
        reach(&witness.session, &key);
    }
    // It announces them under a name of its own, and nothing else that speaks.
    let mut declared = Vec::new();
    for topic in &topics {
        declared.extend(announce(&robot, "robot", &["ur10".to_owned()], topic));
    }
    reach(&robot, &witness.sentinel);
    let spoken = ROBOT_TOPICS.map(|name| format!("/{name}"));
    assert_eq!(of(&into, "MP"), BTreeSet::from(spoken));
    let served = ROBOT_SERVICES.map(|name| format!("/{name}"));
    assert_eq!(of(&into, "SS"), BTreeSet::from(served));
}

#[test]
fn a_bus_that_the_cell_file_opens_is_open() {
    let guarded = Guarded::start("turn_mill.toml", "strangers = \"write\"");
    let (topics, witness) = (guarded.topics(), guarded.witness());
    let stranger = guarded.stranger("client");
    assert_eq!(witness.hears(&stranger, "stranger", &topics), all(&topics));
}

/// `probecell router` is of no cell: its rules are those that the tests above prove, for the names of the processes of any cell.
#[test]
fn a_router_of_no_cell_has_the_rules_of_a_cell() {
    let guarded = Guarded::start("turn_mill.toml", "");
    let rules = strangers::access_control(&guarded.cell).expect("a policy");
    let [mut of_cell, mut of_none] =
        [rules.expect("rules"), strangers::read_only()].map(|rules| json!(rules));
    let own = |rules: &mut Value| -> BTreeSet<String> {
        let rules = rules["rules"].as_array_mut().expect("rules");
        let own = rules.iter_mut().find(|rule| rule["id"] == "own_names");
        let names = own.expect("own names")["key_exprs"].take();
        serde_json::from_value(names).expect("keys")
    };
    let names = own(&mut of_cell);
    assert!(names.len() > 8 && own(&mut of_none).is_superset(&names));
    assert_eq!(of_cell, of_none);
}
