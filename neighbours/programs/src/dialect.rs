//! What a control dialect is: the language in which a controller is programmed and reports.
//!
//! A dialect is one file or folder of this crate that implements [`Dialect`], and one line in [`crate::registry`]. The commands
//! `probecell program` and `probecell results` take their choices, their help texts and the recognition of result files from
//! the registry.

use std::any::Any;

use controllers::{axes::Axis, measuring::ProgramError};
use probecell_msgs::{InspectionPlan, MeasurementOrder};

use crate::results::{ResultsError, ResultsFormat};

/// Why a dialect gives no program.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DialectError {
    /// It cannot be written.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// A job is beyond the limits of the dialect.
    #[error("the program would need {count} {what}; its controller takes at most {limit}")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// As asked for.
        count: usize,
        /// As permitted.
        limit: usize,
    },
    /// The cell's settings of the controller's driver cannot be used.
    #[error("{0}")]
    Driver(String),
    /// The dialect has no programs that decide.
    #[error("there are no decision programs for this controller: the cell itself corrects it")]
    NoDecisionProgram,
}

/// A control dialect.
pub trait Dialect: Sync {
    /// Identifier on the command line: lower case, no blanks.
    fn name(&self) -> &'static str;

    /// One line of help: the language, and by what way results come back.
    fn description(&self) -> &'static str;

    /// What writes programs; `None` for a source of results that runs no program of ours.
    fn writer(&self) -> Option<&dyn ProgramWriter> {
        None
    }

    /// The files that a controller of this dialect leaves.
    fn formats(&self) -> &'static [&'static dyn ResultsFormat] {
        &[]
    }
}

/// Writes programs in one dialect.
pub trait ProgramWriter {
    /// What the language or its control can hold; a job beyond it is refused by [`ProgramWriter::measuring_program`].
    fn limits(&self) -> Limits;

    /// The measuring program of a plan in the order given: moves guarded against unplanned contact, every target within the
    /// limits of its axis, one line of results for each touch.
    ///
    /// # Errors
    /// See [`DialectError`].
    fn measuring_program(&self, job: &Job<'_>) -> Result<String, DialectError> {
        self.limits().check(job)?;
        self.write(job)
    }

    /// Writes the measuring program of a job within the limits.
    ///
    /// # Errors
    /// See [`DialectError`].
    fn write(&self, job: &Job<'_>) -> Result<String, DialectError>;

    /// The program that, on the controller alone, cuts, measures and decides: correct the wear offset and cut again, finish,
    /// or stop (`docs/source_systems.md, A.4`). Dialects of machines that only the cell corrects refuse it.
    ///
    /// # Errors
    /// See [`DialectError`].
    fn decision_program(&self, _characteristic: &Characteristic) -> Result<String, DialectError> {
        Err(DialectError::NoDecisionProgram)
    }
}

/// What a program is written from.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// The plan.
    pub plan: &'a InspectionPlan,
    /// Its order, with the moves.
    pub order: &'a MeasurementOrder,
    /// The machine's axes, in the order of the controller's axis numbers.
    pub axes: &'a [Axis],
    /// m/s, highest feed of moves between touches, where the dialect guards them by a feed move.
    pub travel_feed: f64,
    /// Log file as the controller knows it, where the program opens one itself.
    pub log_path: &'a str,
    /// Settings of the driver of the same name as the dialect, where the cell file has them (`RawConfig` of its folder).
    pub settings: Option<&'a dyn Any>,
}

/// Limits of a dialect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Touches of one program.
    pub touches: usize,
    /// Axes of one program.
    pub axes: usize,
}

impl Limits {
    /// Refuses a job that the dialect cannot hold.
    ///
    /// # Errors
    /// [`DialectError::TooMany`].
    pub fn check(self, job: &Job<'_>) -> Result<(), DialectError> {
        let touches = job.order.order.len();
        for (what, count, limit) in [
            ("touches", touches, self.touches),
            ("axes", job.axes.len(), self.axes),
        ] {
            if count > limit {
                return Err(DialectError::TooMany { what, count, limit });
            }
        }
        Ok(())
    }
}

/// Limits of one size that a decision program judges: a diameter, and the tool whose wear offset corrects it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Characteristic {
    /// m, drawing size (a diameter).
    pub nominal: f64,
    /// m, half width of the tolerance.
    pub tolerance: f64,
    /// m, lowest permissible wear offset, negative.
    pub wear_limit: f64,
    /// Corrections after which the process counts as not converging.
    pub max_corrections: u32,
    /// An inner feature: a larger size is overcut.
    pub inner: bool,
    /// Number of the tool and of its wear offset.
    pub tool_number: u32,
}

impl Characteristic {
    /// Refuses numbers that no program can be written with.
    ///
    /// # Errors
    /// [`ProgramError::Setting`].
    pub(crate) fn check(&self) -> Result<(), ProgramError> {
        let positive = [
            ("nominal", self.nominal),
            ("tolerance", self.tolerance),
            ("-wear_limit", -self.wear_limit),
        ];
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(ProgramError::Setting { name, value });
            }
        }
        Ok(())
    }
}

/// The dialect with this name.
pub fn by_name<'a>(dialects: &[&'a dyn Dialect], name: &str) -> Option<&'a dyn Dialect> {
    dialects
        .iter()
        .copied()
        .find(|dialect| dialect.name() == name)
}

/// The formats of result files of `dialects`, in the order in which they are tried.
pub fn formats<'a>(
    dialects: &'a [&'a dyn Dialect],
) -> impl Iterator<Item = &'static dyn ResultsFormat> + 'a {
    dialects
        .iter()
        .flat_map(|dialect| dialect.formats())
        .copied()
}

/// The format that recognises a text by its first line that is not blank.
///
/// # Errors
/// [`ResultsError`] at that line when no format recognises it, or at the end of a blank text.
pub fn recognise(
    dialects: &[&dyn Dialect],
    text: &str,
) -> Result<&'static dyn ResultsFormat, ResultsError> {
    let (line, first) = crate::results::lines(text)
        .next()
        .map_or((1, ""), |(line, content)| (line, content.trim()));
    let found = formats(dialects).find(|format| !first.is_empty() && format.recognises(first));
    found.ok_or_else(|| {
        let contents: Vec<_> = formats(dialects).map(ResultsFormat::content).collect();
        let expected = match contents.split_last() {
            Some((last, [])) => (*last).to_owned(),
            Some((last, others)) => format!("{} or {last}", others.join(", ")),
            None => "nothing".to_owned(),
        };
        let found = if first.is_empty() {
            "the end of the file".to_owned()
        } else {
            format!("{first:?}")
        };
        ResultsError {
            line,
            column: 1,
            expected,
            found,
        }
    })
}
