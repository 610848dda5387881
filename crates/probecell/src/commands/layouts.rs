//! `probecell layouts`: what Foxglove, Lichtblick, RViz and PlotJuggler show of a cell.

use std::{fs, path::Path};

use anyhow::Context;

use crate::{GOOD, output, ros_arguments::read_cell};

/// Namespace in the layouts of the repository.
const NAMESPACE: &str = "/turn_mill";
/// File name and text of each.
const LAYOUTS: [(&str, &str); 3] = [
    (
        "foxglove.json",
        include_str!("../../../../launch-scripts/viewers/foxglove.json"),
    ),
    (
        "probecell.rviz",
        include_str!("../../../../launch-scripts/viewers/probecell.rviz"),
    ),
    (
        "plotjuggler.xml",
        include_str!("../../../../launch-scripts/viewers/plotjuggler.xml"),
    ),
];

/// Writes the layouts for the topics of a cell; a file that exists is an error.
pub(crate) fn run(file: &Path, folder: &Path) -> anyhow::Result<u8> {
    let cell = read_cell(file)?;
    let cannot = || format!("layouts cannot be written to {}", folder.display());
    fs::create_dir_all(folder).with_context(cannot)?;
    for (name, text) in LAYOUTS {
        let path = folder.join(name);
        let text = text
            .replace(NAMESPACE, &cell.namespace())
            .replace(&NAMESPACE[1..], &cell.cell.name);
        fs::OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&path)
            .and_then(|mut file| std::io::Write::write_all(&mut file, text.as_bytes()))
            .with_context(|| format!("cannot write {}", path.display()))?;
        output::line(&path.display().to_string());
    }
    let namespace = cell.namespace();
    output::line(&format!(
        "RViz: rviz2 -d probecell.rviz --ros-args -r /tf:={namespace}/tf -r /tf_static:={namespace}/tf_static"
    ));
    Ok(GOOD)
}
