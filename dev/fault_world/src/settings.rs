//! The cell of the runs: the default one with shorter limits.

use cell::Cell;
use cell_tests::cell;

/// m, of the cell file.
pub(crate) const WEAR_LIMIT: f64 = 0.110e-3;
/// s, the default of `machine_state.part_limit_s`.
pub(crate) const PART_LIMIT: f64 = 3.0;

/// s that the machines of the cells take to stand, after which the driver confirms a stop.
pub(crate) const STOPS: [f64; 4] = [0.0, 0.05, 0.4, 2.0];

/// The default cell; operators approve its corrections where `automatic` is false. Its machine takes `stop` s to stand.
pub(crate) fn default_cell(automatic: bool, stop: f64) -> Cell {
    cell("turn_mill.toml", |text| {
        let limits = "[cycle]\noperation_limit_s = 100.0\ndecision_limit_s = 10.0\ncorrection_limit_s = 45.0\n";
        let changed = text.replacen("[cycle]\n", limits, 1);
        let approval = format!("automatic_approval = {automatic}\napproval_limit_s = 20 #");
        let changed = changed.replacen("automatic_approval = true", &approval, 1);
        changed.replacen(
            "[simulator]\n",
            &format!("[simulator]\nstop_s = {stop:?}\n"),
            1,
        )
    })
}
