//! What is a cell made of? Reads and checks a cell file, and builds its nodes and its driver.
//!
//! ```text
//! cell.toml ----> [cell] [bus] [recorder]            sections of no node, checked here
//!                 [machine_state] ... [gap]          one section for each node, checked by the node
//!                 [[signals]]                        of controllers beside the machine, by plc
//!                 [driver] source = NAME  [NAME]     settings of the driver, by controllers::registry::DRIVERS
//!                 [[model.effects]]                  effects declared besides the robot description
//! robot.urdf ---> kinematic chain
//!                       v
//!          Cell --> node instances, role of the driver, sections as written (for the recording)
//! ```
//!
//! Every key carries its unit; an unknown key is refused with the nearest known one, a wrong value with file and line. A
//! recording embeds the file, so that a replay builds the same nodes. This crate knows no transport: how processes join the
//! bus is only read here, and carried out by `host`.
//!
//! ```
//! use std::path::Path;
//!
//! use cell::Cell;
//!
//! # let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch-scripts"));
//! let cell = Cell::read(&folder.join("turn_mill.toml"))?;
//! assert_eq!(cell.namespace(), "/turn_mill");
//! assert_eq!(cell.node_names().last(), Some(&"simulator"));
//!
//! let mut text = cell.text().clone();
//! text.cell = text.cell.replace("max_corrections", "max_corections");
//! let error = Cell::from_text(text).unwrap_err().to_string();
//! assert!(error.ends_with("unknown key \"max_corections\": did you mean \"max_corrections\"?"));
//! # Ok::<(), cell::CellError>(())
//! ```

mod access;
mod checks;
mod driver;
pub mod keys;
mod mistakes;
mod model;
mod motion;
pub mod new_robot;
mod nodes;
mod numbers;
mod order;
pub mod parameters;
pub mod policy;
pub mod ros_arguments;
pub mod secrets;
mod sections;
mod signals;
pub mod strangers;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use controllers::{driver::Driver, registry::DRIVERS};
use graph::{Instance, Topic};
use machine::Chain;
use serde::Deserialize;
use toml::de::DeTable;

use nodes::cell_file;
use ros_arguments::RosArguments;

pub use driver::DriverSection;
pub use model::{AdoptError, Adopted, ModelSection, adopt, remove};
pub use motion::{AdoptedMotion, adopt_motion, motion_of_text};
pub use nodes::{NodeEntry, Site};
pub use order::OrderError;
pub use sections::{
    ApprovalsSection, BusSection, CellSection, RecorderSection, Strangers, TransportName,
    domain_of_environment,
};
pub use signals::SignalSection;

/// Topics by which a cell is seen with others, by their names in every ROS 2 system.
pub const SHARED: [&str; 4] = ["/diagnostics", "/tf", "/tf_static", CLOCK];
/// The clock of a cell on simulated time, as ROS 2 names it.
pub const CLOCK: &str = "/clock";

/// Text of a cell file and of the robot description that it names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CellText {
    /// Where it came from, for error messages.
    pub name: String,
    /// TOML.
    pub cell: String,
    /// URDF.
    pub robot_description: String,
    /// Public key of the cell; empty: it has none, and no correction is written.
    pub key: String,
}

cell_file! {
    /// A cell as written.
    #[derive(Clone, Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Cell {
        nodes {
            #[serde(default)] machine_state: machine_state::RawConfig => machine_state::MachineStateNode,
                |raw, site| {
                    let config = raw.check(site.robot_description(), site.chain.name(), site.replayed);
                    config.map(|config| config.with_trust(site.trust()).with_signals(site.cell.watched_signals()))
                };
            #[serde(default)] probe_events: probe_events::RawConfig => probe_events::ProbeEventsNode,
                |raw, site| raw.check(site.chain.clone());
            #[serde(default)] path_planning: path_planning::RawConfig => path_planning::PathPlanningNode,
                |raw, site| raw.check(site.chain.clone(), &site.cell.part, site.allowances());
            #[serde(default)] analysis: analysis::RawConfig => analysis::AnalysisNode,
                |_raw, site| site.analysis();
            compensation: compensation::RawConfig => compensation::CompensationNode,
                |raw, site| {
                    let raw = site.with_tolerances(raw);
                    let config = raw.check(&site.chain, &site.passes(), site.replayed);
                    config.map(|config| {
                        let config = config.with_common(site.common_components());
                        config.with_trust(site.trust(), site.signer())
                    })
                };
            cycle: cycle::RawConfig => cycle::CycleNode, |raw, site| raw.check();
            #[serde(default)] gap: gap::RawConfig => gap::GapNode,
                |raw, site| raw.check(&effects::vocabulary::identifiers(&site.chain), &site.cell.model.effects);
            #[serde(default)] visualization: visualization::RawConfig => visualization::VisualizationNode,
                |raw, site| raw.check(&site.robot_description());
        }
        /// Name, robot description, part.
        pub cell: CellSection,
        /// How processes join the bus.
        #[serde(default)]
        pub bus: BusSection,
        /// Where and how recordings are made.
        #[serde(default)]
        pub recorder: RecorderSection,
        /// Who may approve corrections.
        #[serde(default)]
        pub approvals: ApprovalsSection,
        /// What stands behind the driver's topics.
        pub driver: DriverSection,
        /// What is read of controllers beside the machine.
        #[serde(default)]
        pub signals: Vec<SignalSection>,
        /// The part to make and measure.
        pub part: path_planning::part::RawPart,
        /// Limits of the axes, dwell, delays, overrides; without them moves are timed by top speeds.
        #[serde(default)]
        pub motion: machine::RawMotion,
        /// What the cell is declared to do beyond its robot description.
        #[serde(default)]
        pub model: ModelSection,
        /// Nodes from outside.
        #[serde(skip)]
        added: Vec<NodeEntry>,
        #[serde(skip)]
        drivers: driver::Drivers,
        #[serde(skip)]
        trusted: keys::Trusted,
        #[serde(skip)]
        text: CellText,
    }
}

/// Why a cell cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum CellError {
    /// A file cannot be read.
    #[error("cannot read {what} {path}: {source}")]
    Read {
        /// What the file is.
        what: &'static str,
        /// Where.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The file is not a cell file.
    #[error("{place}: {message}")]
    Parse {
        /// File and line.
        place: String,
        /// What is wrong.
        message: String,
    },
    /// A setting cannot be used.
    #[error("{file}: {message}")]
    Setting {
        /// The cell file, with the line where it is known.
        file: String,
        /// What is wrong.
        message: String,
    },
    /// There is no such node.
    #[error("there is no node {name:?} in this cell; it has {known}")]
    NoNode {
        /// As asked for.
        name: String,
        /// Those there are.
        known: String,
    },
}

/// Longest cell file, which takes sixty times as much to parse, and robot description, bytes.
const LONGEST: u64 = 1 << 20;
const LONGEST_DESCRIPTION: u64 = 16 << 20;

/// The text of a regular file of at most so many bytes: a pipe or a device may never end.
///
/// # Errors
/// Another kind of file, a larger one, text that is not UTF-8, or what the system says.
pub fn text_of(path: &Path, most: u64) -> std::io::Result<String> {
    let known = std::fs::metadata(path)?;
    let refused = |what: String| Err(std::io::Error::other(what));
    if !known.is_file() {
        return refused("not a regular file".to_owned());
    }
    if known.len() > most {
        return refused(format!("larger than {} MiB", most >> 20));
    }
    std::fs::read_to_string(path)
}

impl Cell {
    /// Reads a cell file and its robot description, and checks everything.
    ///
    /// # Errors
    /// [`CellError`] names file, line and key.
    pub fn read(path: &Path) -> Result<Self, CellError> {
        Self::read_with(path, &RosArguments::default())
    }

    /// The same with changes of the text by ROS arguments.
    ///
    /// # Errors
    /// [`CellError`] names file, line and key, or the argument.
    pub fn read_with(path: &Path, arguments: &RosArguments) -> Result<Self, CellError> {
        let read = |what, path: &Path, most| {
            text_of(path, most).map_err(|source| CellError::Read {
                what,
                path: path.to_owned(),
                source,
            })
        };
        let name = path.display().to_string();
        let cell = read("the cell file", path, LONGEST)?;
        let cell = arguments.apply(&cell);
        let cell = cell.map_err(|message| CellError::Setting {
            file: name.clone(),
            message,
        })?;
        // Not of the text of a recording, which may be older than this rule.
        if let Some((key, value)) = secrets::first_literal(&cell) {
            let line = cell.lines().position(|line| line.contains(&value));
            return Err(CellError::Setting {
                file: line.map_or_else(|| name.clone(), |line| format!("{name} line {}", line + 1)),
                message: format!(
                    "{key} contains a password, but the cell file is embedded in every recording: write {{ env = \"NAME\" }} or \
                     {{ file = \"PATH\" }} instead"
                ),
            });
        }
        let parsed = Self::parse(&cell, &name, DRIVERS)?;
        let urdf = path
            .parent()
            .unwrap_or(Path::new(""))
            .join(&parsed.cell.robot_description);
        let robot_description = read("the robot description", &urdf, LONGEST_DESCRIPTION)?;
        Self::from_text(CellText {
            name,
            cell,
            robot_description,
            key: String::new(),
        })
    }

    /// The cell of texts that belong together. Every node is built once, so that a wrong setting is reported here.
    ///
    /// # Errors
    /// [`CellError`] names file, line and key.
    pub fn from_text(text: CellText) -> Result<Self, CellError> {
        Self::from_text_with(text, DRIVERS)
    }

    /// The same with other drivers than those of [`controllers::driver`].
    ///
    /// # Errors
    /// [`CellError`] names file, line and key.
    pub fn from_text_with(
        text: CellText,
        drivers: &'static [&'static dyn Driver],
    ) -> Result<Self, CellError> {
        let mut cell = Self::parse(&text.cell, &text.name, drivers)?;
        cell.text = text;
        let key = keys::Trusted::of_text(&cell.text.key);
        cell.trusted = cell.setting(key)?;
        let selected = cell.drivers.select(&cell.driver.source);
        cell.setting(selected)?;
        cell.setting(checks::sections(&cell))?;
        cell.setting(cell.check_driver())?;
        cell.setting(cell.model.check(&cell.chain()?))?;
        cell.nodes(false)?;
        Ok(cell)
    }

    fn parse(
        text: &str,
        name: &str,
        drivers: &'static [&'static dyn Driver],
    ) -> Result<Self, CellError> {
        if text.len() as u64 > LONGEST {
            return Err(CellError::Setting {
                file: name.to_owned(),
                message: format!("the cell file is larger than {} MiB", LONGEST >> 20),
            });
        }
        let place = |at: usize| format!("{name} line {}", text[..at].matches('\n').count() + 1);
        if let Some(number) = numbers::first_not_finite(text) {
            return Err(CellError::Parse {
                place: place(number.at),
                message: format!("{} = {} is not a finite number", number.key, number.value),
            });
        }
        let wrong = |at: Option<usize>, message: &str, sections: &[&str]| CellError::Parse {
            place: at.map_or_else(|| name.to_owned(), place),
            message: mistakes::with_nearest(message, sections),
        };
        let start = |error: &toml::de::Error| error.span().map(|span| span.start);
        let mut file =
            DeTable::parse(text).map_err(|error| wrong(start(&error), error.message(), &[]))?;
        let drivers = driver::Drivers::take(drivers, file.get_mut())
            .map_err(|error| wrong(Some(error.at), &error.message, &[]))?;
        let sections: Vec<usize> = file.get_ref().keys().map(|key| key.span().start).collect();
        let mut cell = Self::deserialize(toml::Deserializer::from(file)).map_err(|error| {
            let at = start(&error);
            // The name of a driver is the name of a section, too.
            let names: Vec<_> = drivers.names().collect();
            let is_section = at.is_some_and(|at| sections.contains(&at));
            wrong(at, error.message(), if is_section { &names } else { &[] })
        })?;
        cell.drivers = drivers;
        Ok(cell)
    }

    /// The texts that it was made from.
    pub fn text(&self) -> &CellText {
        &self.text
    }

    /// Namespace of its topics, with the slash.
    pub fn namespace(&self) -> String {
        format!("/{}", self.cell.name)
    }

    /// The name in this cell of a topic that is shared with others ([`SHARED`]).
    pub fn shared(&self, name: &'static str) -> &str {
        self.bus.names.get(name).map_or(name, String::as_str)
    }

    /// Absolute name of a topic.
    pub fn topic(&self, name: &str) -> String {
        format!("/{}/{name}", self.cell.name)
    }

    /// What its rules of access to the bus leave open, a sentence each.
    pub fn access_warnings(&self) -> Vec<String> {
        access::warnings(self)
    }

    /// Each section of the cell file as it was written, in TOML, by its name.
    pub fn sections(&self) -> BTreeMap<String, String> {
        let sections: toml::Table = self.text.cell.parse().unwrap_or_default();
        sections
            .into_iter()
            .filter_map(|(name, section)| Some((name, toml::to_string(&section).ok()?)))
            .collect()
    }

    /// The cell with a further node, which its file does not know. Of two nodes of one name the first counts.
    #[must_use]
    pub fn with_node(mut self, node: NodeEntry) -> Self {
        self.added.push(node);
        self
    }

    /// The nodes of this cell that are no driver, in the order of the data flow.
    fn entries(&self) -> impl Iterator<Item = &NodeEntry> {
        ENTRIES.iter().chain(&self.added)
    }

    /// Names of its nodes, in the order of the data flow.
    pub fn node_names(&self) -> Vec<&'static str> {
        let simulated = self.simulated_machine().map(|(name, _)| name);
        let names = self.entries().map(|node| node.name);
        names.chain(simulated).collect()
    }

    /// All nodes at their start.
    ///
    /// # Errors
    /// A setting that a node refuses.
    pub fn nodes(&self, replayed: bool) -> Result<Vec<Box<dyn Instance>>, CellError> {
        self.node_names()
            .into_iter()
            .map(|name| self.instance(name, replayed))
            .collect()
    }

    /// One node at its start. `replayed`: it runs on a recording, so nothing may reach a machine.
    ///
    /// # Errors
    /// No node of that name, or a setting that it refuses.
    pub fn instance(&self, name: &str, replayed: bool) -> Result<Box<dyn Instance>, CellError> {
        let chain = self.chain()?;
        if let Some(node) = self.entries().find(|node| node.name == name) {
            let site = Site {
                cell: self,
                chain,
                replayed,
            };
            return self.setting((node.make)(&site));
        }
        let simulated = self.simulated_machine().filter(|(known, _)| *known == name);
        let (_, machine) = simulated.ok_or_else(|| CellError::NoNode {
            name: name.to_owned(),
            known: self.node_names().join(", "),
        })?;
        let plan = self.setting(self.part.check(&chain))?.plan(0.0);
        self.setting(machine.instance(chain, &plan))
    }

    /// Every topic of the cell: those of the table, and those that only one of its nodes declares.
    ///
    /// # Errors
    /// A setting that a node refuses.
    pub fn topics(&self) -> Result<Vec<Topic>, CellError> {
        Ok(graph::topics::of(&self.nodes(false)?))
    }

    /// The chain of its robot description, with the limits of `[motion]`.
    ///
    /// # Errors
    /// A robot description or `[motion]` that is not valid.
    pub fn chain(&self) -> Result<Chain, CellError> {
        let chain = Chain::from_urdf(&self.text.robot_description);
        let chain = chain.map_err(|error| CellError::Setting {
            file: self.cell.robot_description.display().to_string(),
            message: error.to_string(),
        })?;
        let motion = self.setting(self.motion.check(&chain))?;
        Ok(chain.with_motion(motion))
    }

    fn setting<T, E: std::fmt::Display>(&self, checked: Result<T, E>) -> Result<T, CellError> {
        checked.map_err(|error| {
            let message = error.to_string();
            let name = &self.text.name;
            let file = mistakes::line_of_setting(&self.text.cell, &message)
                .map_or_else(|| name.clone(), |line| format!("{name} line {line}"));
            CellError::Setting { file, message }
        })
    }
}
