//! A secured cell, on real sessions over loopback: each user tries every topic and every service, and what reaches the
//! others is exactly what the policy allows.

use std::{collections::BTreeSet, net::TcpListener, path::Path, sync::Arc};

use cell::{
    Cell, CellText,
    keys::{BusUsers, KeyFolder},
    policy,
};
use host::bus::{Observed, Qos, Router, RouterConfig, Storage, TypeId};
use serde_json::{Value, json};
use zenoh::{Session, Wait, query::Query, sample::Sample};

use crate::common::{self, Heard, PATIENCE, key, reach};

struct Secured {
    cell: Cell,
    users: BusUsers,
    endpoint: String,
    router: Router,
    _keys: tempfile::TempDir,
}

impl Secured {
    fn start() -> Self {
        let keys = tempfile::tempdir().expect("a folder");
        let port = TcpListener::bind("127.0.0.1:0").and_then(|socket| socket.local_addr());
        let endpoint = format!("tcp/{}", port.expect("a port"));
        let file = Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../launch-scripts/turn_mill.toml"
        ));
        let shipped = Cell::read(file).expect("the shipped cell");
        let text = CellText {
            cell: format!(
                "{}\n[approvals]\nkey_folder = \"{}\"\n",
                shipped.text().cell,
                keys.path().display()
            ),
            ..shipped.text().clone()
        };
        let cell = Cell::from_text(text).expect("a cell");
        let users = KeyFolder::of(&cell)
            .expect("a folder")
            .secure(&cell)
            .expect("secured");
        let settings = users.router(&cell).expect("a policy");
        let router = RouterConfig {
            listen: vec![endpoint.clone()],
            zenoh: serde_json::to_value(settings).expect("a table"),
            ..RouterConfig::default()
        };
        let router = Router::start(&router).expect("a router");
        Self {
            cell,
            users,
            endpoint,
            router,
            _keys: keys,
        }
    }

    fn names(&self) -> Vec<String> {
        policy::users(&self.cell).expect("users")
    }

    /// A session with the password of a user.
    fn session(&self, user: &str) -> Session {
        let settings = self.users.session(user, None);
        self.open(serde_json::to_value(settings).expect("a table"))
            .expect("a user of the cell")
    }

    fn open(&self, mut settings: Value) -> zenoh::Result<Session> {
        settings["mode"] = json!("client");
        settings["connect"] =
            json!({ "endpoints": [self.endpoint], "timeout_ms": 3000, "exit_on_failure": true });
        settings["scouting"] = json!({ "multicast": { "enabled": false } });
        let config = zenoh::Config::from_json5(&settings.to_string()).expect("settings");
        zenoh::open(config).wait()
    }
}

/// A key that everybody may ask, and that this user may serve. Its answer comes after all that was said to the same
/// session before the question.
fn sentinel(session: &Session, user: &str, topic: &str) -> String {
    let key = format!("0/{topic}/T/H/@adv/sentinel/{user}");
    common::serve(session, key)
}

/// Asks once, of a sentinel that has been reached before.
fn ask(session: &Session, sentinel: &str) {
    let replies = session
        .get(sentinel)
        .timeout(PATIENCE)
        .wait()
        .expect("a question");
    let reply = replies.recv().expect("an answer");
    assert!(reply.result().is_ok(), "{sentinel}");
}

#[test]
fn each_user_puts_on_its_own_topics_and_on_no_other() {
    let secured = Secured::start();
    let productions = policy::productions(&secured.cell).expect("productions");
    let topics: BTreeSet<&String> = productions.values().flatten().collect();
    assert!(
        topics.len() > 50 && productions.len() >= 10,
        "{} of {}",
        topics.len(),
        productions.len()
    );
    let witness = secured.session(policy::RECORDER);
    let heard = Heard::default();
    let into = Arc::clone(&heard);
    let subscriber = witness
        .declare_subscriber("0/**")
        .callback(move |sample: Sample| {
            let who = sample
                .attachment()
                .map(|who| String::from_utf8_lossy(&who.to_bytes()).into_owned());
            let said = (who.unwrap_or_default(), sample.key_expr().to_string());
            into.lock().expect("no panic").insert(said);
        });
    subscriber.background().wait().expect("a subscription");
    let sentinel = sentinel(&witness, policy::RECORDER, "turn_mill/recording_status");
    for user in secured.names() {
        let session = secured.session(&user);
        reach(&session, &sentinel);
        for topic in &topics {
            session
                .put(key(topic), "x")
                .attachment(user.as_str())
                .wait()
                .expect("said");
            session
                .delete(key(topic))
                .attachment(user.as_str())
                .wait()
                .expect("said");
        }
        ask(&session, &sentinel);
        let heard = heard.lock().expect("no panic");
        let of_user: BTreeSet<&str> = heard
            .iter()
            .filter(|(who, _)| *who == user)
            .map(|(_, key)| key.as_str())
            .collect();
        let own: Vec<String> = productions
            .get(&user)
            .into_iter()
            .flatten()
            .map(|topic| key(topic))
            .collect();
        assert_eq!(of_user, own.iter().map(String::as_str).collect(), "{user}");
        session.close().wait().expect("closed");
    }
}

#[test]
fn every_user_asks_for_what_the_router_keeps() {
    let secured = Secured::start();
    let kept = Observed {
        name: "machine_state".to_owned(),
        ty: TypeId::new("probecell_msgs::msg::dds_::T_", "H"),
        qos: Qos::latched(1),
    };
    let storage = Storage::open(0, vec![kept], None).expect("memory");
    storage.keep("/turn_mill/machine_state", b"kept", 1_500_000_000);
    let storage = Arc::new(storage);
    secured.router.serve(&storage).expect("served");
    for user in secured.names() {
        let session = secured.session(&user);
        let asked = session.get("0/**/machine_state/probecell_msgs::msg::dds_::T_/H");
        let replies = asked.timeout(PATIENCE).wait().expect("asked");
        let mut samples = replies.iter().filter_map(|reply| reply.into_result().ok());
        let sample = samples.next().expect("an answer");
        assert_eq!(&*sample.payload().to_bytes(), b"kept", "{user}");
        let stamp = sample
            .timestamp()
            .expect("a stamp")
            .get_time()
            .to_duration();
        assert!((stamp.as_secs_f64() - 1.5).abs() < 1e-6, "{stamp:?}");
        assert!(samples.next().is_none() && sample.attachment().is_none());
    }
}

#[test]
fn each_user_announces_itself_and_nobody_else() {
    let secured = Secured::start();
    let names = secured.names();
    let witness = secured.session(policy::RECORDER);
    let heard = Heard::default();
    let into = Arc::clone(&heard);
    let tokens = witness
        .liveliness()
        .declare_subscriber("@ros2_lv/0/**")
        .callback(move |sample: Sample| {
            let key = sample.key_expr().to_string();
            let parts: Vec<&str> = key.split('/').collect();
            into.lock()
                .expect("no panic")
                .insert((parts[2].to_owned(), format!("{} {}", parts[5], parts[8])));
        });
    tokens.background().wait().expect("a subscription");
    let sentinel = sentinel(&witness, policy::RECORDER, "turn_mill/recording_status");
    let processes = policy::productions(&secured.cell).expect("productions");
    for user in &names {
        let session = secured.session(user);
        reach(&session, &sentinel);
        let mut declared = Vec::new();
        for name in &names {
            for kind in ["NN", "MP", "MS", "SS", "SC"] {
                let token = format!(
                    "@ros2_lv/0/{user}/0/1/{kind}/%/%turn_mill/{name}/%turn_mill%corrections/T/H/q"
                );
                declared.push(
                    session
                        .liveliness()
                        .declare_token(token)
                        .wait()
                        .expect("said"),
                );
            }
        }
        ask(&session, &sentinel);
        let heard = heard.lock().expect("no panic");
        let told: BTreeSet<String> = heard
            .iter()
            .filter(|(who, _)| who == user)
            .map(|(_, what)| what.clone())
            .collect();
        let kinds: &[&str] = match user.as_str() {
            policy::SCREEN => &["NN", "MS"],
            policy::CONSOLE | policy::ROS => &["NN", "MS", "SC"],
            _ => &["NN", "MP", "MS", "SS", "SC"],
        };
        let allowed = |name: &String| !processes.contains_key(user) || name == user;
        let expected = names.iter().filter(|name| allowed(name));
        let expected =
            expected.flat_map(|name| kinds.iter().map(move |kind| format!("{kind} {name}")));
        assert_eq!(told, expected.collect(), "{user}");
        drop(declared);
        session.close().wait().expect("closed");
    }
}

#[test]
fn services_are_called_by_operators_and_served_by_their_process_only() {
    let secured = Secured::start();
    let service = |name: &str| format!("0/turn_mill/{name}/T/H");
    let heard = Heard::default();
    let serve = |session: &Session, by: &str, name: &str| {
        let (into, by, key) = (Arc::clone(&heard), by.to_owned(), service(name));
        let answer = key.clone();
        let queryable = session
            .declare_queryable(&key)
            .callback(move |query: Query| {
                let who = query
                    .payload()
                    .map(|who| String::from_utf8_lossy(&who.to_bytes()).into_owned());
                let asked = (who.unwrap_or_default(), format!("{by} {answer}"));
                into.lock().expect("no panic").insert(asked);
                query.reply(&answer, by.as_str()).wait().expect("a reply");
            });
        queryable.background().wait().expect("a queryable");
    };
    let topic = |user: &str| {
        if user == policy::LAUNCHER {
            "turn_mill/approvals"
        } else {
            "turn_mill/recording_status"
        }
    };
    let servers: Vec<(Session, String)> = [policy::LAUNCHER, policy::RECORDER]
        .map(|user| {
            let session = secured.session(user);
            let sentinel = sentinel(&session, user, topic(user));
            (session, sentinel)
        })
        .into();
    // Those of the cell, of the action, and by which the launcher tells its parameters.
    let of_launcher = [
        "run/_action/send_goal",
        "run/_action/cancel_goal",
        "plan/_action/send_goal",
        "plan/_action/cancel_goal",
        "operator/get_parameters",
        "operator/set_parameters",
    ];
    let services: Vec<(&str, &str)> = policy::SERVICES
        .into_iter()
        .chain(of_launcher.map(|name| (name, policy::LAUNCHER)))
        .collect();
    for &(name, server) in &services {
        let at = usize::from(server == policy::RECORDER);
        serve(&servers[at].0, server, name);
    }
    let may_call = [policy::CONSOLE, policy::ROS];
    for user in secured.names() {
        let session = secured.session(&user);
        for (_, sentinel) in &servers {
            reach(&session, sentinel);
        }
        let mut asked = Vec::new();
        for &(name, _) in &services {
            let get = session
                .get(service(name))
                .payload(user.as_str())
                .timeout(PATIENCE);
            asked.push(get.wait().expect("asked"));
        }
        for (_, sentinel) in &servers {
            ask(&session, sentinel);
        }
        let count = heard
            .lock()
            .expect("no panic")
            .iter()
            .filter(|(who, _)| *who == user)
            .count();
        let expected = if may_call.contains(&user.as_str()) {
            services.len()
        } else {
            0
        };
        assert_eq!(count, expected, "{user}");
        // Nobody else is asked in their place.
        for &(name, server) in &services {
            if server != user {
                serve(&session, &format!("impostor {user}"), name);
            }
        }
        for (_, sentinel) in &servers {
            ask(&session, sentinel);
        }
        let console = secured.session(policy::CONSOLE);
        for &(name, server) in &services {
            let replies = console
                .get(service(name))
                .payload("check")
                .timeout(PATIENCE)
                .wait()
                .expect("asked");
            let by: Vec<String> = replies
                .into_iter()
                .filter_map(|reply| {
                    Some(
                        reply
                            .result()
                            .ok()?
                            .payload()
                            .try_to_string()
                            .ok()?
                            .into_owned(),
                    )
                })
                .collect();
            assert_eq!(by, [server], "{name}, with {user} beside it");
        }
        console.close().wait().expect("closed");
        drop(asked);
        session.close().wait().expect("closed");
    }
}

#[test]
fn nobody_joins_without_a_password() {
    let secured = Secured::start();
    assert!(secured.open(json!({})).is_err(), "no user");
    for (user, password) in [("recorder", "0"), ("nobody", "0"), ("recorder", "")] {
        let usrpwd = json!({ "transport": { "auth": { "usrpwd": { "user": user, "password": password } } } });
        assert!(secured.open(usrpwd).is_err(), "{user} {password:?}");
    }
    secured.session("recorder").close().wait().expect("closed");
}
