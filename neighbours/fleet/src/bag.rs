//! One recording as rows of the tables.

mod effects;
mod information;
mod messages;
mod signals;
pub(crate) mod words;

use anyhow::{Context, bail};
use bags::{Bag, Error, Stamped};
use diagnosis::report::Machine;
use diagnosis::{Options, Report};
use machine::Chain;
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{MachineState, Message};

use crate::lake::Rows;
use crate::lake::rows::{Row, Value};
use crate::lake::schema::{PROGRAM, PROMISES, SESSIONS};

/// A recording that is being read.
struct Source<'b> {
    bag: &'b Bag,
    key: &'b str,
    namespace: String,
    machine: String,
    machine_type: String,
    remarks: Vec<String>,
}

impl Source<'_> {
    /// Messages of a topic that can be read; none where it is not there, or is of another version.
    fn read<T: Message>(&mut self, topic: &str) -> anyhow::Result<Vec<Stamped<T>>> {
        let topic = format!("{}/{topic}", self.namespace);
        let typed = match self.bag.typed::<T>(&topic) {
            Ok(typed) => typed,
            Err(Error::NoTopic { .. }) => return Ok(Vec::new()),
            Err(error @ Error::OtherType { .. }) => {
                self.remarks.push(format!("left out: {error}"));
                return Ok(Vec::new());
            }
            Err(error) => return Err(error.into()),
        };
        let mut messages = Vec::new();
        for message in typed {
            match message {
                Ok(message) => messages.push(message),
                // Told once, with the damage of the session.
                Err(Error::Damaged(_)) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(messages)
    }

    /// The beginning of a row.
    fn row(&self, time: i64, values: impl IntoIterator<Item = Value>) -> Row {
        let mut row = vec![
            self.key.into(),
            self.machine.as_str().into(),
            self.machine_type.as_str().into(),
            Value::Moment(time),
        ];
        row.extend(values);
        row
    }
}

/// µs since 1970.
fn micros(stamp: Time) -> i64 {
    i64::from(stamp.sec) * 1_000_000 + i64::from(stamp.nanosec) / 1000
}

/// Puts a recording of `bytes` bytes, known as `key`, into rows, and gives remarks on it: a sentence each.
///
/// # Errors
/// It is no recording of one cell, or a message of it cannot be read.
pub(crate) fn rows(
    bag: &Bag,
    key: &str,
    bytes: u64,
    rows: &mut Rows,
) -> anyhow::Result<Vec<String>> {
    let Some((began, ended)) = bag.bounds() else {
        bail!("the recording holds no message");
    };
    let mut source = Source {
        bag,
        key,
        namespace: namespace(bag)?,
        machine: String::new(),
        machine_type: String::new(),
        remarks: Vec::new(),
    };
    let states = source.read::<MachineState>("machine_state")?;
    let description = source
        .read::<probecell_msgs::std_msgs::String>("robot_description")?
        .pop()
        .map(|stamped| stamped.message.data)
        .unwrap_or_default();
    source.machine = states
        .iter()
        .map(|state| &state.message.machine_id)
        .find(|id| !id.is_empty())
        .cloned()
        .unwrap_or_else(|| source.namespace.trim_start_matches('/').to_owned());
    source.machine_type = Chain::from_urdf(&description)
        .map_or_else(|_| String::new(), |chain| chain.name().to_owned());

    let diagnosed = session_io::diagnosed(bag, None, None, &Options::default());
    let began = i64::try_from(began / 1000).context("the first time stamp is no instant")?;
    let ended = i64::try_from(ended / 1000).context("the last time stamp is no instant")?;
    messages::rows(&mut source, rows)?;
    signals::rows(&mut source, &states, rows)?;
    let mut refusal = None;
    let (mut measured, mut report) = (None, None);
    match diagnosed {
        Ok(found) => {
            source.remarks.extend(found.remarks);
            effects::rows(&source, began, &found.session, &found.report, rows)?;
            for declared in &found.report.declared {
                let values = promise(declared);
                rows.push(&PROMISES, source.row(began, values));
            }
            measured = Some(found.session);
            report = Some(found.report);
        }
        Err(error) => {
            let why = crate::sentence(&error);
            source.remarks.push(format!("not diagnosed: {why}"));
            refusal = Some(why);
        }
    }
    let damage = bag.damage().len();
    let session = Session {
        began,
        ended,
        bytes,
        damage,
        description: &description,
        measured: measured.as_ref(),
        report: report.as_ref(),
        refusal,
    };
    let row = session.row(&source);
    rows.push(&SESSIONS, row);
    Ok(source.remarks)
}

/// The namespace of the only cell.
fn namespace(bag: &Bag) -> anyhow::Result<String> {
    let ends = ["/robot_description", "/probe_events", "/joint_states"];
    let topics = bag.channels().iter().map(|channel| channel.topic.as_str());
    let mut found: Vec<&str> = topics
        .filter_map(|topic| ends.iter().find_map(|end| topic.strip_suffix(end)))
        .collect();
    found.sort_unstable();
    found.dedup();
    match found.as_slice() {
        [one] => Ok((*one).to_owned()),
        [] => bail!(
            "the recording has no topic of a cell (robot_description, probe_events, joint_states)"
        ),
        several => bail!("the recording holds several cells: {}", several.join(", ")),
    }
}

/// What the table of sessions tells.
struct Session<'a> {
    began: i64,
    ended: i64,
    bytes: u64,
    damage: usize,
    description: &'a str,
    measured: Option<&'a diagnosis::Session>,
    report: Option<&'a Report>,
    refusal: Option<String>,
}

impl Session<'_> {
    fn row(&self, source: &Source<'_>) -> Row {
        let report = self.report;
        let plan = self.measured.and_then(|measured| measured.plan.as_ref());
        let declared = self.measured.map(|measured| {
            let effects = measured.declared.iter();
            effects
                .map(|effect| effect.effect.clone())
                .collect::<Vec<String>>()
        });
        let mut remarks = source.remarks.clone();
        remarks.extend(
            report
                .iter()
                .flat_map(|report| report.warnings.iter().cloned()),
        );
        source.row(
            self.began,
            [
                source.bag.path().display().to_string().into(),
                source.namespace.as_str().into(),
                Machine::of(self.description, &source.machine_type)
                    .fingerprint
                    .into(),
                plan.map(|plan| plan.stylus.id.clone()).into(),
                declared.into(),
                Value::Moment(self.ended),
                ((self.ended - self.began) as f64 * 1e-6).into(),
                source.bag.counts().iter().sum::<u64>().into(),
                self.bytes.into(),
                self.damage.into(),
                plan.map(|plan| plan.plan_id.clone()).into(),
                report.map(|report| report.samples).into(),
                report.map(|report| words::gap(report.verdict)).into(),
                report.map(|report| report.gap.rms).into(),
                report.map(|report| report.gap.noise_floor).into(),
                report.map(|report| report.unexplained.rms).into(),
                report.map(|report| report.gap.unit.clone()).into(),
                self.refusal.clone().into(),
                remarks.into(),
                PROGRAM.as_str().into(),
            ],
        )
    }
}

fn promise(declared: &diagnosis::report::Declared) -> [Value; 9] {
    let (promised, achieved) = (declared.promised.as_ref(), declared.achieved.as_ref());
    [
        declared.effect.as_str().into(),
        declared.source.clone().into(),
        promised.map(|sizes| sizes.rms_before).into(),
        promised.map(|sizes| sizes.rms_after).into(),
        achieved.map(|sizes| sizes.rms_before).into(),
        achieved.map(|sizes| sizes.rms_after).into(),
        achieved.map(|sizes| sizes.ci95_after[0]).into(),
        achieved.map(|sizes| sizes.ci95_after[1]).into(),
        declared.kept.into(),
    ]
}
