//! Programs beside this one: `probecell NAME ...` becomes `probecell-NAME ...`, as `git` and `cargo` do it.
//!
//! Those that this project knows are built in the workspace `neighbours`, and some serve several commands ([`NEIGHBOURS`]). Any
//! other program of that name on PATH is a command as well.

use std::ffi::{OsStr, OsString};
use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, anyhow};
use cell::Cell;
use clap::ValueEnum;
use terminal::cell_stream::{PROGRAM_VARIABLE, ROS_ARGUMENTS_VARIABLE};

use crate::ros_arguments;

/// A command that a program beside this one serves.
struct Neighbour {
    /// As it is typed.
    command: &'static str,
    /// Program `probecell-PROGRAM`, package `probecell_PROGRAM`.
    program: &'static str,
    /// Whether the program has several commands, of which this is one.
    is_one_of_several: bool,
    /// What it does.
    about: &'static str,
}

/// A command of a program that has the same name.
const fn own(command: &'static str, about: &'static str) -> Neighbour {
    Neighbour {
        command,
        program: command,
        is_one_of_several: false,
        about,
    }
}

/// One of several commands of a program.
const fn of(program: &'static str, command: &'static str, about: &'static str) -> Neighbour {
    Neighbour {
        command,
        program,
        is_one_of_several: true,
        about,
    }
}

/// The program for formats of other measuring systems, to which `import` and `export` hand over.
const FORMATS: &str = "formats";
/// The program that reads signals of controllers beside the machine.
pub(crate) const PLC: &str = "plc";

/// The commands that are built in `neighbours`.
const NEIGHBOURS: [Neighbour; 10] = [
    own(
        "sparkplug",
        "Publish a running cell to an MQTT broker as a Sparkplug B edge node",
    ),
    own(
        "mtconnect",
        "Serve a running cell as an MTConnect agent, read only",
    ),
    own(
        "opcua",
        "Serve a running cell, or a recording, over OPC UA, read only",
    ),
    of(
        "programs",
        "program",
        "Write the measuring program of a plan for a controller",
    ),
    of(
        "programs",
        "results",
        "Read the result files of a controller and compute sizes from their touches",
    ),
    of(
        "programs",
        "correct",
        "Compute the tool-path correction of the next part of a free-form profile",
    ),
    of(
        "validation",
        "blind",
        "Validate the diagnosis on sessions with hidden effects",
    ),
    of(
        "validation",
        "scenario",
        "Run the register of known gaps and judge each against its source",
    ),
    of(
        "fleet",
        "lake",
        "Store sessions of many machines as Parquet tables",
    ),
    own(
        "fleet",
        "Query the sessions of many machines in SQL, diagnose them again, find trends",
    ),
];

/// The commands of other programs, for the help of this one.
pub(crate) fn help() -> String {
    let rows = NEIGHBOURS.iter().map(|one| {
        let name = format!("probecell-{}", one.program);
        format!("\n  {:<10} {} ({name})", one.command, one.about)
    });
    let rows: String = rows.collect();
    format!(
        "Commands of programs beside this one, built by `cargo build --release` in the folder neighbours; a program\nprobecell-NAME on PATH is the command NAME:{rows}"
    )
}

/// Whether a program serves this command: one of ours, or one that is found.
pub(crate) fn is_command(name: &OsStr) -> bool {
    let is_ours = NEIGHBOURS.iter().any(|one| name == one.command);
    is_ours || name.to_str().and_then(find).is_some()
}

/// Whether the command may run under ROS arguments: it hands on a running cell, or is not ours.
pub(crate) fn is_of_a_cell(words: &[OsString]) -> bool {
    let known = NEIGHBOURS
        .iter()
        .find(|one| words.first().is_some_and(|name| name == one.command));
    known.is_none_or(|one| ["sparkplug", "mtconnect", "opcua"].contains(&one.program))
}

/// Becomes the program that serves a command: `words` are its name and its arguments. Returns only where that fails.
///
/// # Errors
/// The program is not there, or cannot be started.
pub(crate) fn run(words: &[OsString]) -> anyhow::Result<u8> {
    let (name, arguments) = words.split_first().context("no command")?;
    let known = NEIGHBOURS.iter().find(|one| name == one.command);
    let program = known.map_or_else(|| name.to_string_lossy(), |one| one.program.into());
    let first = known
        .filter(|one| one.is_one_of_several)
        .map(|one| OsString::from(one.command));
    become_program(&program, first.into_iter().chain(arguments.iter().cloned()))
}

/// Becomes `probecell-PROGRAM`.
///
/// # Errors
/// See [`run`].
fn become_program(
    program: &str,
    arguments: impl IntoIterator<Item = OsString>,
) -> anyhow::Result<u8> {
    let name = format!("probecell-{program}");
    let words = serde_json::to_string(&ros_arguments::words())?;
    let mut command = Command::new(find(program).unwrap_or_else(|| PathBuf::from(&name)));
    command.args(arguments).env(ROS_ARGUMENTS_VARIABLE, words);
    if let Ok(own) = std::env::current_exe() {
        command.env(PROGRAM_VARIABLE, own);
    }
    let error = command.exec();
    Err(if error.kind() == io::ErrorKind::NotFound {
        missing(program)
    } else {
        anyhow::Error::new(error).context(format!("cannot start {name}"))
    })
}

/// The file of `probecell-PROGRAM`.
///
/// # Errors
/// It is not there; the sentence says how it is built.
pub(crate) fn file(program: &str) -> anyhow::Result<PathBuf> {
    find(program).ok_or_else(|| missing(program))
}

/// The program that reads controllers beside the machine, where the cell has signals.
///
/// # Errors
/// It is not there.
pub(crate) fn signals_reader(cell: &Cell) -> anyhow::Result<Option<PathBuf>> {
    if cell.signals_process().is_none() {
        return Ok(None);
    }
    let wrong = || format!("{}: [[signals]]", cell.text().name);
    file(PLC).map(Some).with_context(wrong)
}

fn missing(program: &str) -> anyhow::Error {
    anyhow!(
        "probecell-{program} is neither in the folder of this program nor on PATH: `cargo build --release -p probecell_{program}` in the folder neighbours builds it"
    )
}

/// Has the program for formats read `file`, by a command and options of its own.
///
/// # Errors
/// See [`run`].
pub(super) fn read_by_formats(
    command: &[&str],
    options: impl IntoIterator<Item = OsString>,
    file: &Path,
) -> anyhow::Result<u8> {
    let command = command.iter().map(OsString::from);
    let file = ["--".into(), file.into()];
    become_program(FORMATS, command.chain(options).chain(file))
}

/// `--NAME=VALUE`; the value may begin with a hyphen.
pub(super) fn option(name: &str, value: impl AsRef<OsStr>) -> OsString {
    let mut word = OsString::from(format!("--{name}="));
    word.push(value);
    word
}

/// `--NAME=VALUE` of one of several values.
pub(super) fn choice(name: &str, value: &impl ValueEnum) -> OsString {
    let value = value.to_possible_value();
    let value = value.map_or(String::new(), |value| value.get_name().to_owned());
    option(name, value)
}

/// The file of `probecell-PROGRAM`: beside this program, else on PATH.
fn find(program: &str) -> Option<PathBuf> {
    let name = format!("probecell-{program}");
    let beside = std::env::current_exe().ok()?.with_file_name(&name);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let on_path = std::env::split_paths(&path).map(|folder| folder.join(&name));
    std::iter::once(beside)
        .chain(on_path)
        .find(|file| file.is_file())
}
