//! What is to be written, and what a format needs of it.

use diagnosis::Report;
use machine::Chain;

use crate::CureError;
use crate::axis_error::turns;
use crate::cause::Cause;
use crate::head::{Change, head};

/// A file of the machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct File {
    /// Its name, for messages.
    pub name: String,
    /// Its text.
    pub text: String,
}

impl File {
    /// What is wrong with it, and what to do.
    pub(crate) fn wrong(&self, what: impl Into<String>) -> CureError {
        CureError::File {
            file: self.name.clone(),
            what: what.into(),
        }
    }
}

/// What a person asks for.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The report.
    pub report: &'a Report,
    /// Digest of the text of the report ([`crate::digest`]).
    pub digest: &'a str,
    /// What to write.
    pub format: &'static Format,
    /// Of groups of equals, those that a person has chosen.
    pub members: &'a [String],
    /// Causes to write; empty for all that the format holds.
    pub only: &'a [String],
    /// The axis, for a format that holds one.
    pub axis: Option<&'a str>,
    /// Number of the probe in a tool table; `None`: the tool whose remark says so.
    pub tool: Option<u32>,
    /// Places of a table; `None`: as many as its causes need.
    pub points: Option<usize>,
    /// From where to where a table goes, mm or degrees.
    pub travel: [Option<f64>; 2],
    /// The robot description.
    pub urdf: Option<&'a File>,
    /// The machine's settings as they are now.
    pub current: Option<&'a File>,
}

/// What one maker's machine loads.
#[derive(Debug)]
pub struct Format {
    /// As typed.
    pub name: &'static str,
    /// What it is.
    pub about: &'static str,
    /// Kinds of effects that it holds.
    pub(crate) holds: &'static [&'static str],
    /// Writes it.
    pub(crate) write: fn(&Job<'_>) -> Result<String, CureError>,
}

/// Causes that are certain and that the format holds.
#[derive(Debug)]
pub(crate) struct Job<'a> {
    /// What was asked for.
    pub(crate) request: &'a Request<'a>,
    /// At least one.
    pub(crate) causes: Vec<Cause>,
    /// What else was found, and why it is not in the file.
    pub(crate) stays: Vec<String>,
}

impl Job<'_> {
    /// The machine's settings of today.
    pub(crate) fn current(&self, what: &'static str) -> Result<&File, CureError> {
        self.request.current.ok_or(CureError::Missing {
            format: self.request.format.name,
            option: "--current FILE",
            what,
        })
    }

    /// From where to where a table goes, m or rad: as asked for, in `unit` for each of these, else where the causes were measured.
    pub(crate) fn travel(&self, unit: f64) -> Result<[f64; 2], CureError> {
        let measured = |name: &str| {
            self.causes
                .iter()
                .find_map(|cause| Some(cause.parameter(name)?.value))
        };
        let [from, to] = self.request.travel.map(|end| end.map(|end| end / unit));
        match (from.or(measured("from")), to.or(measured("to"))) {
            (Some(from), Some(to)) => Ok([from, to]),
            _ => Err(CureError::Missing {
                format: self.request.format.name,
                option: "--from and --to",
                what: "the travel of the axis, mm or degrees",
            }),
        }
    }

    /// The robot description.
    pub(crate) fn urdf(&self) -> Result<&File, CureError> {
        self.request.urdf.ok_or(CureError::Missing {
            format: self.request.format.name,
            option: "--urdf FILE",
            what: "the robot description against which the machine was measured",
        })
    }

    /// The machine of the robot description.
    pub(crate) fn chain(&self) -> Result<Chain, CureError> {
        Ok(Chain::from_urdf(&self.urdf()?.text)?)
    }

    /// The axis of a format that holds one: that of the causes, or the one asked for.
    pub(crate) fn one_axis(&self) -> Result<&str, CureError> {
        let mut axes: Vec<&str> = self.causes.iter().map(Cause::axis).collect();
        axes.sort_unstable();
        axes.dedup();
        match (self.request.axis, axes.as_slice()) {
            (Some(axis), _) if axes.contains(&axis) => Ok(axis),
            (Some(axis), _) => Err(CureError::Report(format!(
                "the report has no cause of axis {axis} that {} holds",
                self.request.format.name
            ))),
            (None, [axis]) => Ok(axis),
            (None, _) => Err(CureError::Report(format!(
                "{} holds one axis, and the report names {}: say which by --axis",
                self.request.format.name,
                axes.join(", ")
            ))),
        }
    }

    /// The axis of a table, its causes, and one of mm, or of degrees of an axis that turns, in m or rad.
    pub(crate) fn of_one_axis(&self) -> Result<(String, Vec<Cause>, f64), CureError> {
        let axis = self.one_axis()?.to_owned();
        let own = self.causes.iter().filter(|one| one.axis() == axis);
        let own: Vec<Cause> = own.cloned().collect();
        let unit = if own.iter().any(turns) {
            1.0_f64.to_degrees()
        } else {
            1e3
        };
        Ok((axis, own, unit))
    }

    /// What the file says of itself, each line to be commented; `causes` are those that are in it.
    pub(crate) fn head(&self, causes: &[Cause], changes: &[Change], undo: &str) -> Vec<String> {
        let others = self
            .causes
            .iter()
            .filter(|one| !causes.iter().any(|own| own.name == one.name));
        let others = others.map(|one| format!("{} (another file)", one.name));
        let stays: Vec<String> = others.chain(self.stays.iter().cloned()).collect();
        head(
            (self.request.report, self.request.digest),
            causes,
            changes,
            &stays,
            undo,
        )
    }
}
