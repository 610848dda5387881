//! Writes a SINUMERIK measuring program from a plan and its order: measuring moves, and a line in a log for each touch.
//!
//! Targets are positions of the joints in the machine's coordinates, as the order gives them, without tool offset (`D0`)
//! and frames (`SUPA`); an axis letter is that of the joint. A move that is not meant to touch runs with `MEAS=1` too and
//! ends in an alarm when the probe trips on it; so does a probe that is deflected before a touch, and a line that could
//! not be written. The log `OMM_LOG` holds `TOUCH n p $AA_MM[X]=…` for each touch, with number of the touch and index of
//! the point, or `MISS n p $AA_IM[X]=…` with where the move ended; mm and degrees. Every measured value is read after a
//! `STOPRE`.

use std::fmt::Write as _;

use controllers::{
    axes::{Axis, Letter},
    measuring::ProgramError,
};
use probecell_msgs::{InspectionPlan, MeasurementOrder};

use crate::measuring::{Leg, Purpose, legs, number};

/// Name of the program.
pub const PROGRAM: &str = "OMM_MEASURE";
/// Alarm of a touch where none was planned.
pub const UNPLANNED_TOUCH: u32 = 65186;
/// Alarm of a probe that is deflected before it should touch.
pub const DEFLECTED: u32 = 65187;
/// Alarm of a log that does not take a line.
pub const NOT_WRITTEN: u32 = 65188;

/// Writes the measuring program. Moves between touches are made at `travel_feed` (m/s) at most.
///
/// # Errors
/// [`ProgramError`] names the move that the controller cannot make.
pub fn measuring_program(
    plan: &InspectionPlan,
    order: &MeasurementOrder,
    axes: &[Axis],
    travel_feed: f64,
) -> Result<String, ProgramError> {
    let legs = legs(plan, order, axes, travel_feed)?;
    let mut text = format!("%_N_{PROGRAM}_MPF\n;$PATH=/_N_MPF_DIR\nDEF INT ERRNO\n");
    let mut line = |block: std::fmt::Arguments| {
        // Writing to a string does not fail.
        let written = writeln!(text, "{block}");
        debug_assert!(written.is_ok());
    };
    line(format_args!("G17 G40 G710 G90 G94 DIAMOF D0"));
    let linear: Vec<_> = axes
        .iter()
        .filter(|axis| !axis.letter.is_rotary())
        .map(|axis| axis.letter.to_string())
        .collect();
    line(format_args!("FGROUP({})", linear.join(",")));
    for leg in &legs {
        let (words, feed) = (words(leg), number(leg.feed));
        match leg.purpose {
            Purpose::Travel => {
                line(format_args!("SUPA G1{words} F{feed} MEAS=1\nSTOPRE"));
                line(format_args!("IF $AC_MEA[1]==1 GOTOF UNPLANNED"));
            }
            Purpose::Retract => line(format_args!("SUPA G0{words}")),
            Purpose::Touch => {
                let (touch, point) = (leg.touch, leg.point);
                line(format_args!(
                    "MSG(\"TOUCH {touch} OF {}\")\nSTOPRE",
                    order.order.len()
                ));
                line(format_args!("IF $A_PROBE[1]==1 GOTOF DEFLECTED"));
                line(format_args!("SUPA G1{words} F{feed} MEAS=1\nSTOPRE"));
                line(format_args!("IF $AC_MEA[1]==1"));
                line(format_args!(
                    "WRITE(ERRNO,\"OMM_LOG\",\"TOUCH {touch} {point}{})",
                    values(axes, "$AA_MM")
                ));
                line(format_args!("ELSE"));
                line(format_args!(
                    "WRITE(ERRNO,\"OMM_LOG\",\"MISS {touch} {point}{})",
                    values(axes, "$AA_IM")
                ));
                line(format_args!("ENDIF\nIF ERRNO<>0 GOTOF NOTWRITTEN"));
            }
        }
    }
    line(format_args!("MSG()\nM30"));
    for (label, words, alarm) in [
        ("UNPLANNED", "UNPLANNED TOUCH", UNPLANNED_TOUCH),
        ("DEFLECTED", "PROBE DEFLECTED BEFORE THE TOUCH", DEFLECTED),
        ("NOTWRITTEN", "LOG NOT WRITTEN", NOT_WRITTEN),
    ] {
        line(format_args!(
            "{label}:\nMSG(\"{words}\")\nSETAL({alarm})\nM30"
        ));
    }
    Ok(text)
}

fn words(leg: &Leg) -> String {
    let word = |&(letter, position): &(Letter, f64)| format!(" {letter}{}", number(position));
    leg.target.iter().map(word).collect()
}

/// The rest of a text with a value of each axis: its quotes are open before and closed after.
fn values(axes: &[Axis], variable: &str) -> String {
    let value = |axis: &Axis| {
        let name = format!("{variable}[{}]", axis.letter);
        format!(" {name}=\"<<{name}<<\"")
    };
    let text: String = axes.iter().map(value).collect();
    // Nothing stands in the last pair of quotes.
    text.trim_end_matches("<<\"").to_owned()
}
