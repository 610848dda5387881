//! A node that no list of the workspace knows joins a cell: one value is all that it takes.

use cell::{Cell, NodeEntry};
use cell_tests::{cell, factories, make_part, messages, recording};
use graph::{
    FaultCode, Node, Outbox, Qos, Running, Stamp, Wiring, declare_topics, faults, inputs, outputs,
    replay::{Verdict, replay},
    topics,
};
use probecell_msgs::{Fault, PartReport, ProbeEvent, std_msgs};

declare_topics! {
    COUNTS = "contact_counter", "contact_counter/counts", std_msgs::String, Qos::latched(1);
    FAULTS = "contact_counter", "contact_counter/faults", Fault, Qos::KEEP_ALL;
}

inputs! {
    /// What `contact_counter` subscribes to.
    pub enum Input {
        /// One probing move and its outcome.
        Event(ProbeEvent) = topics::PROBE_EVENTS,
        /// How the part ended.
        Part(PartReport) = topics::PART_REPORTS,
    }
}

outputs! {
    /// What `contact_counter` publishes.
    pub enum Output {
        /// Number of contacts of a part.
        Counts(std_msgs::String) = COUNTS,
        /// What went wrong.
        Fault(Fault) = FAULTS,
    }
}

faults! {
    /// What `contact_counter` can find wrong.
    pub enum CounterFault of "contact_counter" {
        /// A part ended without a single contact.
        NoContacts = WARNING "no_contacts",
    }
}

/// Its state is the number of contacts so far.
struct ContactCounter;

impl Node for ContactCounter {
    const NAME: &'static str = "contact_counter";
    type Config = ();
    type State = u64;
    type Input = Input;
    type Output = Output;
    type Fault = CounterFault;

    fn start((): &()) -> u64 {
        0
    }

    fn step((): &(), contacts: &mut u64, now: Stamp, input: Input, out: &mut Outbox<Output>) {
        match input {
            Input::Timer(_) => {}
            Input::Event(event) => {
                *contacts += u64::from(event.outcome == ProbeEvent::OUTCOME_TOUCHED);
            }
            Input::Part(part) => {
                if *contacts == 0 {
                    let text = format!("part {:?} was never touched", part.part_id);
                    out.fault(now, CounterFault::NoContacts, text);
                }
                let data = format!("{contacts} contacts");
                out.send(Output::Counts(std_msgs::String { data }));
            }
        }
    }
}

fn counted() -> Cell {
    cell("turn_mill.toml", str::to_owned).with_node(NodeEntry {
        name: ContactCounter::NAME,
        make: |_| Ok(Box::new(Running::<ContactCounter>::new(()))),
    })
}

#[test]
fn it_runs_is_recorded_and_is_replayed_with_the_others() {
    let cell = counted();
    let (_, log) = make_part(&cell, "punch");
    let events = messages::<ProbeEvent>(&log, topics::PROBE_EVENTS.name);
    let counts = messages::<std_msgs::String>(&log, COUNTS.name);
    assert!(events.len() > 10);
    assert_eq!(counts.len(), 1);
    assert_eq!(counts[0].data, format!("{} contacts", events.len()));
    let report = replay(&recording(&log), &factories(&cell, &cell.node_names())).expect("a wiring");
    assert_eq!(report.verdict, Verdict::Equal);
    let topic = report
        .topics
        .iter()
        .find(|topic| topic.topic == COUNTS.name);
    assert_eq!(topic.map(|topic| topic.equal), Some(1));
}

#[test]
fn its_topics_are_those_of_the_cell_and_its_faults_are_listed() {
    let cell = counted();
    let nodes = cell.nodes(false).expect("nodes");
    let wiring = Wiring::of(&nodes).expect("a wiring");
    let known = cell.topics().expect("topics");
    for topic in ALL {
        assert!(known.iter().any(|known| known.name == topic.name));
        assert!(topics::by_name(topic.name).is_none(), "it is in no table");
        let producer = wiring.producer(topic.name).map(|index| &nodes[index]);
        let codes = producer.map(|node| (node.name(), node.fault_codes()));
        let expected = (ContactCounter::NAME, vec![CounterFault::NoContacts.code()]);
        assert_eq!(codes, Some(expected));
    }
    assert_eq!(known.len(), topics::ALL.len() + ALL.len());
}

#[test]
fn a_cell_without_it_does_not_know_it() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let refused = cell.instance(ContactCounter::NAME, false).err();
    let text = refused.expect("an error").to_string();
    assert!(
        text.starts_with("there is no node \"contact_counter\""),
        "{text}"
    );
}
