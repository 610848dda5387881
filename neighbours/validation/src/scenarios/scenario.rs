//! A row of the register, and how it is run.

use diagnosis::Report;

use crate::scenarios::{Figure, Outcome, Recorded, ScenarioError};

/// What a run is given.
#[derive(Clone, Copy)]
pub struct Run<'a> {
    /// Seed of all randomness.
    pub seed: u64,
    /// Called with the share done, 0 to 1, from time to time.
    pub progress: &'a dyn Fn(f64),
}

impl Run<'_> {
    /// A run without progress reports.
    pub fn silent(seed: u64) -> Self {
        Self {
            seed,
            progress: &|_| {},
        }
    }

    /// Reports that `done` of `all` equal steps are done.
    pub fn done(&self, done: usize, all: usize) {
        (self.progress)(done as f64 / all.max(1) as f64);
    }
}

/// Makes recorded sessions from a seed.
pub type Sessions = fn(u64) -> Result<Vec<Recorded>, ScenarioError>;

/// A scenario of the register.
#[derive(Clone, Copy)]
pub struct Scenario {
    /// Identifier in the register, as `A-probe-offset`.
    pub name: &'static str,
    /// What the cell's model leaves out.
    pub effect: &'static str,
    /// What the source says of it, with its figures.
    pub source: &'static str,
    /// Runs it.
    pub run: fn(&Run<'_>) -> Result<Outcome, ScenarioError>,
    /// Sessions as a cell would have recorded them, from a seed; `None` where the effect shows in no probing session.
    pub sessions: Option<Sessions>,
}

/// A scenario that was run: its outcome, with the figures of its sessions' diagnoses, and those diagnoses.
#[derive(Clone, Debug)]
pub struct Judged {
    /// What it left.
    pub outcome: Outcome,
    /// Each session and what the diagnosis said of it.
    pub sessions: Vec<(Recorded, Report)>,
}

impl Scenario {
    /// Runs the scenario, diagnoses its sessions and judges both.
    ///
    /// # Errors
    /// Why it cannot be run.
    pub fn judge(&self, run: &Run<'_>) -> Result<Judged, ScenarioError> {
        let mut outcome = (self.run)(run)?;
        let mut sessions = Vec::new();
        if let Some(record) = self.sessions {
            for recorded in record(run.seed)? {
                let report = recorded.diagnose()?;
                outcome.figures.extend(recorded.judge(&report));
                sessions.push((recorded, report));
            }
        }
        Ok(Judged { outcome, sessions })
    }
}

impl Judged {
    /// True if every figure keeps its rule.
    pub fn passes(&self) -> bool {
        self.outcome.passes()
    }

    /// Figures that break their rule.
    pub fn broken(&self) -> impl Iterator<Item = &Figure> {
        self.outcome
            .figures
            .iter()
            .filter(|figure| !figure.passes())
    }
}
