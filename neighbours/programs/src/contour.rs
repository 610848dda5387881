//! Writes the program that mills a plane contour along a path of the cutter's centre.
//!
//! Plain RS-274 (G0, G1, G17, G21, G40, G90, G94), which FANUC, SINUMERIK in its ISO mode and LinuxCNC read alike: the
//! path is the cutter's centre, so no radius compensation is switched on. Arguments m, m/s, rad/s; the text mm, mm/min,
//! r/min. It chooses no cutting data and knows no fixture: the caller says from where the cutter may plunge.

use std::fmt::Write;

/// How the contour is cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contour {
    /// Number of the tool.
    pub tool_number: u32,
    /// Speed of the spindle, rad/s.
    pub spindle_speed: f64,
    /// Feed along the path, m/s.
    pub feed: f64,
    /// Height at which it is cut, m.
    pub depth: f64,
    /// Height at which nothing is in the way, m.
    pub clearance: f64,
    /// Length by which the path is entered and left along its first and last direction, m.
    pub overrun: f64,
}

/// A contour that cannot be cut.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ContourError {
    /// A number out of range.
    #[error("contour: {what} is {value}")]
    Number {
        /// What it is.
        what: &'static str,
        /// Its value in SI.
        value: f64,
    },
    /// Fewer than two different points.
    #[error("a contour needs at least two different points, {0} given")]
    TooFewPoints(usize),
}

/// The program `name` (a comment) that moves the cutter's centre along `path` (m).
///
/// # Errors
/// See [`ContourError`].
pub fn contour_program(
    name: &str,
    path: &[[f64; 2]],
    contour: &Contour,
) -> Result<String, ContourError> {
    check(path, contour)?;
    let count = path.len();
    let too_few = || ContourError::TooFewPoints(count);
    let enter = beyond(path[0], path[1], contour.overrun).ok_or_else(too_few)?;
    let leave = beyond(path[count - 1], path[count - 2], contour.overrun).ok_or_else(too_few)?;
    // A comment ends at its first bracket.
    let name: String = name
        .chars()
        .filter(|letter| letter.is_ascii_alphanumeric() || " -_./".contains(*letter))
        .collect();
    let mut text = format!("%\n({name})\nG17 G21 G40 G90 G94\n");
    let mut line = |block: std::fmt::Arguments| {
        // Writing to a string does not fail.
        let written = writeln!(text, "{block}");
        debug_assert!(written.is_ok());
    };
    let speed = contour.spindle_speed * 60.0 / std::f64::consts::TAU;
    line(format_args!("T{} M6", contour.tool_number));
    line(format_args!("S{speed:.0} M3"));
    line(format_args!("G0 Z{}", millimetres(contour.clearance)));
    line(format_args!(
        "G0 X{} Y{}",
        millimetres(enter[0]),
        millimetres(enter[1])
    ));
    line(format_args!(
        "G1 Z{} F{}",
        millimetres(contour.depth),
        feed(contour.feed)
    ));
    for point in path.iter().chain([&leave]) {
        line(format_args!(
            "G1 X{} Y{}",
            millimetres(point[0]),
            millimetres(point[1])
        ));
    }
    line(format_args!("G0 Z{}", millimetres(contour.clearance)));
    line(format_args!("M5"));
    line(format_args!("M30"));
    text.push_str("%\n");
    Ok(text)
}

fn check(path: &[[f64; 2]], contour: &Contour) -> Result<(), ContourError> {
    if path.len() < 2 {
        return Err(ContourError::TooFewPoints(path.len()));
    }
    for (what, value, least) in [
        (
            "the spindle speed",
            contour.spindle_speed,
            f64::MIN_POSITIVE,
        ),
        ("the feed", contour.feed, f64::MIN_POSITIVE),
        ("the overrun", contour.overrun, 0.0),
        ("the depth", contour.depth, f64::MIN),
        ("the clearance", contour.clearance, contour.depth),
    ] {
        if !(value.is_finite() && value >= least) {
            return Err(ContourError::Number { what, value });
        }
    }
    let coordinates = path.iter().flatten();
    match coordinates.copied().find(|value| !value.is_finite()) {
        Some(value) => Err(ContourError::Number {
            what: "a coordinate",
            value,
        }),
        None => Ok(()),
    }
}

/// The point before `from` on the straight line from `towards`.
fn beyond(from: [f64; 2], towards: [f64; 2], length: f64) -> Option<[f64; 2]> {
    let (dx, dy) = (from[0] - towards[0], from[1] - towards[1]);
    let norm = dx.hypot(dy);
    (norm > 0.0).then(|| [from[0] + dx / norm * length, from[1] + dy / norm * length])
}

/// mm with a tenth of a micrometre.
fn millimetres(metres: f64) -> String {
    let text = format!("{:.4}", metres * 1e3);
    if text == "-0.0000" {
        "0.0000".to_owned()
    } else {
        text
    }
}

/// mm/min.
fn feed(metres_per_second: f64) -> String {
    format!("{:.1}", metres_per_second * 60e3)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUT: Contour = Contour {
        tool_number: 3,
        spindle_speed: 5000.0 * std::f64::consts::TAU / 60.0,
        feed: 0.5 / 60.0,
        depth: -5e-3,
        clearance: 20e-3,
        overrun: 10e-3,
    };

    #[test]
    fn the_cutter_enters_follows_and_leaves_the_path() {
        let path = [[0.0, 0.0], [1e-3, 0.0], [1e-3, 2.00004e-3]];
        let program = contour_program("profile (2)", &path, &CUT).unwrap();
        assert_eq!(
            program.lines().collect::<Vec<_>>(),
            [
                "%",
                "(profile 2)",
                "G17 G21 G40 G90 G94",
                "T3 M6",
                "S5000 M3",
                "G0 Z20.0000",
                "G0 X-10.0000 Y0.0000",
                "G1 Z-5.0000 F500.0",
                "G1 X0.0000 Y0.0000",
                "G1 X1.0000 Y0.0000",
                "G1 X1.0000 Y2.0000",
                "G1 X1.0000 Y12.0000",
                "G0 Z20.0000",
                "M5",
                "M30",
                "%",
            ]
        );
    }

    #[test]
    fn impossible_contours_are_refused() {
        let path = [[0.0, 0.0], [1e-3, 0.0]];
        let low = Contour {
            clearance: -6e-3,
            ..CUT
        };
        for (path, contour, expected) in [
            (&path[..1], CUT, "at least two"),
            (&[path[0], path[0]], CUT, "at least two"),
            (&[path[0], [f64::NAN, 0.0]], CUT, "a coordinate is NaN"),
            (&path[..], low, "the clearance is -0.006"),
            (&path[..], Contour { feed: 0.0, ..CUT }, "the feed is 0"),
        ] {
            let error = contour_program("x", path, &contour).unwrap_err();
            assert!(error.to_string().contains(expected), "{error}");
        }
    }
}
