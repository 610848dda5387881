//! Every order of events about two corrections, two operators and what else may happen within stated bounds: no write that
//! must not be; and gates that are wrong in one respect each are found out.

use cell_tests::{cell, instance};
use fault_world::{Alteration, Bounds, Cells, SEARCHES, Search, StandIn, altered};
use graph::{DeliverError, Emitted, Instance, Stamp, Topic, topics};
use probecell_msgs::{ControllerStatus, Correction, OperatorKeys, PartStatus, from_cdr};
use serde_json::{Value, json};

/// States of a search; those nearest to the start of one that has more.
fn limit() -> usize {
    shared_data::share(4_000, 40_000)
}

#[test]
fn no_order_of_events_writes_a_correction_that_must_not_be_written() {
    let cells = Cells::default();
    let mut search = Search::new(cells.of(1), None);
    let (mut states, mut writes, mut exhausted) = (0, 0, 0);
    for &bounds in SEARCHES {
        let found = search.run(bounds, limit());
        println!("{found}, of {bounds:?}");
        assert_eq!(found.violation, None, "{bounds:?}");
        assert!(found.writes > 0, "{bounds:?} writes nothing");
        states += found.states;
        writes += found.writes;
        exhausted += usize::from(found.exhausted);
    }
    println!("{states} states, {writes} writes");
    assert!(
        exhausted >= shared_data::share(1, 5),
        "{exhausted} searches ended before their limit"
    );
}

/// States of the search in which a wrong gate is found out.
const WRONG_LIMIT: usize = 40_000;

/// A gate that is wrong: it is deaf to some messages, or its state is changed after each step.
struct Wrong {
    deaf: fn(Topic, &[u8]) -> bool,
    changed: fn(&mut Value),
}

impl Alteration for Wrong {
    fn deliver(
        &mut self,
        node: &mut dyn Instance,
        now: Stamp,
        port: usize,
        cdr: &[u8],
    ) -> Result<Emitted, DeliverError> {
        if (self.deaf)(node.inputs()[port], cdr) {
            return Ok(Emitted::default());
        }
        node.deliver(now, port, cdr)
    }

    fn snapshot(&self, node: &dyn Instance) -> Value {
        let mut snapshot = node.snapshot();
        (self.changed)(&mut snapshot);
        snapshot
    }
}

fn deaf(node: Box<dyn Instance>, deaf: fn(Topic, &[u8]) -> bool) -> Box<dyn Instance> {
    wrong(node, deaf, |_| {})
}

fn changed(node: Box<dyn Instance>, changed: fn(&mut Value)) -> Box<dyn Instance> {
    wrong(node, |_, _| false, changed)
}

fn wrong(
    node: Box<dyn Instance>,
    deaf: fn(Topic, &[u8]) -> bool,
    changed: fn(&mut Value),
) -> Box<dyn Instance> {
    altered(node, "machine_state", Wrong { deaf, changed })
}

/// The gate of a cell with another setting.
fn of_settings(node: Box<dyn Instance>, from: &str, to: &str) -> Box<dyn Instance> {
    if node.name() != "machine_state" {
        return node;
    }
    let other = cell("turn_mill.toml", |text| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    });
    instance(&other, "machine_state")
}

/// A gate that is wrong, what has to happen that it shows, and what is said of it.
struct Mutation {
    name: &'static str,
    gate: StandIn,
    bounds: Bounds,
    says: &'static str,
}

/// Bounds of these numbers.
fn bounds(answers: u8, change: fn(&mut Bounds)) -> Bounds {
    let mut bounds = Bounds {
        answers,
        ..Bounds::default()
    };
    change(&mut bounds);
    bounds
}

fn sends(topic: Topic, known: Topic) -> bool {
    topic.name == known.name
}

fn mutations() -> Vec<Mutation> {
    vec![
        Mutation {
            name: "forgets what it has written",
            gate: |node| {
                changed(node, |state| {
                    state["applied"] = json!({});
                    // It takes what the driver holds for what the correction was computed from.
                    let wear = state["controller"]["status"]["tool_wear"].as_array_mut();
                    wear.into_iter().flatten().for_each(|one| *one = json!(0.0));
                })
            },
            bounds: bounds(1, |bounds| bounds.repeats = 1),
            says: "is written twice",
        },
        Mutation {
            name: "is deaf to STOP",
            gate: |node| deaf(node, |topic, _| sends(topic, topics::STOP_REQUESTS)),
            bounds: bounds(1, |bounds| bounds.stops = 1),
            says: "after a STOP",
        },
        Mutation {
            name: "is deaf to rejections",
            gate: |node| {
                deaf(node, |topic, cdr| {
                    sends(topic, topics::CORRECTIONS)
                        && from_cdr::<Correction>(cdr)
                            .is_ok_and(|one| one.approval == Correction::APPROVAL_REJECTED)
                })
            },
            bounds: bounds(2, |bounds| bounds.losses = 1),
            says: "after a rejection",
        },
        Mutation {
            name: "is deaf to the withdrawal of a key",
            gate: |node| {
                deaf(node, |topic, cdr| {
                    sends(topic, topics::OPERATOR_KEYS)
                        && from_cdr::<OperatorKeys>(cdr).is_ok_and(|keys| keys.number > 1)
                })
            },
            bounds: bounds(1, |bounds| bounds.withdrawals = 1),
            says: "without a signature of an operator in force",
        },
        Mutation {
            name: "believes what is not signed",
            gate: |node| {
                let from = "[machine_state]";
                of_settings(
                    node,
                    from,
                    "[approvals]\nunsigned_operators = true\n[machine_state]",
                )
            },
            bounds: bounds(0, |bounds| bounds.forgeries = 1),
            says: "without a signature of an operator in force",
        },
        Mutation {
            name: "has no limit of its own",
            gate: |node| of_settings(node, "wear_limit_mm = 0.110", "wear_limit_mm = 10.0"),
            bounds: bounds(0, |bounds| bounds.forgeries = 1),
            says: "out of bounds",
        },
        Mutation {
            name: "takes any plan for measured",
            gate: |node| {
                changed(node, |state| {
                    state["measured"]["other/1"] = json!(1);
                    state["part"]["status"]["plan_id"] = json!("other/1");
                })
            },
            bounds: bounds(0, |bounds| bounds.forgeries = 1),
            says: "is written without a source",
        },
        Mutation {
            name: "does not notice another session of the driver",
            gate: |node| {
                deaf(node, |topic, cdr| {
                    sends(topic, topics::CONTROLLER_STATUS)
                        && from_cdr::<ControllerStatus>(cdr)
                            .is_ok_and(|sample| sample.session.ends_with("-1"))
                })
            },
            bounds: bounds(1, |bounds| bounds.restarts = 1),
            says: "in another session of the driver",
        },
        Mutation {
            name: "does not notice the end of the part",
            gate: |node| {
                deaf(node, |topic, cdr| {
                    let over = [PartStatus::NONE, PartStatus::STOPPING];
                    sends(topic, topics::PART_REPORTS)
                        || sends(topic, topics::PART_STATUS)
                            && from_cdr::<PartStatus>(cdr)
                                .is_ok_and(|status| over.contains(&status.stage))
                })
            },
            bounds: bounds(1, |bounds| bounds.restarts = 1),
            says: "for a part that has ended or is being stopped",
        },
        Mutation {
            name: "does not notice that cycle is silent",
            gate: |node| changed(node, |state| state["part"]["at"] = json!(i64::MAX / 2)),
            bounds: bounds(1, |bounds| bounds.periods = 3),
            says: "for a part of which nothing has been heard",
        },
    ]
}

/// Each wrong gate is found out by the shortest order of events that shows it, within bounds in which the real one is right.
#[test]
fn wrong_gates_are_found_out() {
    let cells = Cells::default();
    let mut real = Search::new(cells.of(1), None);
    for mutation in mutations() {
        let Mutation {
            name,
            gate,
            bounds,
            says,
        } = mutation;
        let found = Search::new(cells.of(1), Some(gate)).run(bounds, WRONG_LIMIT);
        let (events, why) = found.violation.unwrap_or_default();
        println!("a gate that {name}: {why}: {}", events.join(", "));
        assert!(why.contains(says), "{name}: {why:?}, {events:?}");
        assert_eq!(real.run(bounds, WRONG_LIMIT).violation, None, "{name}");
    }
}
