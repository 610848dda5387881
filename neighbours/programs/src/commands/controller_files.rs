//! What `probecell program` and `probecell results` share: the axes as a controller names them, and the files that it wrote.

use std::{fs::File, io::Read, path::Path};

use anyhow::{Context, bail, ensure};
use controllers::{
    axes::{Axis, Letter},
    text::{Lines, ParseError},
};
use machine::{Chain, JointKind};
use programs::{
    dialect::recognise,
    registry::DIALECTS,
    results::{Outcome, Results, ResultsFormat},
};

/// A larger file is no report of a controller, bytes.
const LARGEST: u64 = 256 << 20;

/// The chain's axes as the controller calls them: by their own name, or by the letter given for it.
pub(super) fn axes(chain: &Chain, letters: &[String]) -> anyhow::Result<Vec<Axis>> {
    let mut given = Vec::new();
    for text in letters {
        let pair = text
            .split_once('=')
            .with_context(|| format!("--axis {text:?} is not NAME=LETTER"))?;
        if chain.axis_index(pair.0).is_none() {
            bail!("--axis {text:?}: the machine has no axis {:?}", pair.0);
        }
        given.push(pair);
    }
    let mut axes: Vec<Axis> = Vec::new();
    for (joint, name) in chain.axis_names().enumerate() {
        let letter = given
            .iter()
            .rev()
            .find(|(axis, _)| *axis == name)
            .map_or(name, |(_, letter)| letter);
        let letter: Letter = letter
            .parse()
            .with_context(|| format!("axis {name:?} needs a letter: give --axis {name}=LETTER"))?;
        let one = chain.axis(joint);
        if letter.is_rotary() != (one.kind == JointKind::Revolute) {
            bail!("axis {name:?} cannot be {letter}: X, Y, Z are linear, A, B, C are rotary");
        }
        if axes.iter().any(|axis| axis.letter == letter) {
            bail!("two axes of the machine are called {letter}: give --axis NAME=LETTER");
        }
        axes.push(Axis {
            name: name.to_owned(),
            letter,
            joint,
            limits: one.limits.map(|(lower, upper)| [lower, upper]),
        });
    }
    Ok(axes)
}

/// Points that were touched according to a file.
pub(super) fn touched_points(path: &Path) -> anyhow::Result<Vec<u32>> {
    let (_, results) = read_results(path, None)?;
    let touches = results.touches.iter();
    let touched = touches.filter(|touch| touch.outcome == Outcome::Touch);
    Ok(touched.map(|touch| touch.point_index).collect())
}

/// Reads one file, in the format given or in that which recognises it.
pub(super) fn read_results(
    path: &Path,
    format: Option<&'static dyn ResultsFormat>,
) -> anyhow::Result<(&'static dyn ResultsFormat, Results)> {
    let text = text_of(path)?;
    let named =
        |error: ParseError| anyhow::Error::new(error).context(format!("{}", path.display()));
    let format = match format {
        Some(format) => format,
        None => recognise(DIALECTS, &text).map_err(named)?,
    };
    Ok((format, format.read(&text).map_err(named)?))
}

/// The file with plain ends of lines, and without the control codes of a serial line (DC1 to DC4).
fn text_of(path: &Path) -> anyhow::Result<String> {
    let unread = || format!("{} cannot be read", path.display());
    let mut bytes = Vec::new();
    let kind = std::fs::metadata(path).with_context(unread)?;
    ensure!(kind.is_file(), "{} is not a regular file", path.display());
    let file = File::open(path).with_context(unread)?;
    file.take(LARGEST + 1)
        .read_to_end(&mut bytes)
        .with_context(unread)?;
    ensure!(
        bytes.len() as u64 <= LARGEST,
        "{} is larger than {} MiB: no controller reports that much",
        path.display(),
        LARGEST >> 20
    );
    // DPRNT ends a block by a carriage return, with or without a line feed on either side.
    let mut plain = Vec::with_capacity(bytes.len());
    let mut ended = 0;
    for byte in bytes {
        match byte {
            0x11..=0x14 => {}
            b'\r' | b'\n' if ended != 0 && ended != byte => ended = 0,
            b'\r' | b'\n' => {
                ended = byte;
                plain.push(b'\n');
            }
            other => {
                ended = 0;
                plain.push(other);
            }
        }
    }
    let mut lines = Lines::default();
    lines
        .push(&plain)
        .and_then(|()| lines.push(b"\n"))
        .with_context(|| format!("{}", path.display()))?;
    String::from_utf8(plain).with_context(unread)
}
