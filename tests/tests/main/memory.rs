//! What a node keeps does not grow with the time that it runs: a million samples of the controller, and as many of the axes.

use std::collections::BTreeMap;

use cell_tests::{ask_for_a_part, cell, executor};
use graph::{Executor, topics};
use serde_json::Value;

/// Samples of the controller in all.
const MESSAGES: usize = 1_000_000;
/// Of those, before the state is looked at first.
const FIRST: usize = 20_000;
/// Values that may come and go: two samples of each stream are within five seconds or not, as their stamps fall.
const SLACK: usize = 200;

/// Numbers, texts and flags of a value.
fn leaves(value: &Value) -> usize {
    match value {
        Value::Array(all) => all.iter().map(leaves).sum(),
        Value::Object(all) => all.values().map(leaves).sum(),
        _ => 1,
    }
}

fn kept(executor: &Executor) -> BTreeMap<&'static str, usize> {
    let nodes = executor.nodes().iter();
    nodes
        .map(|node| (node.name(), leaves(&node.snapshot())))
        .collect()
}

#[test]
fn what_nodes_keep_is_bounded_over_a_million_messages() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let mut executor = executor(&cell);
    ask_for_a_part(&mut executor, "punch");
    let (mut samples, mut axes, mut first) = (0, 0, None);
    while samples < MESSAGES {
        executor.run_until(executor.now().after_s(50.0));
        for published in executor.take_log() {
            samples += usize::from(published.topic == topics::CONTROLLER_STATUS.name);
            axes += usize::from(published.topic == topics::JOINT_STATES.name);
        }
        if first.is_none() && samples >= FIRST {
            first = Some(kept(&executor));
        }
    }
    assert!(axes >= MESSAGES / 2, "{axes} samples of the axes");
    let (first, last) = (first.expect("looked at"), kept(&executor));
    for (node, before) in first {
        let after = last[node];
        assert!(
            after <= before + SLACK,
            "{node}: {before} values after {FIRST} samples, {after} after {samples}"
        );
    }
}
