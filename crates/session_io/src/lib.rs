//! Conversion of recordings for the other crates: a measurement as input of the diagnosis, with the model that its cell declares; the record of
//! its parts; its plan ordered again; and the reverse, a made session as a recording.
//!
//! ```text
//!  bag ──> bags::Session of the measurement ──┐
//!      ──> that of the plan it supplements ───┼──> effects::Session, and what a person has to know of it
//!      ──> cell file: declared effects ───────┘
//!      ──> parts: all of its measurements diagnosed together
//!      ──> record: report::PartSession ──> its page; sizes as JSON
//!      ──> order: the measuring order that would have been shorter
//!  touches and their plan ──> evaluation: deviations, features with uncertainty
//!  files of other systems ──> import ──> effects::Session ──> write, imported: a bag
//!  what an instrument found ──> reference: the bag with it
//!  bag ──> export: exchange::export::Record, for files of other systems
//! ```
//!
//! `probecell`, the programs beside it and the Python package read and write recordings through this crate, so that their results agree.
//!
//! ```no_run
//! use bags::Measurement;
//! use session_io::{Measured, measured};
//!
//! let Measured { session, remarks } = measured("session.mcap".as_ref(), &Measurement::Last, None)?;
//! println!("{} touches, {} remarks", session.events.len(), remarks.len());
//! # Ok::<(), anyhow::Error>(())
//! ```

pub mod embedded;
pub mod evaluation;
pub mod export;
pub mod import;
pub mod imported;
pub mod order;
mod parts;
mod reader;
pub mod record;
pub mod reference;
pub mod sizes;
mod unrecorded;
pub mod write;

pub use parts::{Diagnosed, diagnosed};
pub use reader::Reader;

use std::path::Path;

use anyhow::bail;
use bags::{Bag, Measurement};
use cell::{Cell, ModelSection};
use diagnosis::{DeclaredEffect, Session};
use effects::session::joined::join;
use probecell_msgs::{PlanId, PlanProgress};

/// Whether what a command is given is a cell file and not a bag.
pub fn is_cell_file(source: &Path) -> bool {
    source.extension().is_some_and(|end| end == "toml")
}

/// A measurement, and what a person must know of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// The session.
    pub session: Session,
    /// Damage that leaves enough, and touches that are missing: a sentence each.
    pub remarks: Vec<String>,
}

/// Reads a measurement of the bag at `path`, compared with the effects of `model`, or where it is `None` with those of the
/// cell file that the bag carries. Where the measurement is one of further touches, what it adds to stands before it.
///
/// # Errors
/// The bag, its session or the model cannot be read.
pub fn measured(
    path: &Path,
    measurement: &Measurement,
    model: Option<&[DeclaredEffect]>,
) -> anyhow::Result<Measured> {
    let bag = Bag::open(path)?;
    measured_of(&bag, measurement, model)
}

/// As [`measured`], of a bag that is open.
///
/// # Errors
/// As [`measured`].
pub fn measured_of(
    bag: &Bag,
    measurement: &Measurement,
    model: Option<&[DeclaredEffect]>,
) -> anyhow::Result<Measured> {
    let mut remarks = Vec::new();
    let mut one = |measurement: &Measurement| -> anyhow::Result<Session> {
        let session = bags::Session::read_measurement(bag, measurement)?;
        let declared = match model {
            Some(model) => model.to_vec(),
            None => declared(bag)?,
        };
        let Measured {
            session,
            remarks: own,
        } = plain(bag, session, declared);
        remarks.extend(own);
        Ok(session)
    };
    let last = one(measurement)?;
    let Some(plan) = &last.plan else {
        return Ok(Measured {
            session: last,
            remarks,
        });
    };
    let plan_id = PlanId::from(&plan.plan_id);
    let Some(first) = plan_id.supplemented() else {
        return Ok(Measured {
            session: last,
            remarks,
        });
    };
    let mut all = match one(&Measurement::Named(first.to_owned())) {
        Ok(session) => session,
        Err(problem) => {
            remarks.push(format!(
                "warning: {:?} adds to {first:?}, which is not in this bag: {problem}",
                plan.plan_id
            ));
            return Ok(Measured {
                session: last,
                remarks,
            });
        }
    };
    for number in 1..plan_id.supplement_number() {
        let earlier = PlanId::from(first).supplement(number);
        all = join(&all, &one(&Measurement::Named(earlier.to_string()))?)?;
    }
    Ok(Measured {
        session: join(&all, &last)?,
        remarks,
    })
}

/// A session as the diagnosis takes it, without the stamps of its reception; what is missing is remarked.
pub fn plain(bag: &Bag, session: bags::Session, declared: Vec<DeclaredEffect>) -> Measured {
    let damage = session
        .damage
        .iter()
        .map(|damage| format!("warning: {damage}: only the complete part is diagnosed"));
    let missing = session
        .missing
        .iter()
        .map(|missing| format!("warning: {missing}"));
    let void = (session.void > 0).then(|| {
        format!(
            "warning: {} touches of this plan from before a restart of the driver are void and left out",
            session.void
        )
    });
    let left_out = (session.left_out > 0).then(|| {
        let used = session.events.len();
        let all = used + session.left_out;
        format!("note: {used} of {all} touches, evenly spread, are read")
    });
    let remarks = damage.chain(missing).chain(void).chain(left_out);
    let remarks = remarks.collect();
    let name = bag.path().file_name();
    let name = name.map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    Measured {
        session: Session {
            name,
            robot_description: session.robot_description,
            plan: session.plan,
            events: messages(session.events),
            joint_states: messages(session.joint_states),
            joint_commands: messages(session.joint_commands),
            machine_states: messages(session.machine_states),
            references: messages(session.references),
            declared,
        },
        remarks,
    }
}

fn messages<T>(stamped: Vec<bags::Stamped<T>>) -> Vec<T> {
    stamped.into_iter().map(|stamped| stamped.message).collect()
}

/// Effects of the declared model that the bag carries.
fn declared(bag: &Bag) -> anyhow::Result<Vec<DeclaredEffect>> {
    let Some(text) = embedded::text(bag)? else {
        return Ok(Vec::new());
    };
    match ModelSection::of_text(&text.cell) {
        Ok(model) => Ok(model.effects),
        Err(error) => bail!("{}: {error}", text.name),
    }
}

/// The session of a cell that has measured nothing yet: its machine and the plan of its part. `name` is that of the session,
/// `progress` as in [`Cell::inspection_plan`].
///
/// # Errors
/// As [`Cell::inspection_plan`].
pub fn unmeasured(
    cell: &Cell,
    name: &str,
    progress: &mut dyn FnMut(&PlanProgress),
) -> anyhow::Result<Session> {
    Ok(Session {
        name: name.to_owned(),
        robot_description: cell.text().robot_description.clone(),
        plan: Some(cell.inspection_plan(0.0, progress)?),
        ..Session::default()
    })
}
