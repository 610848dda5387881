//! A live agent: what a running cell publishes as numbered observations, and the documents that answer requests for them
//! (MTConnect 2.7 Part 1). Pure: it knows neither the bus nor HTTP.
//!
//! Observations are numbered from 1 in the order in which they came; the newest [`BUFFER`] are kept. A data item that has reported
//! nothing yet, or whose cell has left the bus, is `UNAVAILABLE`.

use std::collections::{BTreeMap, VecDeque};

use exchange::export::date_time;
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{FeatureResult, InspectionPlan, MachineState, ToolOffsets, Verdict};

use super::{AVAILABILITY, EXECUTION, MEASUREMENTS, MODE, PROGRAM, TOOLS, WORK};
use super::{Content, Document, device, document, item_element, write};
use crate::live::Sizes;

/// Observations kept.
pub const BUFFER: usize = 131_072;
/// Most observations in one answer.
pub const MOST: usize = 10_000;

/// A document, or why there is none, as a document too.
pub type Answer = Result<String, String>;

/// One observation.
#[derive(Clone, Debug)]
struct Observation {
    sequence: u64,
    item: &'static str,
    when: Time,
    content: Content,
}

/// The agent of one cell.
#[derive(Debug)]
pub struct Agent {
    cell: String,
    instance: u64,
    created: Time,
    next: u64,
    buffer: VecDeque<Observation>,
    /// Last value of each data item before the oldest observation kept.
    before: BTreeMap<&'static str, Observation>,
    /// Last value of each data item with a text, so that a sample of the machine is compared without a search.
    latest: BTreeMap<&'static str, String>,
    sizes: Sizes,
}

impl Agent {
    /// An agent of `cell` that begins at `now`; `instance` differs from that of an earlier agent.
    pub fn new(cell: &str, instance: u64, now: Time) -> Self {
        let mut agent = Self {
            cell: cell.to_owned(),
            instance,
            created: now,
            next: 1,
            buffer: VecDeque::new(),
            before: BTreeMap::new(),
            latest: BTreeMap::new(),
            sizes: Sizes::default(),
        };
        for item in [
            AVAILABILITY,
            EXECUTION,
            MODE,
            PROGRAM,
            MEASUREMENTS,
            TOOLS,
            WORK,
        ] {
            agent.change(item, now, "UNAVAILABLE");
        }
        agent
    }

    fn observe(&mut self, item: &'static str, when: Time, content: Content) {
        if self.buffer.len() == BUFFER
            && let Some(oldest) = self.buffer.pop_front()
        {
            self.before.insert(oldest.item, oldest);
        }
        let sequence = self.next;
        self.next += 1;
        self.buffer.push_back(Observation {
            sequence,
            item,
            when,
            content,
        });
    }

    /// The same, where the value of a data item changes.
    fn change(&mut self, item: &'static str, when: Time, text: &str) {
        if self.latest.get(item).is_none_or(|latest| latest != text) {
            self.latest.insert(item, text.to_owned());
            self.observe(item, when, Content::text(text));
        }
    }

    /// Whether the cell is on the bus.
    pub fn present(&mut self, now: Time, is_present: bool) {
        if is_present {
            return self.change(AVAILABILITY, now, "AVAILABLE");
        }
        for item in [AVAILABILITY, EXECUTION, MODE, PROGRAM] {
            self.change(item, now, "UNAVAILABLE");
        }
    }

    /// Takes what the machine is doing.
    pub fn machine(&mut self, state: &MachineState) {
        let when = state.header.stamp;
        let mode = match state.mode {
            MachineState::MODE_AUTO => "AUTOMATIC",
            MachineState::MODE_MDI => "MANUAL_DATA_INPUT",
            _ => "MANUAL",
        };
        self.change(EXECUTION, when, super::execution_name(state.execution));
        self.change(MODE, when, mode);
        let program = if state.program.is_empty() {
            "UNAVAILABLE"
        } else {
            &state.program
        };
        self.change(PROGRAM, when, program);
    }

    /// Takes the offsets that the controller holds.
    pub fn offsets(&mut self, offsets: &ToolOffsets) {
        let when = offsets.header.stamp;
        let (tools, work) = super::held(offsets);
        self.observe(TOOLS, when, Content::Offsets("LENGTH", tools));
        self.observe(WORK, when, Content::Offsets("OFFSET", work));
    }

    /// Takes a plan, whose limits apply where no verdict states others.
    pub fn plan(&mut self, plan: InspectionPlan) {
        self.sizes.plan(plan);
    }

    /// Takes a size. The sizes of its measurement, so far, are one observation.
    pub fn result(&mut self, result: FeatureResult) {
        let when = result.header.stamp;
        self.sizes.result(result);
        self.observe(MEASUREMENTS, when, Content::Sizes(self.sizes.sizes()));
    }

    /// Takes what was decided of a size.
    pub fn verdict(&mut self, verdict: Verdict) {
        let when = verdict.header.stamp;
        if self.sizes.verdict(verdict) {
            self.observe(MEASUREMENTS, when, Content::Sizes(self.sizes.sizes()));
        }
    }

    /// Whether requests for a device of this name or identifier are for this one.
    pub fn is_device(&self, name: &str) -> bool {
        name == self.cell || name == super::uuid(&self.cell)
    }

    /// Number that the next observation gets.
    pub fn next_sequence(&self) -> u64 {
        self.next
    }

    /// Number of the oldest observation kept.
    pub fn first(&self) -> u64 {
        self.buffer.front().map_or(self.next, |one| one.sequence)
    }

    fn head(&self, now: Time) -> Document<'_> {
        Document {
            cell: &self.cell,
            instance: self.instance,
            changed: self.created,
            when: now,
        }
    }

    /// Answers `probe`: the model of the device.
    pub fn probe(&self, now: Time) -> String {
        device(&self.head(now), true)
    }

    /// Answers `current`: the last value of each data item, now or at the observation `at`.
    ///
    /// # Errors
    /// `OUT_OF_RANGE`.
    pub fn current(&self, at: Option<u64>, now: Time) -> Answer {
        let at = at.unwrap_or(self.next - 1);
        let range = self.first()..self.next;
        if !range.contains(&at) {
            return Err(self.out_of_range("at", at, now));
        }
        let kept = self.buffer.iter().take_while(|one| one.sequence <= at);
        let all = self.before.values().chain(kept);
        let last: BTreeMap<&str, &Observation> = all.map(|one| (one.item, one)).collect();
        let mut last: Vec<&Observation> = last.into_values().collect();
        last.sort_by_key(|one| one.sequence);
        Ok(self.streams(&last, self.next, now))
    }

    /// Answers `sample`: up to `count` observations from the number `from` on.
    ///
    /// # Errors
    /// `OUT_OF_RANGE`.
    pub fn sample(&self, from: Option<u64>, count: usize, now: Time) -> Answer {
        let from = from.unwrap_or_else(|| self.first());
        if !(self.first()..=self.next).contains(&from) {
            return Err(self.out_of_range("from", from, now));
        }
        if !(1..=MOST).contains(&count) {
            return Err(self.out_of_range("count", count as u64, now));
        }
        let some = self.buffer.iter().filter(|one| one.sequence >= from);
        let some: Vec<&Observation> = some.take(count).collect();
        let next = some.last().map_or(from, |last| last.sequence + 1);
        Ok(self.streams(&some, next, now))
    }

    fn streams(&self, observations: &[&Observation], next: u64, now: Time) -> String {
        let numbers = [next, self.next - 1, self.first()].map(|number| number.to_string());
        let header = [
            ("nextSequence", numbers[0].as_str()),
            ("lastSequence", numbers[1].as_str()),
            ("firstSequence", numbers[2].as_str()),
        ];
        let mut xml = document("Streams", &self.head(now), &header);
        let uuid = super::uuid(&self.cell);
        xml.open("Streams", &[]);
        let device = [("name", self.cell.as_str()), ("uuid", uuid.as_str())];
        xml.open("DeviceStream", &device);
        for (component, id, name) in [
            ("Device", "device", self.cell.as_str()),
            ("Path", "path", "path"),
        ] {
            let of_component = |one: &&&Observation| (one.item == AVAILABILITY) == (id == "device");
            let own: Vec<_> = observations.iter().filter(of_component).collect();
            if own.is_empty() {
                continue;
            }
            let stream = [
                ("component", component),
                ("componentId", id),
                ("name", name),
            ];
            xml.open("ComponentStream", &stream);
            xml.open("Events", &[]);
            for one in own {
                let (sequence, when) = (one.sequence.to_string(), date_time(one.when));
                let place = (one.item, sequence.as_str(), when.as_str());
                write(&mut xml, item_element(one.item), place, &one.content);
            }
            xml.close();
            xml.close();
        }
        xml.finish()
    }

    fn out_of_range(&self, parameter: &str, given: u64, now: Time) -> String {
        let text = format!(
            "{parameter} = {given} is outside the observations kept, {} to {}, or exceeds the {MOST} of one response",
            self.first(),
            self.next - 1
        );
        self.query_error("OutOfRange", parameter, &text, now)
    }

    /// The error document for a parameter that has no valid value.
    pub fn invalid(&self, parameter: &str, text: &str, now: Time) -> String {
        self.query_error("InvalidParameterValue", parameter, text, now)
    }

    /// The error document for a request that nobody answers; `kind` is its element, such as `Unsupported`.
    pub fn error(&self, kind: &str, uri: &str, text: &str, now: Time) -> String {
        self.error_of((kind, None), uri, text, now)
    }

    /// The schema of version 2.7 leaves `at` out of the parameters that an error may name: then it is a `QueryError`.
    fn query_error(&self, kind: &str, parameter: &str, text: &str, now: Time) -> String {
        if parameter == "at" {
            return self.error_of(("QueryError", None), "/current", text, now);
        }
        self.error_of((kind, Some(parameter)), "/sample", text, now)
    }

    fn error_of(&self, of: (&str, Option<&str>), uri: &str, text: &str, now: Time) -> String {
        let (kind, parameter) = of;
        let mut xml = document("Error", &self.head(now), &[]);
        xml.open("Errors", &[]);
        xml.open(kind, &[]);
        if let Some(parameter) = parameter {
            xml.leaf_with("QueryParameter", &[("name", parameter)], "");
        }
        xml.leaf("URI", uri);
        xml.leaf("ErrorMessage", text);
        xml.finish()
    }
}
