//! Reads the log that a program of [`super::program`] leaves, line by line while it grows.

use std::{
    fs::File,
    io::{ErrorKind, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use crate::text::{Lines, ParseError, Words};

/// One line of a log. Positions are mm and degrees in the machine's coordinates, one for each axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// The program has begun.
    Begin {
        /// Whose log it is.
        token: String,
        /// Touches that it will make.
        touches: u32,
        /// It has put offsets of G92 aside, which it will take up again at its end.
        g92: bool,
    },
    /// The program is on its way to a touch.
    Next {
        /// Number of the touch, from 1.
        number: u32,
        /// Index into the plan's points.
        point_index: u32,
    },
    /// A probing move has ended.
    Probed {
        /// Number of the touch, from 1.
        number: u32,
        /// Index into the plan's points.
        point_index: u32,
        /// What came of it.
        fate: Fate,
        /// mm or degrees, where the probe tripped, or where the move ended without a trip.
        position: Vec<f64>,
    },
    /// The work offset that is active is rotated (degrees), so nothing was moved.
    Rotated(f64),
    /// Value of an offset in mm or degrees, before it is set and after.
    Offset(f64),
    /// The program has come to its end.
    End,
}

/// What came of a probing move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// The probe tripped on the way.
    Touch,
    /// The move ended without a trip.
    Miss,
    /// The probe was tripped where the move began.
    Stuck,
}

/// Reads one line of a log of a machine with `axes` axes.
///
/// # Errors
/// Column of what is not of the format.
pub fn parse(line: u64, text: &str, axes: usize) -> Result<Entry, ParseError> {
    let mut words = Words::new(line, text);
    let kind = words.take(
        "begin, next, touch, miss, stuck, rotated, offset or end",
        |word| {
            [
                "begin", "next", "touch", "miss", "stuck", "rotated", "offset", "end",
            ]
            .into_iter()
            .find(|known| *known == word)
        },
    )?;
    let entry = match kind {
        "begin" => {
            let token = words.take("a token", Some)?.to_owned();
            Entry::Begin {
                token,
                touches: words.count()?,
                g92: words.count()? != 0,
            }
        }
        "next" => Entry::Next {
            number: words.count()?,
            point_index: words.count()?,
        },
        "rotated" => Entry::Rotated(words.number()?),
        "offset" => Entry::Offset(words.number()?),
        "end" => {
            words.count()?;
            Entry::End
        }
        probed => {
            let fate = match probed {
                "touch" => Fate::Touch,
                "miss" => Fate::Miss,
                _ => Fate::Stuck,
            };
            let (number, point_index) = (words.count()?, words.count()?);
            let position = (0..axes)
                .map(|_| words.number())
                .collect::<Result<_, _>>()?;
            Entry::Probed {
                number,
                point_index,
                fate,
                position,
            }
        }
    };
    words.end()?;
    Ok(entry)
}

/// Why a log could not be read.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file cannot be read.
    #[error("log cannot be read: {source}: {path}")]
    File {
        /// What the system says.
        source: std::io::Error,
        /// The file.
        path: PathBuf,
    },
    /// A line makes no sense.
    #[error("log of the program: {0}")]
    Line(#[from] ParseError),
}

/// Follows a log while the controller writes it. A line that is not complete yet waits for its end.
#[derive(Debug)]
pub struct Follower {
    path: PathBuf,
    axes: usize,
    read: u64,
    lines: Lines,
}

impl Follower {
    /// Follows the file at `path`, which need not exist yet.
    pub fn new(path: &Path, axes: usize) -> Self {
        Self {
            path: path.to_owned(),
            axes,
            read: 0,
            lines: Lines::default(),
        }
    }

    /// What was written since the last look.
    ///
    /// # Errors
    /// The file cannot be read, or a line is not of the format.
    pub fn read_new(&mut self) -> Result<Vec<Entry>, LogError> {
        let failed = |source| LogError::File {
            source,
            path: self.path.clone(),
        };
        let mut bytes = Vec::new();
        match File::open(&self.path) {
            Ok(mut file) => {
                file.seek(SeekFrom::Start(self.read)).map_err(failed)?;
                file.read_to_end(&mut bytes).map_err(failed)?;
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(failed(error)),
        }
        self.read += bytes.len() as u64;
        self.lines.push(&bytes)?;
        let mut entries = Vec::new();
        while let Some((line, text)) = self.lines.next_line() {
            entries.push(parse(line, &text, self.axes)?);
        }
        Ok(entries)
    }
}
