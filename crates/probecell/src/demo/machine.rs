//! The story of one machine: a part, its diagnosis, the touches that part the causes, the cause adopted, the next part.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use anyhow::{Context, bail};
use bags::{Bag, Measurement, Stamped};
use cell::Cell;
use diagnosis::{Options, Report, Session, diagnose};
use graph::topics;
use probecell_msgs::{PartReport, RecordingStatus, srv};

use super::{
    Found,
    hall::{self, Machine},
    hidden,
    processes::{Processes, TIMEOUT},
    words,
};
use crate::{
    GOOD, LOSS,
    cell_bus::CellFailure,
    cell_client::{CellClient, Followed},
    commands::{
        adopt,
        diagnose_refine::{Step, refine},
        running_cell::complete,
    },
};

/// Speed of the clock of each cell.
const SPEED: &str = "max";
/// Requests for further touches after which a group of causes stays one.
const ROUNDS: usize = 4;

/// Runs one machine.
pub(super) fn run(
    machine: &Machine,
    folder: &Path,
    processes: &Processes,
    tell: &dyn Fn(String),
) -> anyhow::Result<Found> {
    let file = folder.join(machine.file);
    let up = processes.start(
        &["up", machine.file, "--no-dashboard", "--speed", SPEED],
        machine.name,
    )?;
    up.line("is ready")?;
    let (report, recording) = first_part(&file, folder, tell)?;
    up.end()?;
    adopt::first_of_each(&file, &report)?;
    tell(words::adopted(&report));
    hall::scatter_anew(&file)?;
    let next = processes.start(
        &[
            "up",
            machine.file,
            "--once",
            "--no-dashboard",
            "--speed",
            SPEED,
        ],
        machine.name,
    )?;
    let recorded = next.line("recorded in ")?;
    // Of messages that were lost the recording says so, and what is missed here the diagnosis misses.
    let ended = next.wait()?.and_then(|status| u8::try_from(status).ok());
    if !matches!(ended, Some(GOOD | LOSS)) {
        bail!(CellFailure("the next part was not qualified".to_owned()));
    }
    let recorded = folder.join(recorded.trim_start_matches("recorded in "));
    let session = session_io::measured(&recorded, &Measurement::Last, None)?.session;
    let next = diagnose(&session, &Options::default())?;
    tell(words::closed(&next));
    Ok(Found {
        report,
        next,
        recording,
    })
}

/// Makes the first part, and refines its diagnosis until one cause is left, or no touch tells those that are left apart.
fn first_part(
    file: &Path,
    folder: &Path,
    tell: &dyn Fn(String),
) -> anyhow::Result<(Report, PathBuf)> {
    let client = CellClient::connect(file)?;
    let part = Following {
        ended: client.follow(topics::PART_REPORTS)?,
        written: client.follow(topics::RECORDING_STATUS)?,
        cell: client.cell(),
        has_reference: hidden::has_reference(file)?,
    };
    let request = srv::RunRequest {
        part_id: client.cell().cell.part.clone(),
        ..srv::RunRequest::default()
    };
    let begun = client.call::<srv::Run>("run", &request)?;
    if !begun.accepted {
        bail!(CellFailure(begun.text));
    }
    let status = client.call::<srv::Status>("status", &srv::StatusRequest::default())?;
    let recording = folder.join(status.recording.uri);
    let mut round = 0;
    loop {
        let session = part.recorded(&recording, round)?;
        let mut say = |step: Step<'_>| tell_some(&step, round, tell);
        let refined = refine(
            client.cell(),
            &session,
            &Options::default(),
            TIMEOUT,
            &mut say,
        )?;
        round += 1;
        if refined.resolved || refined.asked.is_none() || round == ROUNDS {
            drop(part);
            client.close()?;
            return Ok((refined.after, recording));
        }
    }
}

/// The steps of a refinement that belong to the story.
fn tell_some(step: &Step<'_>, round: usize, tell: &dyn Fn(String)) {
    if let Some(text) = words::step(step, round) {
        tell(text);
    }
}

/// What a machine makes, and what of it is on disk.
struct Following<'a> {
    ended: Followed<PartReport>,
    written: Followed<RecordingStatus>,
    cell: &'a Cell,
    has_reference: bool,
}

impl Following<'_> {
    /// Waits for the end of what is being measured, and until the recording has all of it; gives it with what it adds to.
    fn recorded(&self, recording: &Path, round: usize) -> anyhow::Result<Session> {
        let deadline = Instant::now() + TIMEOUT;
        let late = || {
            CellFailure(format!(
                "nothing was measured within {} s",
                TIMEOUT.as_secs()
            ))
        };
        let end = self.ended.next(deadline)?.with_context(late)?;
        if !matches!(end.verdict, PartReport::QUALIFIED | PartReport::MEASURED) {
            bail!(CellFailure(end.text));
        }
        let topic = self.cell.topic(topics::PART_REPORTS.name);
        // The recorder writes to disk about as often as it says that it records.
        while self.written.next(deadline)?.is_some() {
            let bag = Bag::open(recording)?;
            // The topic is not there before its first message.
            let reports = bag.typed::<PartReport>(&topic);
            let is_end =
                |one: Result<Stamped<PartReport>, _>| one.is_ok_and(|one| one.message == end);
            if !reports.is_ok_and(|mut reports| reports.any(is_end)) {
                continue;
            }
            let session = session_io::measured_of(&bag, &Measurement::Last, None)?.session;
            let references = if self.has_reference { round + 1 } else { 0 };
            if complete(&session) && session.references.len() >= references {
                return Ok(session);
            }
        }
        bail!(late())
    }
}
