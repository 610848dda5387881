//! LinuxCNC as a dialect: measuring programs in G-code, results by a log.

use controllers::linuxcnc::{
    self, RawConfig,
    log::{Entry, Fate, parse},
    program::{self, Settings, Touching},
};
use controllers::text::ParseError;

use crate::{
    dialect::{Dialect, DialectError, Job, Limits, ProgramWriter},
    results::{Outcome, Results, ResultsFormat, Touch, lines},
};

/// G-code of LinuxCNC.
#[derive(Clone, Copy, Debug)]
pub struct LinuxCnc;

/// s, period of LinuxCNC's position loop where no cell file gives it.
const SERVO_PERIOD: f64 = 1e-3;

impl Dialect for LinuxCnc {
    fn name(&self) -> &'static str {
        linuxcnc::NAME
    }

    fn description(&self) -> &'static str {
        "G-code of LinuxCNC; results by a log"
    }

    fn writer(&self) -> Option<&dyn ProgramWriter> {
        Some(self)
    }

    fn formats(&self) -> &'static [&'static dyn ResultsFormat] {
        &[&Log]
    }
}

impl ProgramWriter for LinuxCnc {
    /// Six joints in the remote shell; a program is read block by block, so touches are not limited.
    fn limits(&self) -> Limits {
        Limits {
            touches: usize::MAX,
            axes: 6,
        }
    }

    fn write(&self, job: &Job<'_>) -> Result<String, DialectError> {
        let raw = job
            .settings
            .and_then(|settings| settings.downcast_ref::<RawConfig>());
        let config = raw.map(|raw| raw.clone().check()).transpose();
        let config = config.map_err(|error| DialectError::Driver(error.to_string()))?;
        let config = config.as_ref();
        let settings = Settings {
            axes: config.map_or(job.axes, |config| &config.axes),
            touching: config.map_or(Touching::Once, |config| config.touching),
            preamble: config.map_or(&[], |config| &config.preamble),
            first_moves: config.map_or(&[], |config| &config.first_moves),
            servo_period: config.map_or(SERVO_PERIOD, |config| config.servo_period),
            log_path: job.log_path,
            token: "probecell",
        };
        Ok(program::measuring_program(job.plan, job.order, &settings)?.text)
    }
}

/// The log of a measuring program. It gives positions in mm and degrees in the order of the program's axes, without their
/// letters.
struct Log;

impl ResultsFormat for Log {
    fn name(&self) -> &'static str {
        "linuxcnc-log"
    }

    fn description(&self) -> &'static str {
        "log of a LinuxCNC program of `probecell program`"
    }

    fn content(&self) -> &'static str {
        "a log of LinuxCNC"
    }

    fn recognises(&self, first_line: &str) -> bool {
        matches!(first_line.split_whitespace().next(), Some("begin" | "next"))
    }

    fn read(&self, text: &str) -> Result<Results, ParseError> {
        let entries = read_log(text)?;
        let complete = matches!(entries.last(), Some(Entry::End));
        let touches = entries.into_iter().filter_map(|entry| match entry {
            Entry::Probed {
                number,
                point_index,
                fate,
                position,
            } => {
                let outcome = match fate {
                    Fate::Touch => Outcome::Touch,
                    Fate::Miss => Outcome::Miss,
                    Fate::Stuck => Outcome::Stuck,
                };
                Some(Touch::without_axes(outcome, number, point_index, position))
            }
            _ => None,
        });
        Ok(Results::of_touches(touches.collect(), complete))
    }
}

/// Reads a whole log. The number of axes is that of the first touch.
///
/// # Errors
/// Line and column of what is not of the format.
fn read_log(text: &str) -> Result<Vec<Entry>, ParseError> {
    let mut entries = Vec::new();
    let mut axes = None;
    for (line, content) in lines(text) {
        let width = content.split_whitespace().count().saturating_sub(3);
        let entry = parse(line, content, axes.unwrap_or(width))?;
        if matches!(entry, Entry::Probed { .. }) {
            axes = axes.or(Some(width));
        }
        entries.push(entry);
    }
    Ok(entries)
}
