//! Writes the programs that decide what follows a measured size: rows 0 to 5 of the turn-mill's decision table.
//!
//! Sizes are diameters in mm. R parameters: R10 drawing size, R11 tolerance, R12 least wear, R13 most corrections, R14
//! corrections made, R15 side (+1 outer, −1 bore), R16 row that matched, R17 measured size, R18 1 after a valid
//! measurement, R20 tool. Wear is that of the tool's length 1 (`$TC_DP12`), which counts on the radius: the table's wear
//! is twice that. Everything is compared in whole nanometres, so a size on a limit is inside it. As the measuring cycles
//! do, the set size, actual size, difference and correction are left in `_OVR[0]`, `[4]`, `[16]` and `[20]`. The
//! table is in `docs/source_systems.md, A.4`.

use std::fmt::Write as _;

use controllers::measuring::ProgramError;

use crate::dialect::Characteristic;

/// Alarm of row 0; that of row r is r more.
pub const STOPPED: u32 = 65100;

/// The deciding program: sets R16 to the row that matched, and in row 5 the wear of tool R20 and the count R14.
pub const DECIDE: &str = "\
%_N_OMM_DECIDE_SPF
;$PATH=/_N_SPF_DIR
PROC OMM_DECIDE
R16=0
IF R18<>1 GOTOF DONE
R21=ROUND((R17-R10)*1000000)
R22=ROUND(R11*1000000)
R23=ROUND(R15*2*$TC_DP12[R20,1]*1000000)-ABS(R21)
_OVR[0]=R10 _OVR[4]=R17 _OVR[16]=R17-R10 _OVR[20]=0
IF ABS(R21)<=R22
R16=1
ELSE
IF R15*R21<-R22
R16=2
ELSE
IF R23<ROUND(R12*1000000)
R16=3
ELSE
IF R14>=R13
R16=4
ELSE
R16=5
ENDIF
ENDIF
ENDIF
ENDIF
IF R16<>5 GOTOF DONE
_OVR[20]=R15*R23/1000000-2*$TC_DP12[R20,1]
$TC_DP12[R20,1]=R15*R23/2000000
R14=R14+1
DONE:
M17
";

/// The main program `OMM_PART` of one feature and the deciding program: rough (`OMM_ROUGH`), measure (`OMM_SIZE`, which
/// sets R17 and R18), decide, and recut until the size qualifies; then finish (`OMM_FINISH`), measure and decide in the
/// same way. Every other row ends in an alarm. The caller supplies these three programs.
///
/// # Errors
/// [`ProgramError::Setting`] for numbers out of range.
pub fn main_program(feature: &Characteristic) -> Result<String, ProgramError> {
    feature.check()?;
    let side = if feature.inner { -1 } else { 1 };
    let mut text = format!(
        "%_N_OMM_PART_MPF\n;$PATH=/_N_MPF_DIR\nR10={:.6} R11={:.6} R12={:.6} R13={} R15={side} R20={}\n",
        feature.nominal * 1e3,
        feature.tolerance * 1e3,
        feature.wear_limit * 1e3,
        feature.max_corrections,
        feature.tool_number
    );
    for cut in ["OMM_ROUGH", "OMM_FINISH"] {
        // Writing to a string does not fail.
        let written = write!(
            text,
            "R14=0\n{cut}_AGAIN:\n{cut}\nR18=0\nOMM_SIZE\nOMM_DECIDE\nIF R16==5 GOTOB {cut}_AGAIN\n\
             IF R16<>1 GOTOF STOPPED\n"
        );
        debug_assert!(written.is_ok());
    }
    text.push_str("M30\nSTOPPED:\n");
    for (row, words) in [
        (0, "MEASUREMENT INVALID"),
        (2, "OVERCUT"),
        (3, "TOOL WORN"),
        (4, "NOT CONVERGED"),
    ] {
        let written = writeln!(text, "IF R16=={row}\nMSG(\"{words}\")\nENDIF");
        debug_assert!(written.is_ok());
    }
    let written = writeln!(text, "SETAL({STOPPED}+R16)\nM30");
    debug_assert!(written.is_ok());
    text.push_str(DECIDE);
    Ok(text)
}
