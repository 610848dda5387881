//! A hall of three simulated machines that shows what the program is for: each machine has a fault that its model does not have; it
//! makes a part, the diagnosis asks for the touches that part the causes, the cause is adopted, and the next part shows whether the
//! gap has closed as promised.
//!
//! ```text
//! hall       cell files of the three machines, written into a folder
//! processes  dashboard and cells, each a process as a user starts it
//! machine    the story of one machine, on a thread of its own: only cell file, services, topics and recording of its cell
//! hidden     what the simulator was told, read when all is over
//! words      the story in words
//! ```

mod hall;
mod hidden;
mod machine;
mod processes;
mod words;

use std::{
    path::{Path, PathBuf},
    sync::{Arc, mpsc::channel},
    thread,
    time::Instant,
};

use diagnosis::Report;

use self::{
    hall::{MACHINES, Machine},
    processes::Processes,
};
use crate::{cell_bus::CellFailure, output, signals};

/// What a machine has come to.
struct Found {
    /// The diagnosis that was adopted.
    report: Report,
    /// That of the next part, by the model with what was adopted.
    next: Report,
    /// The recording that it is of.
    recording: PathBuf,
}

/// What the machines tell.
enum News {
    /// A line of the story of a machine.
    Line(&'static Machine, String),
    /// Its end.
    End(&'static Machine, anyhow::Result<Box<Found>>),
    /// The user ends the demo.
    Stopped,
}

/// Runs the hall in a new folder; true where each fault was found and each promise kept.
pub(crate) fn run(folder: &Path) -> anyhow::Result<bool> {
    let begin = Instant::now();
    let (sender, news) = channel();
    let stop = sender.clone();
    signals::on_end(move || drop(stop.send(News::Stopped)))?;
    let folder = hall::write(folder)?;
    let processes = Arc::new(Processes::new(&folder)?);
    let mut words = vec!["dashboard", "--any-port"];
    words.extend(MACHINES.iter().flat_map(|one| ["--cell", one.file]));
    let dashboard = processes.start(&words, "dashboard")?;
    output::line(&dashboard.line("dashboard: ")?);
    words::introduce(&folder);
    for machine in &MACHINES {
        let (sender, processes, folder) = (sender.clone(), Arc::clone(&processes), folder.clone());
        thread::spawn(move || {
            let tell = |text| drop(sender.send(News::Line(machine, text)));
            let found = machine::run(machine, &folder, &processes, &tell);
            drop(sender.send(News::End(machine, found.map(Box::new))));
        });
    }
    let (mut found, mut ended) = (Vec::new(), 0);
    while ended < MACHINES.len() {
        match news.recv()? {
            News::Line(machine, text) => words::tell(begin, machine, &text),
            News::End(machine, end) => {
                ended += 1;
                match end {
                    Ok(end) => found.push((machine, end)),
                    Err(error) => words::tell(begin, machine, &format!("ends: {error:#}")),
                }
            }
            News::Stopped => {
                processes.end_all();
                return Err(CellFailure("demo: stopped".to_owned()).into());
            }
        }
    }
    processes.end_all();
    words::conclude(&folder, found)
}
