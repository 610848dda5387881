//! What several of these tests begin with.

use std::path::Path;

use cell::Cell;
use cell_tests::cell;

/// The repository.
pub(crate) fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// The turn-mill as it is shipped.
pub(crate) fn turn_mill() -> Cell {
    cell("turn_mill.toml", str::to_owned)
}
