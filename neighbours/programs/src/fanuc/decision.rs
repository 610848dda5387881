//! Writes the macros that decide what follows a measured size: rows 0 to 5 of the turn-mill's decision table.
//!
//! Sizes are diameters in mm. Variables: #600 measured size (vacant: no valid measurement), #601 tolerance, #602 least
//! wear, #603 most corrections, #604 corrections made, #605 side (+1 outer, −1 bore), #606 row that matched, #700 drawing
//! size, #10000 + n wear offset n. Everything is compared in whole nanometres, so a size on a limit is inside it.
//! The table is in `docs/source_systems.md, A.4`.

use std::fmt::Write as _;

use controllers::measuring::ProgramError;

use crate::dialect::Characteristic;

/// Highest number of a wear offset, #10001 to #10999.
const LAST_OFFSET: u32 = 999;

/// The deciding macro O0405: sets #606 to the row that matched, and in row 5 the wear `#WEAR` and the count #604.
const DECIDE: &str = "\
O0405(DECIDE)
IF[#600EQ#0]GOTO80
#31=ROUND[[#600-#700]*1000000]
#32=ROUND[#601*1000000]
IF[ABS[#31]LE#32]GOTO10
IF[#605*#31LT-#32]GOTO20
#33=ROUND[#605*#WEAR*1000000]-ABS[#31]
IF[#33LTROUND[#602*1000000]]GOTO30
IF[#604GE#603]GOTO40
#WEAR=#605*#33/1000000
#604=#604+1
#606=5
M99
N10#606=1
M99
N20#606=2
M99
N30#606=3
M99
N40#606=4
M99
N80#606=0
M99
";

/// The main program O0399 of one feature and the deciding macro: rough (O0400), measure (O0404), decide, and recut until
/// the size qualifies; then finish (O0403), measure and decide in the same way. Every other row ends in an alarm whose
/// number is 100 more than the row. The caller supplies O0400, O0403 and O0404, which sets #600.
///
/// # Errors
/// [`ProgramError::Setting`] for numbers out of range.
pub fn main_program(feature: &Characteristic) -> Result<String, ProgramError> {
    feature.check()?;
    if feature.tool_number == 0 || feature.tool_number > LAST_OFFSET {
        return Err(ProgramError::Setting {
            name: "tool_number",
            value: f64::from(feature.tool_number),
        });
    }
    let side = if feature.inner { -1 } else { 1 };
    let mut text = format!(
        "%\nO0399(MEASURE AND DECIDE)\n#700={:.6}\n#601={:.6}\n#602={:.6}\n#603={}\n#605={side}\n",
        feature.nominal * 1e3,
        feature.tolerance * 1e3,
        feature.wear_limit * 1e3,
        feature.max_corrections
    );
    for (pass, cut) in [(1, 400), (2, 403)] {
        let (again, done) = (10 * pass, 10 * pass + 5);
        // Writing to a string does not fail.
        let written = write!(
            text,
            "#604=0\nN{again}M98P{cut}\n#600=#0\nM98P404\nM98P405\nIF[#606EQ5]GOTO{again}\nIF[#606EQ1]GOTO{done}\n\
             GOTO90\nN{done}\n"
        );
        debug_assert!(written.is_ok());
    }
    text.push_str("M30\nN90IF[#606EQ0]THEN#3000=100(MEASUREMENT INVALID)\n");
    text.push_str("IF[#606EQ2]THEN#3000=102(OVERCUT)\nIF[#606EQ3]THEN#3000=103(TOOL WORN)\n");
    text.push_str("#3000=104(NOT CONVERGED)\n");
    text.push_str(&DECIDE.replace("#WEAR", &format!("#{}", 10_000 + feature.tool_number)));
    text.push_str("%\n");
    Ok(text)
}
