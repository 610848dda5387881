//! The simulated machine (`nodes/simulator`) as the machine of a cell.

use graph::{Instance, Running};
use machine::Chain;
use probecell_msgs::InspectionPlan;
use simulator::{RawConfig, SimulatorNode};

use crate::driver::{
    Demands, Driver, DriverSettings, Role, Section, SectionError, SimulatedMachine, required,
};

/// The simulated machine.
#[derive(Clone, Copy, Debug)]
pub struct Simulator;

impl Driver for Simulator {
    fn name(&self) -> &'static str {
        "simulator"
    }

    fn description(&self) -> &'static str {
        "a simulated machine, probe and part, reproducible by a seed"
    }

    fn read(&self, section: Option<Section<'_>>) -> Result<Box<dyn DriverSettings>, SectionError> {
        Ok(Box::new(Settings(required(section)?)))
    }
}

/// Settings of the simulated machine.
#[derive(Clone, Debug)]
struct Settings(RawConfig);

impl DriverSettings for Settings {
    /// The simulated machine has the tools, work offsets and entries of the volumetric table that are corrected.
    fn check(&self, demands: &Demands<'_>) -> Result<(), String> {
        let Self(settings) = self;
        for (id, number) in &demands.corrected_tools {
            if !settings.tools.iter().any(|tool| tool.number == *number) {
                return Err(format!(
                    "compensation.characteristics: {id:?} is corrected by tool {number}, which is not one of simulator.tools"
                ));
            }
        }
        for axis in &demands.work_offset_axes {
            if !settings
                .machine
                .work_offset_axes
                .iter()
                .any(|own| own == axis)
            {
                return Err(format!(
                    "compensation.work_offset.axes: {axis:?} is not one of simulator.machine.work_offset_axes"
                ));
            }
        }
        for name in &demands.volumetric_entries {
            if !settings
                .machine
                .table
                .iter()
                .any(|entry| entry.name == *name)
            {
                return Err(format!(
                    "compensation.volumetric.links: {name:?} is not an entry of simulator.machine.table"
                ));
            }
        }
        Ok(())
    }

    fn role(&self) -> Role<'_> {
        Role::Node(self)
    }
}

impl SimulatedMachine for Settings {
    fn instance(&self, chain: Chain, plan: &InspectionPlan) -> Result<Box<dyn Instance>, String> {
        let config = self
            .0
            .check(chain, plan)
            .map_err(|error| error.to_string())?;
        Ok(Box::new(Running::<SimulatorNode>::new(config)))
    }
}
