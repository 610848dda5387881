//! A driver that the project does not know, registered from outside: one value of a registry, and nothing else.

use std::path::Path;

use cell::{Cell, CellText, NODES};
use controllers::driver::{
    ConnectError, Connection, Controller, Demands, DoctorCheck, Driver, DriverOutput,
    DriverSettings, Inbox, Role, Section, SectionError, required,
};
use probecell_msgs::{ControllerCommand, ControllerReply, ControllerStatus};
use serde::Deserialize;

/// A controller that stands still and says `DONE` to everything.
#[derive(Clone, Copy, Debug)]
struct Toy;

static DRIVERS: &[&dyn Driver] = &[&Toy];

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ToySettings {
    position_mm: f64,
    tools: Vec<u32>,
}

struct ToyConnection {
    session: String,
    position: f64,
    inbox: Inbox,
}

impl Driver for Toy {
    fn name(&self) -> &'static str {
        "toy"
    }

    fn description(&self) -> &'static str {
        "a toy"
    }

    fn read(&self, section: Option<Section<'_>>) -> Result<Box<dyn DriverSettings>, SectionError> {
        Ok(Box::new(required::<ToySettings>(section)?))
    }
}

impl DriverSettings for ToySettings {
    fn check(&self, demands: &Demands<'_>) -> Result<(), String> {
        if self.position_mm < 0.0 {
            return Err(format!(
                "toy.position_mm = {} is negative",
                self.position_mm
            ));
        }
        match demands
            .corrected_tools
            .iter()
            .find(|(_, tool)| !self.tools.contains(tool))
        {
            Some((id, tool)) => Err(format!("toy.tools: tool {tool} of {id:?} is missing")),
            None => Ok(()),
        }
    }

    fn role(&self) -> Role<'_> {
        Role::Process(self)
    }

    fn doctor_checks(&self) -> Vec<DoctorCheck> {
        vec![DoctorCheck {
            subject: "toy".to_owned(),
            result: Ok("plugged in".to_owned()),
        }]
    }
}

impl Controller for ToySettings {
    fn connect(&self, session: &str) -> Result<Box<dyn Connection>, ConnectError> {
        Ok(Box::new(ToyConnection {
            session: session.to_owned(),
            position: self.position_mm * 1e-3,
            inbox: Inbox::default(),
        }))
    }
}

impl Connection for ToyConnection {
    fn inbox(&mut self) -> &mut Inbox {
        &mut self.inbox
    }

    fn poll(&mut self, _now: i64) -> Vec<DriverOutput> {
        let status = ControllerStatus {
            session: self.session.clone(),
            axis_positions: vec![self.position],
            ..ControllerStatus::default()
        };
        let replies = self.inbox.commands.drain(..).map(|command| {
            DriverOutput::Reply(ControllerReply {
                command_id: command.command_id,
                outcome: ControllerReply::DONE,
                ..ControllerReply::default()
            })
        });
        replies.chain([DriverOutput::Status(status)]).collect()
    }
}

const SECTION: &str = "[toy]\nposition_mm = 5.0\ntools = [2]\n";

/// The bore cell with the toy as its driver, and this section.
fn read(section: &str) -> Result<Cell, String> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch-scripts"));
    let bore = Cell::read(&folder.join("linuxcnc_bore.toml")).expect("the shipped cell");
    let text = bore.text().clone();
    let begin = text.cell.find("[linuxcnc]").expect("a section");
    let end = text.cell.find("[machine_state]").expect("a section");
    let cell = format!("{}{section}{}", &text.cell[..begin], &text.cell[end..])
        .replace("source = \"linuxcnc\"", "source = \"toy\"");
    let name = "cell.toml".to_owned();
    Cell::from_text_with(CellText { cell, name, ..text }, DRIVERS)
        .map_err(|error| error.to_string())
}

#[test]
fn a_driver_from_outside_is_configured_checked_and_started() {
    let cell = read(SECTION).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(cell.node_names(), NODES);
    assert_eq!(cell.driver_process(), Some("toy"));
    assert!(!cell.is_playback());
    let settings = cell.driver_settings("toy").expect("its settings");
    assert_eq!(
        settings.doctor_checks()[0].result,
        Ok("plugged in".to_owned())
    );
    let Role::Process(controller) = cell.driver_role() else {
        panic!("the toy is a process");
    };
    let mut connection = controller.connect("toy-1").expect("a toy");
    connection.inbox().commands.push_back(ControllerCommand {
        command_id: 7,
        ..ControllerCommand::default()
    });
    let out = connection.poll(0);
    assert!(
        matches!(&out[..], [DriverOutput::Reply(reply), DriverOutput::Status(status)]
            if reply.command_id == 7 && status.session == "toy-1" && status.axis_positions == [5e-3]),
        "{out:?}"
    );
}

#[test]
fn wrong_settings_of_a_driver_from_outside_are_refused_at_their_line() {
    let line = 1 + read(SECTION).map_or(0, |cell| {
        let text = &cell.text().cell;
        text[..text.find("[toy]").expect("its section")]
            .matches('\n')
            .count()
    });
    for (section, expected) in [
        (
            "",
            "driver.source is \"toy\", but the section [toy] is missing".to_owned(),
        ),
        (
            "[toi]\nposition_mm = 5.0\n",
            format!("cell.toml line {line}: unknown key \"toi\": did you mean \"toy\"?"),
        ),
        (
            "[toy]\nposition_m = 5.0\ntools = []\n",
            format!(
                "cell.toml line {}: unknown key \"position_m\": did you mean \"position_mm\"?",
                line + 1
            ),
        ),
        (
            "[toy]\nposition_mm = 5.0\ntools = [\"two\"]\n",
            format!(
                "cell.toml line {}: invalid type: string \"two\", expected u32",
                line + 2
            ),
        ),
        (
            "[toy]\nposition_mm = -5.0\ntools = [2]\n",
            format!(
                "cell.toml line {}: toy.position_mm = -5 is negative",
                line + 1
            ),
        ),
        (
            "[toy]\nposition_mm = 5.0\ntools = [3]\n",
            format!(
                "cell.toml line {}: toy.tools: tool 2 of \"bore\" is missing",
                line + 2
            ),
        ),
    ] {
        let found = read(section).err().unwrap_or_default();
        assert!(found.ends_with(&expected), "{section}: {found}");
    }
}
