//! Recordings.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, bail};
use arrow_array::builder::PrimitiveBuilder;
use arrow_array::types::TimestampNanosecondType;
use arrow_array::{ArrayRef, StringArray, UInt64Array};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::columns::{Column, instants};
use crate::errors::{damage, input};
use crate::record::PartRecord;
use crate::session::Session;
use crate::table::Table;
use probecell_msgs::definition::parse;

/// A recording: an `.mcap` file, or a folder of them as rosbag2 writes it.
///
/// Recordings of any ROS 2 system can be opened and every topic of them read; `session` and `report` need the topics of a cell.
/// Raises `InputError` where `path` is none.
#[pyclass(frozen, module = "probecell")]
pub(crate) struct Bag {
    bag: bags::Bag,
}

#[pymethods]
impl Bag {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let bag = py.detach(|| bags::Bag::open(path)).map_err(input)?;
        Ok(Self { bag })
    }

    /// What was opened.
    #[getter]
    fn path(&self) -> PathBuf {
        self.bag.path().to_owned()
    }

    /// Topics: `topic`, `type`, `messages`.
    #[getter]
    fn topics(&self) -> PyResult<Table> {
        let channels = self.bag.channels();
        let names = channels.iter().map(|one| one.topic.as_str());
        let types = channels.iter().map(|one| one.type_name.as_str());
        let columns: Vec<(String, ArrayRef)> = vec![
            (
                "topic".to_owned(),
                Arc::new(StringArray::from_iter_values(names)),
            ),
            (
                "type".to_owned(),
                Arc::new(StringArray::from_iter_values(types)),
            ),
            (
                "messages".to_owned(),
                Arc::new(UInt64Array::from(self.bag.counts())),
            ),
        ];
        Table::new(columns).map_err(input)
    }

    /// All messages of a topic: its full name, or the last part of it where only one topic ends so.
    ///
    /// A row for each message in the order of reception. `log_time` (received) and `publish_time` (sent) are instants in ns since
    /// 1970, UTC; fields of messages within the message are columns of their own, such as `header.stamp`; lists stay lists. Units are
    /// those of the message definition: SI.
    fn table(&self, py: Python<'_>, topic: &str) -> PyResult<Table> {
        let (table, found) = py.detach(|| self.read(topic)).map_err(input)?;
        damage(py, &found)?;
        Ok(table)
    }

    /// The same as `table(topic)`.
    fn __getitem__(&self, py: Python<'_>, topic: &str) -> PyResult<Table> {
        self.table(py, topic)
    }

    /// What `probecell info --json` prints of the recording, apart from its seals.
    ///
    /// `verify` reads the whole recording to find all damage.
    #[pyo3(signature = (*, verify=false))]
    fn info<'py>(&self, py: Python<'py>, verify: bool) -> PyResult<Bound<'py, PyAny>> {
        let info = py.detach(|| self.bag.info(verify));
        let text = serde_json::to_string(&info).map_err(input)?;
        py.import("json")?.call_method1("loads", (text,))
    }

    /// Attached files by name.
    fn attachments<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let files = PyDict::new(py);
        let mut lost = Vec::new();
        for one in self.bag.attachments() {
            match one {
                Ok(file) => files.set_item(&file.name, PyBytes::new(py, &file.data))?,
                Err(found) => lost.push(found),
            }
        }
        damage(py, &lost)?;
        Ok(files)
    }

    /// A measurement of the recording as the diagnosis takes it: the last one, or that of the plan named.
    ///
    /// `model`: a cell file whose declared effects are compared, in place of those that the recording carries.
    #[pyo3(signature = (plan=None, *, model=None))]
    fn session(
        &self,
        py: Python<'_>,
        plan: Option<String>,
        model: Option<PathBuf>,
    ) -> PyResult<Session> {
        Session::of_bag(py, &self.bag, plan, model)
    }

    /// The record of the parts that were made or measured, as `probecell report`.
    fn report(&self, py: Python<'_>) -> PyResult<PartRecord> {
        PartRecord::read(py, self.bag.path())
    }

    fn __repr__(&self) -> String {
        let messages: u64 = self.bag.counts().iter().sum();
        format!(
            "<probecell.Bag {}: {} topics, {messages} messages>",
            self.bag.path().display(),
            self.bag.channels().len()
        )
    }
}

impl Bag {
    fn read(&self, topic: &str) -> anyhow::Result<(Table, Vec<bags::Damage>)> {
        let name = self.named(topic)?;
        let mut channels = self.bag.channels_of(&name);
        let first = channels.next().context("the bag has lost its channels")?;
        if let Some(other) = channels.find(|one| one.definition != first.definition) {
            bail!(
                "{name} was recorded as {} and as {}, which are not the same",
                first.type_name,
                other.type_name
            );
        }
        if first.message_encoding != "cdr" {
            bail!(
                "{name} is encoded as {:?}, not as cdr",
                first.message_encoding
            );
        }
        let of = parse(&first.type_name, &first.definition)
            .with_context(|| format!("{name}: the definition of {}", first.type_name))?;
        let mut column = Column::new(&of);
        let mut received =
            PrimitiveBuilder::<TimestampNanosecondType>::new().with_data_type(instants());
        let mut sent =
            PrimitiveBuilder::<TimestampNanosecondType>::new().with_data_type(instants());
        let mut found = Vec::new();
        for (index, message) in self.bag.messages_on(&[&name]).enumerate() {
            match message {
                Ok(message) => {
                    column.add(&message.payload).with_context(|| {
                        format!("message {index} of {name} is no {}", first.type_name)
                    })?;
                    received.append_value(message.log_time as i64);
                    sent.append_value(message.publish_time as i64);
                }
                Err(lost) => found.push(lost),
            }
        }
        let mut columns: Vec<(String, ArrayRef)> = vec![
            ("log_time".to_owned(), Arc::new(received.finish())),
            ("publish_time".to_owned(), Arc::new(sent.finish())),
        ];
        columns.extend(column.columns("")?);
        Ok((Table::new(columns)?, found))
    }

    /// The full name of a topic.
    fn named(&self, topic: &str) -> anyhow::Result<String> {
        let channels = self.bag.channels();
        if channels.iter().any(|one| one.topic == topic) {
            return Ok(topic.to_owned());
        }
        let end = format!("/{topic}");
        let mut found: Vec<&str> = (channels.iter().map(|one| one.topic.as_str()))
            .filter(|name| name.ends_with(&end))
            .collect();
        found.sort_unstable();
        found.dedup();
        match found.as_slice() {
            [one] => Ok((*one).to_owned()),
            [] => bail!("{} has no topic {topic:?}", self.bag.path().display()),
            several => bail!("{topic:?} is several topics: {}", several.join(", ")),
        }
    }
}
