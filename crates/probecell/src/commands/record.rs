//! `probecell record`: a cell into a bag, until it is told to end.

use std::{path::Path, path::PathBuf, sync::mpsc::channel, time::Duration};

use bags::SplitAt;
use cell::Cell;
use host::{RecorderProcess, RecordingSettings, bus::Bus};

use crate::{GOOD, LOSS, launcher, report, signals};

/// Name of the embedded cell file.
pub(crate) const CELL_FILE: &str = "cell.toml";
/// Name of the embedded robot description.
pub(crate) const ROBOT_FILE: &str = "robot.urdf";

/// Records until SIGINT or SIGTERM.
pub(crate) fn run(file: &Path, folder: Option<PathBuf>, supervised: bool) -> anyhow::Result<u8> {
    if supervised {
        signals::end_with_parent()?;
    }
    let cell = Cell::read(file)?;
    let (sender, receiver) = channel();
    signals::on_end(move || sender.send(()).unwrap_or_default())?;
    let folder = folder.unwrap_or_else(|| launcher::new_recording(&cell));
    if let Some(parent) = folder.parent() {
        std::fs::create_dir_all(parent)?;
    }
    let bus = Bus::open(&launcher::bus_config(&cell)?, "recorder", &cell.namespace())?;
    let process = RecorderProcess::start(&bus, settings(&cell, folder.clone()))?;
    while receiver.recv_timeout(Duration::from_millis(200)).is_err() {
        if let Some(failure) = process.failure() {
            return Err(failure.into());
        }
    }
    let statistics = process.finish()?;
    bus.close(Duration::from_secs(2))?;
    if !supervised {
        report::line(&format!(
            "{} messages in {}",
            statistics.messages,
            folder.display()
        ));
    }
    if statistics.missing() > 0 {
        report::line(&format!(
            "{} messages are missing from {}",
            statistics.missing(),
            folder.display()
        ));
        return Ok(LOSS);
    }
    Ok(GOOD)
}

fn settings(cell: &Cell, folder: PathBuf) -> RecordingSettings {
    let text = cell.text();
    let attachment = |name: &str, media: &str, data: &str| {
        (name.to_owned(), media.to_owned(), data.as_bytes().to_vec())
    };
    RecordingSettings {
        folder,
        namespace: cell.namespace(),
        nodes: cell.node_names().into_iter().map(str::to_owned).collect(),
        sync_interval: Duration::from_secs_f64(cell.recorder.flush_interval_s.clamp(0.01, 3600.0)),
        split: SplitAt {
            bytes: cell.recorder.split_size_mib.map(|mib| mib << 20),
            duration: cell
                .recorder
                .split_duration_s
                .map(|seconds| Duration::from_secs_f64(seconds.clamp(0.1, 1e9))),
        },
        attachments: vec![
            attachment(CELL_FILE, "application/toml", &text.cell),
            attachment(ROBOT_FILE, "application/xml", &text.robot_description),
        ],
    }
}
