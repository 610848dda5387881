//! The cell of the runs: the default one with shorter limits.

use cell::Cell;
use cell_tests::cell;

/// m, of the cell file.
pub(crate) const WEAR_LIMIT: f64 = 0.110e-3;
/// s, the default of `machine_state.part_limit_s`.
pub(crate) const PART_LIMIT: f64 = 3.0;

/// The default cell; operators approve its corrections where `automatic` is false.
pub(crate) fn default_cell(automatic: bool) -> Cell {
    cell("turn_mill.toml", |text| {
        let limits = "[cycle]\noperation_limit_s = 100.0\ndecision_limit_s = 10.0\ncorrection_limit_s = 45.0\n";
        let changed = text.replacen("[cycle]\n", limits, 1);
        let approval = format!("automatic_approval = {automatic}\napproval_limit_s = 20 #");
        changed.replacen("automatic_approval = true", &approval, 1)
    })
}
