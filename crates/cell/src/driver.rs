//! What stands behind the driver topics of a cell: the settings of its drivers, by the registry.

use std::{collections::BTreeMap, sync::Arc};

use controllers::{
    axes::Axis,
    driver::{
        Demands, Driver, DriverSettings, Role, RosEndpoints, SectionError, SimulatedMachine,
        by_name,
    },
};
use machine::Chain;
use serde::Deserialize;
use toml::{
    Spanned,
    de::{DeTable, ValueDeserializer},
};

use crate::{Cell, CellError};

/// Section `[driver]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriverSection {
    /// Name of the driver; its settings are in the section of the same name.
    pub source: String,
}

/// Drivers that a cell file has settings of.
#[derive(Clone, Debug, Default)]
pub(crate) struct Drivers {
    known: &'static [&'static dyn Driver],
    settings: BTreeMap<&'static str, Arc<dyn DriverSettings>>,
}

/// Where a section is wrong: bytes from the beginning of the text, and a sentence.
pub(crate) struct WrongSection {
    pub(crate) at: usize,
    pub(crate) message: String,
}

impl Drivers {
    /// Takes the sections of the drivers out of a cell file.
    pub(crate) fn take(
        known: &'static [&'static dyn Driver],
        file: &mut DeTable<'_>,
    ) -> Result<Self, WrongSection> {
        let mut settings = BTreeMap::new();
        for driver in known {
            let Some((key, section)) = file.remove_entry(driver.name()) else {
                continue;
            };
            let begin = Spanned::span(&key).start;
            let read = driver.read(Some(ValueDeserializer::from(section)));
            let read = read.map_err(|error| match error {
                SectionError::Content(error) => WrongSection {
                    at: error.span().map_or(begin, |span| span.start),
                    message: error.message().to_owned(),
                },
                other => WrongSection {
                    at: begin,
                    message: format!("[{}]: {other}", driver.name()),
                },
            })?;
            settings.insert(driver.name(), Arc::from(read));
        }
        Ok(Self { known, settings })
    }

    /// Names of all drivers.
    pub(crate) fn names(&self) -> impl Iterator<Item = &'static str> {
        self.known.iter().map(|driver| driver.name())
    }

    /// Makes sure that the driver `source` exists and has settings.
    pub(crate) fn select(&mut self, source: &str) -> Result<(), String> {
        let driver = by_name(self.known, source).ok_or_else(|| {
            let names: Vec<_> = self.names().collect();
            format!(
                "driver.source = {source:?} is not a driver; there are {}",
                names.join(", ")
            )
        })?;
        if !self.settings.contains_key(source) {
            let settings = driver.read(None).map_err(|_missing| {
                format!("driver.source is {source:?}, but the section [{source}] is missing")
            })?;
            self.settings.insert(driver.name(), Arc::from(settings));
        }
        Ok(())
    }
}

/// A cell whose driver was not selected has none; `Cell::from_text` selects it.
const NOT_SELECTED: Role<'static> = Role::Playback;

impl Cell {
    /// Settings of the driver with this name, whether it is the one that runs or not.
    pub fn driver_settings(&self, name: &str) -> Option<&dyn DriverSettings> {
        self.drivers.settings.get(name).map(AsRef::as_ref)
    }

    /// What runs behind the driver topics.
    pub fn driver_role(&self) -> Role<'_> {
        let settings = self.driver_settings(&self.driver.source);
        settings.map_or(NOT_SELECTED, DriverSettings::role)
    }

    /// Nothing runs behind the driver topics: a recording is played, so nothing may reach a machine.
    pub fn is_playback(&self) -> bool {
        matches!(self.driver_role(), Role::Playback)
    }

    /// Others start and end the driver; the cell waits for it.
    pub fn is_driver_external(&self) -> bool {
        matches!(self.driver_role(), Role::External)
    }

    /// What nodes of ROS 2 that belong to the machine publish and serve.
    pub(crate) fn ros_endpoints(&self) -> RosEndpoints {
        match self.driver_role() {
            Role::Robot(machine) => machine.endpoints(),
            Role::Node(_) | Role::Process(_) | Role::External | Role::Playback => {
                RosEndpoints::default()
            }
        }
    }

    /// Name of the driver's own process, where it has one beside the nodes.
    pub fn driver_process(&self) -> Option<&str> {
        matches!(self.driver_role(), Role::Process(_) | Role::Robot(_))
            .then_some(self.driver.source.as_str())
    }

    /// The machine's axes as its controller names them, where the settings of a driver say that: of the one that runs, or of
    /// another that the file has settings of.
    ///
    /// # Errors
    /// Settings of a driver that name no axis of a machine.
    pub fn controller_axes(&self) -> Result<Option<Vec<Axis>>, CellError> {
        let running = self.driver_settings(&self.driver.source);
        let others = self.drivers.settings.values().map(AsRef::as_ref);
        for settings in running.into_iter().chain(others) {
            if let Some(axes) = self.setting(settings.axes())? {
                return Ok(Some(axes));
            }
        }
        Ok(None)
    }

    /// Standard uncertainty (m) of the deviation of a touch by the time of its contact alone: that time's (s) times the
    /// largest feed (m/s) of the part's touches.
    pub(crate) fn contact_uncertainty(&self, chain: &Chain) -> f64 {
        let settings = self.driver_settings(&self.driver.source);
        let time = settings.map_or(0.0, DriverSettings::contact_time_uncertainty);
        if time == 0.0 {
            return 0.0;
        }
        let part = self.part.check(chain);
        let points = part.map(|part| part.plan(0.0).points).unwrap_or_default();
        time * points.iter().map(|point| point.feed).fold(0.0, f64::max)
    }

    /// Name and settings of the driver, where it is a node.
    pub(crate) fn simulated_machine(&self) -> Option<(&'static str, &dyn SimulatedMachine)> {
        let (name, settings) = self
            .drivers
            .settings
            .get_key_value(self.driver.source.as_str())?;
        match settings.role() {
            Role::Node(machine) => Some((name, machine)),
            Role::Process(_) | Role::Robot(_) | Role::External | Role::Playback => None,
        }
    }

    /// Checks the settings of the driver that runs against what is corrected on its machine.
    pub(crate) fn check_driver(&self) -> Result<(), String> {
        let Some(settings) = self.driver_settings(&self.driver.source) else {
            return Ok(());
        };
        let compensation = &self.compensation;
        let characteristics = compensation.characteristics.iter();
        let work_offset = compensation.work_offset.iter();
        let volumetric = compensation.volumetric.iter();
        settings.check(&Demands {
            corrected_tools: characteristics
                .filter_map(|one| Some((one.id.as_str(), one.tool_number?)))
                .collect(),
            work_offset_axes: work_offset
                .flat_map(|own| own.axes.iter().map(String::as_str))
                .collect(),
            volumetric_entries: volumetric
                .flat_map(|own| own.links.iter().map(String::as_str))
                .collect(),
        })
    }
}
