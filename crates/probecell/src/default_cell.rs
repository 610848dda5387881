//! The default cell, built into the program: `probecell up` works in any folder.

use std::path::Path;

use anyhow::Context;

use crate::{DEFAULT_CELL, output};

/// Files of the default cell: name, content.
pub(crate) const FILES: [(&str, &str); 2] = [
    (
        "turn_mill.toml",
        include_str!("../../../launch-scripts/turn_mill.toml"),
    ),
    (
        "turn_mill.urdf",
        include_str!("../../../launch-scripts/turn_mill.urdf"),
    ),
];

/// Writes the default cell where it is asked for and is not there, so that it can be read, changed and used by every other
/// command; nothing is written over.
pub(crate) fn provide(file: &Path) -> anyhow::Result<()> {
    if file != Path::new(DEFAULT_CELL) || file.exists() {
        return Ok(());
    }
    write(file.parent().unwrap_or(Path::new("")))?;
    output::remark(&format!(
        "there is no cell file here: the built-in one is written to {DEFAULT_CELL}"
    ));
    Ok(())
}

fn write(folder: &Path) -> anyhow::Result<()> {
    let cannot = |path: &Path| format!("the default cell cannot be written to {}", path.display());
    std::fs::create_dir_all(folder).with_context(|| cannot(folder))?;
    for (name, text) in FILES {
        let path = folder.join(name);
        if !path.exists() {
            std::fs::write(&path, text).with_context(|| cannot(&path))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_a_cell_and_a_file_of_the_user_stays() {
        let folder = tempfile::tempdir().expect("a folder");
        let below = folder.path().join("launch-scripts");
        write(&below).expect("written");
        let file = below.join("turn_mill.toml");
        let cell = cell::Cell::read(&file).expect("a cell");
        assert_eq!(cell.namespace(), "/turn_mill");
        let changed = FILES[0]
            .1
            .replace("name = \"turn_mill\"", "name = \"mine\"");
        std::fs::write(&file, &changed).expect("changed");
        write(&below).expect("written again");
        assert_eq!(std::fs::read_to_string(&file).expect("read"), changed);
    }
}
