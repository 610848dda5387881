//! LinuxCNC as a driver: a process that talks to its remote shell.

use std::path::Path;

use super::{LinuxCnc, LinuxCncConnection, NAME, RawConfig};
use crate::{
    axes::Axis,
    driver::{
        ConnectError, Connection, Controller, Demands, DoctorCheck, Driver, DriverSettings, Files,
        Role, Section, SectionError, required, tcp_answers,
    },
    secret::Secret,
};

impl Driver for LinuxCnc {
    fn name(&self) -> &'static str {
        NAME
    }

    fn description(&self) -> &'static str {
        "LinuxCNC over its remote shell linuxcncrsh"
    }

    fn read(&self, section: Option<Section<'_>>) -> Result<Box<dyn DriverSettings>, SectionError> {
        Ok(Box::new(required::<RawConfig>(section)?))
    }
}

impl DriverSettings for RawConfig {
    /// Which tools and offsets the controller has is known only when it answers.
    fn check(&self, _demands: &Demands<'_>) -> Result<(), String> {
        let checked = self.clone().check();
        checked.map(drop).map_err(|error| error.to_string())
    }

    fn role(&self) -> Role<'_> {
        Role::Process(self)
    }

    fn axes(&self) -> Result<Option<Vec<Axis>>, String> {
        let config = self.clone().check().map_err(|error| error.to_string())?;
        Ok(Some(config.axes))
    }

    fn doctor_checks(&self) -> Vec<DoctorCheck> {
        vec![DoctorCheck {
            subject: NAME.to_owned(),
            result: tcp_answers(&self.address),
        }]
    }
}

impl Controller for RawConfig {
    /// The controller may write its tool table as another file of the same name, hence the folder.
    fn files(&self) -> Files {
        let folder = |path: &Path| path.parent().unwrap_or(path).to_owned();
        let passwords = [&self.connect_password, &self.enable_password];
        let passwords = passwords.into_iter().filter_map(Secret::file);
        Files {
            read: passwords.chain([folder(&self.tool_table)]).collect(),
            write: vec![self.program_directory.clone()],
        }
    }

    fn connect(&self, session: &str) -> Result<Box<dyn Connection>, ConnectError> {
        let config = self.clone().check()?;
        Ok(Box::new(LinuxCncConnection::connect(config, session)?))
    }
}
