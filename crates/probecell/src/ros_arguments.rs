//! The ROS arguments of this process (`--ros-args`), by which every cell file that it reads is changed.

use std::{ffi::OsString, path::Path, sync::OnceLock};

use cell::{Cell, CellError, ros_arguments::RosArguments};

/// Of the command line, which a process has once.
static GIVEN: OnceLock<RosArguments> = OnceLock::new();

/// Takes them out of the words of the command line, which are returned.
///
/// # Errors
/// One sentence that begins with the argument.
pub(crate) fn take(words: impl IntoIterator<Item = OsString>) -> Result<Vec<OsString>, String> {
    let (own, given) = RosArguments::take(words)?;
    GIVEN.get_or_init(|| given);
    Ok(own)
}

/// The cell of a file, with their changes.
///
/// # Errors
/// See [`Cell::read`].
pub(crate) fn read_cell(file: &Path) -> Result<Cell, CellError> {
    GIVEN
        .get()
        .map_or_else(|| Cell::read(file), |given| Cell::read_with(file, given))
}

/// The same for a process that this one starts.
pub(crate) fn words() -> Vec<String> {
    GIVEN.get().map_or(Vec::new(), RosArguments::words)
}

/// What a person adds to a command for the cell of this process.
pub(crate) fn for_commands() -> String {
    let name = GIVEN.get().and_then(RosArguments::name);
    name.map_or(String::new(), |name| {
        format!(" --ros-args -r __ns:=/{name}")
    })
}
