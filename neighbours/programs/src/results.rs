//! What a file that a controller printed or wrote holds, whatever its format.
//!
//! A file that is not what it should be is refused as a whole, with line and column: half a measurement is none.

pub use controllers::text::ParseError as ResultsError;
use controllers::{axes::Letter, text::ParseError};
use serde::Serialize;
use serde_json::{Value, json};

/// A format of result files.
pub trait ResultsFormat: Sync {
    /// Identifier on the command line and in JSON: lower case, no blanks.
    fn name(&self) -> &'static str;

    /// One line of help.
    fn description(&self) -> &'static str;

    /// What a file of this format holds, with its article, to be named where a file is of no format.
    fn content(&self) -> &'static str;

    /// Whether a file that begins with this line (trimmed, not empty) may be of this format.
    fn recognises(&self, first_line: &str) -> bool;

    /// Reads a whole file.
    ///
    /// # Errors
    /// The first mistake, with line and column.
    fn read(&self, text: &str) -> Result<Results, ParseError>;
}

/// Content of a result file.
#[derive(Clone, Debug)]
pub struct Results {
    /// As it stands in the file, in JSON.
    pub content: Value,
    /// Its touches, in the order of the file.
    pub touches: Vec<Touch>,
    /// Its content for a person, one line for each entry.
    pub lines: Vec<String>,
    /// The program that wrote it came to its end, as far as the format shows it.
    pub complete: bool,
}

/// What became of a touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// The probe tripped.
    Touch,
    /// The move ended without a trip.
    Miss,
    /// The probe was tripped before the move.
    Stuck,
}

impl Outcome {
    /// A touch, or a miss.
    pub fn of_trip(tripped: bool) -> Self {
        if tripped { Self::Touch } else { Self::Miss }
    }
}

/// Coordinates of a touch: positions of the machine's axes, or of the work coordinates that were active.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Frame {
    /// Positions of the axes.
    Machine,
    /// Work coordinates.
    Work,
}

/// A touch: m and rad, or mm and degrees where the file does not name its axes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Touch {
    /// What became of it.
    pub outcome: Outcome,
    /// Number of the touch, from 1.
    pub number: u32,
    /// Index into the plan's points.
    pub point_index: u32,
    /// Axes of the position; `None`: in the order of the program's axes.
    pub axes: Option<Vec<Letter>>,
    /// Units of the position.
    pub units: &'static str,
    /// Position of each axis.
    pub position: Vec<f64>,
    /// In which coordinates.
    #[serde(skip)]
    pub frame: Frame,
}

/// Units of a position whose axes are known.
const SI: &str = "m, rad";
/// Units of a position whose axes are not known.
const OF_CONTROLLER: &str = "mm, degrees";

impl Touch {
    /// A touch whose position is given by axis letter, in mm and degrees.
    pub fn with_axes(
        outcome: Outcome,
        number: u32,
        point_index: u32,
        frame: Frame,
        position: impl IntoIterator<Item = (Letter, f64)>,
    ) -> Self {
        let (axes, position) = position
            .into_iter()
            .map(|(letter, value)| (letter, letter.from_controller(value)))
            .unzip();
        Self {
            outcome,
            number,
            point_index,
            axes: Some(axes),
            units: SI,
            position,
            frame,
        }
    }

    /// A touch in machine coordinates, mm and degrees, in the order of the program's axes.
    pub fn without_axes(
        outcome: Outcome,
        number: u32,
        point_index: u32,
        position: Vec<f64>,
    ) -> Self {
        Self {
            outcome,
            number,
            point_index,
            axes: None,
            units: OF_CONTROLLER,
            position,
            frame: Frame::Machine,
        }
    }

    /// The touch for a person.
    fn line(&self) -> String {
        let letter = |index: usize| self.axes.as_ref().and_then(|axes| axes.get(index)).copied();
        let shown = |(index, value): (usize, &f64)| match letter(index) {
            Some(letter) => format!("{letter} {:.4}", letter.to_controller(*value)),
            None => format!("{value:.7}"),
        };
        let values: Vec<_> = self.position.iter().enumerate().map(shown).collect();
        let outcome = match self.outcome {
            Outcome::Touch => "touch",
            Outcome::Miss => "miss",
            Outcome::Stuck => "stuck",
        };
        format!(
            "{outcome:<6}{:>4}  point {:>4}  {}",
            self.number,
            self.point_index,
            values.join("  ")
        )
    }
}

impl Results {
    /// The content of a file that holds touches.
    pub fn of_touches(touches: Vec<Touch>, complete: bool) -> Self {
        Self {
            content: json!({ "touches": touches }),
            lines: touches.iter().map(Touch::line).collect(),
            touches,
            complete,
        }
    }

    /// The content of a complete file without touches.
    pub fn of_content(content: Value, lines: Vec<String>) -> Self {
        Self {
            content,
            touches: Vec::new(),
            lines,
            complete: true,
        }
    }
}

/// Lines that are not blank, with their numbers.
pub(crate) fn lines(text: &str) -> impl Iterator<Item = (u64, &str)> {
    (1..)
        .zip(text.lines())
        .filter(|(_, line)| !line.trim().is_empty())
}
