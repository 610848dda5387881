//! The cell file: one TOML file that says what a cell is made of, and the nodes that it makes.
//!
//! Every key carries its unit; an unknown key is refused with the nearest known one. Each section belongs to one node
//! and is checked by it. A recording carries the file, so that a replay builds the same nodes. This crate knows no
//! transport: how processes join the bus is only read here, and carried out by `host`.

mod checks;
mod model;
mod numbers;
mod sections;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use graph::{Instance, Running};
use machine::Chain;
use serde::Deserialize;

pub use model::{AdoptError, Adopted, ModelSection, adopt, remove};
pub use sections::{
    BusSection, CellSection, DriverSection, RecorderSection, Source, TransportName,
};

/// Text of a cell file and of the robot description that it names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CellText {
    /// Where it came from, for error messages.
    pub name: String,
    /// TOML.
    pub cell: String,
    /// URDF.
    pub robot_description: String,
}

/// A cell as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// Name, robot description, part.
    pub cell: CellSection,
    /// How processes join the bus.
    #[serde(default)]
    pub bus: BusSection,
    /// Where and how recordings are made.
    #[serde(default)]
    pub recorder: RecorderSection,
    /// What stands behind the driver's topics.
    pub driver: DriverSection,
    /// Settings of `machine_state`.
    #[serde(default)]
    pub machine_state: machine_state::RawConfig,
    /// The part to make and measure.
    pub part: path_planning::part::RawPart,
    /// Settings of `path_planning`.
    #[serde(default)]
    pub path_planning: path_planning::RawConfig,
    /// Settings of `analysis`.
    #[serde(default)]
    pub analysis: analysis::RawConfig,
    /// Settings of `compensation`.
    pub compensation: compensation::RawConfig,
    /// Settings of `cycle`.
    pub cycle: cycle::RawConfig,
    /// What the cell is declared to do beside its robot description.
    #[serde(default)]
    pub model: ModelSection,
    /// Settings of `gap`.
    #[serde(default)]
    pub gap: gap::RawConfig,
    /// The simulated machine, where the driver is one.
    pub simulator: Option<simulator::RawConfig>,
    /// The real controller, where the driver is one.
    pub linuxcnc: Option<controllers::linuxcnc::RawConfig>,
    #[serde(skip)]
    text: CellText,
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
        /// The cell file, and the line where it can be told.
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

/// Names of the nodes that decide, in the order of the data flow.
pub const NODES: [&str; 7] = [
    "machine_state",
    "probe_events",
    "path_planning",
    "analysis",
    "compensation",
    "cycle",
    "gap",
];

impl Cell {
    /// Reads a cell file and its robot description, and checks everything.
    pub fn read(path: &Path) -> Result<Self, CellError> {
        let read = |what, path: &Path| {
            std::fs::read_to_string(path).map_err(|source| CellError::Read {
                what,
                path: path.to_owned(),
                source,
            })
        };
        let name = path.display().to_string();
        let cell = read("the cell file", path)?;
        let parsed = Self::parse(&cell, &name)?;
        let urdf = path
            .parent()
            .unwrap_or(Path::new(""))
            .join(&parsed.cell.robot_description);
        let robot_description = read("the robot description", &urdf)?;
        Self::from_text(CellText {
            name,
            cell,
            robot_description,
        })
    }

    /// The cell of texts that belong together. Every node is built once, so that a wrong setting is told here.
    pub fn from_text(text: CellText) -> Result<Self, CellError> {
        let mut cell = Self::parse(&text.cell, &text.name)?;
        cell.text = text;
        cell.setting(checks::sections(&cell))?;
        cell.setting(cell.model.check(&cell.chain()?))?;
        cell.nodes(false)?;
        Ok(cell)
    }

    fn parse(text: &str, name: &str) -> Result<Self, CellError> {
        let place = |at: usize| format!("{name} line {}", text[..at].matches('\n').count() + 1);
        if let Some(number) = numbers::first_not_finite(text) {
            return Err(CellError::Parse {
                place: place(number.at),
                message: format!("{} = {} is not a finite number", number.key, number.value),
            });
        }
        toml::from_str(text).map_err(|error| CellError::Parse {
            place: error
                .span()
                .map_or_else(|| name.to_owned(), |span| place(span.start)),
            message: with_nearest(error.message()),
        })
    }

    /// The texts that it was made from.
    pub fn text(&self) -> &CellText {
        &self.text
    }

    /// Namespace of its topics, with the slash.
    pub fn namespace(&self) -> String {
        format!("/{}", self.cell.name)
    }

    /// Absolute name of a topic.
    pub fn topic(&self, name: &str) -> String {
        format!("/{}/{name}", self.cell.name)
    }

    /// Each section of the cell file as it was written, in TOML, by its name.
    pub fn sections(&self) -> BTreeMap<String, String> {
        let sections: toml::Table = self.text.cell.parse().unwrap_or_default();
        sections
            .into_iter()
            .filter_map(|(name, section)| Some((name, toml::to_string(&section).ok()?)))
            .collect()
    }

    /// The nodes that decide or simulate, in the order of the data flow.
    pub fn node_names(&self) -> Vec<&'static str> {
        let simulated = self.driver.source == Source::Simulator;
        NODES
            .into_iter()
            .chain(simulated.then_some("simulator"))
            .collect()
    }

    /// All nodes at their start.
    pub fn nodes(&self, replayed: bool) -> Result<Vec<Box<dyn Instance>>, CellError> {
        self.node_names()
            .into_iter()
            .map(|name| self.instance(name, replayed))
            .collect()
    }

    /// One node at its start. `replayed`: it runs on a recording, so nothing may reach a machine.
    pub fn instance(&self, name: &str, replayed: bool) -> Result<Box<dyn Instance>, CellError> {
        let chain = self.chain()?;
        let allowances = || {
            self.cycle
                .passes
                .iter()
                .map(|pass| pass.allowance_mm * 1e-3)
                .collect()
        };
        Ok(match name {
            "machine_state" => {
                let urdf = self.text.robot_description.clone();
                let config =
                    self.setting(self.machine_state.check(urdf, chain.name(), replayed))?;
                Box::new(Running::<machine_state::MachineStateNode>::new(config))
            }
            "probe_events" => Box::new(Running::<probe_events::ProbeEventsNode>::new(
                probe_events::Config { chain },
            )),
            "path_planning" => {
                let config =
                    self.setting(self.path_planning.check(chain, &self.part, allowances()))?;
                Box::new(Running::<path_planning::PathPlanningNode>::new(config))
            }
            "analysis" => {
                let config = self.setting(self.analysis.check(chain))?;
                Box::new(Running::<analysis::AnalysisNode>::new(config))
            }
            "compensation" => {
                let passes = self.cycle.passes.iter().map(|pass| pass.name.as_str());
                let passes: Vec<&str> = passes.collect();
                let config = self.setting(self.compensation.check(&chain, &passes, replayed))?;
                Box::new(Running::<compensation::CompensationNode>::new(config))
            }
            "cycle" => Box::new(Running::<cycle::CycleNode>::new(
                self.setting(self.cycle.check())?,
            )),
            "gap" => {
                let vocabulary = diagnosis::vocabulary::of(&chain);
                let config = self.setting(self.gap.check(&vocabulary, &self.model.effects))?;
                Box::new(Running::<gap::GapNode>::new(config))
            }
            "simulator" => {
                let raw = self.setting(
                    self.simulator
                        .as_ref()
                        .ok_or("the section [simulator] is missing"),
                )?;
                let plan = self.setting(self.part.check(&chain))?.plan(0.0);
                let config = self.setting(raw.check(chain, &plan))?;
                Box::new(Running::<simulator::SimulatorNode>::new(config))
            }
            _ => {
                return Err(CellError::NoNode {
                    name: name.to_owned(),
                    known: self.node_names().join(", "),
                });
            }
        })
    }

    /// The chain of its robot description.
    pub fn chain(&self) -> Result<Chain, CellError> {
        Chain::from_urdf(&self.text.robot_description).map_err(|error| CellError::Setting {
            file: self.cell.robot_description.display().to_string(),
            message: error.to_string(),
        })
    }

    fn setting<T, E: std::fmt::Display>(&self, checked: Result<T, E>) -> Result<T, CellError> {
        checked.map_err(|error| {
            let message = error.to_string();
            let name = &self.text.name;
            let file = line_of_setting(&self.text.cell, &message)
                .map_or_else(|| name.clone(), |line| format!("{name} line {line}"));
            CellError::Setting { file, message }
        })
    }
}

/// The line of the setting that a sentence begins with (`section.key ...`), or of the name that it quotes first, where
/// that stands inside.
fn line_of_setting(text: &str, message: &str) -> Option<usize> {
    let is_path = |byte: &u8| byte.is_ascii_alphanumeric() || b"_.".contains(byte);
    let path: String = message
        .bytes()
        .take_while(is_path)
        .map(char::from)
        .collect();
    let document = toml_edit::Document::parse(text).ok()?;
    let (mut span, mut whole) = (None, true);
    let mut item = document.as_item();
    for key in path.split('.') {
        let Some(inner) = item.get(key) else {
            whole = false;
            break;
        };
        item = inner;
        span = item.span().or(span);
    }
    let span = span?;
    let quoted = message.split('"').nth(1).map(|name| format!("{name:?}"));
    let inside = quoted.and_then(|name| text.get(span.clone())?.find(&name));
    // A key of one of several tables: which of them is told by the name alone.
    let at = span.start + inside.or(whole.then_some(0))?;
    Some(text.get(..at)?.matches('\n').count() + 1)
}

/// Replaces serde's list of all known keys by the nearest one.
fn with_nearest(message: &str) -> String {
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    if !message.starts_with("unknown field") || quoted.len() < 2 {
        return message.to_owned();
    }
    let unknown = quoted[0];
    let likeness = |known: &&&str| strsim::jaro_winkler(unknown, known);
    let nearest = quoted[1..]
        .iter()
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    nearest.map_or_else(
        || message.to_owned(),
        |nearest| format!("unknown key {unknown:?}: did you mean {nearest:?}?"),
    )
}
