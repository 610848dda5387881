//! Finished recordings of a cell: what they take, how long the disk lasts at that, and which of them may go.
//!
//! Only recordings that the cell has named itself (`NAME_MILLISECONDS`), that were closed, and that hold nothing but files of a
//! recording are ever removed: one that was named by an operator, or that a killed recorder has left, stays.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use cell::{Cell, RecorderSection};

/// Recordings from which the rate is taken, the newest.
const RATED: usize = 5;
/// s of a day.
const DAY: f64 = 86_400.0;

/// A recording that was closed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Finished {
    pub(crate) path: PathBuf,
    /// ms since 1970 at which it was begun.
    begun_ms: u64,
    /// From its first to its last message, s.
    seconds: f64,
    pub(crate) bytes: u64,
}

impl Finished {
    /// s since 1970 of its last message, about.
    fn ended(&self) -> f64 {
        self.begun_ms as f64 * 1e-3 + self.seconds
    }
}

/// What the cell has recorded in its folder, the oldest first.
pub(crate) fn finished(cell: &Cell) -> Vec<Finished> {
    let Ok(entries) = fs::read_dir(&cell.recorder.folder) else {
        return Vec::new();
    };
    let mut found: Vec<Finished> = entries
        .flatten()
        // Of the entry itself: a link is no folder.
        .filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()))
        .filter_map(|entry| {
            let name = entry.file_name().into_string().ok()?;
            let number = name.strip_prefix(&cell.cell.name)?.strip_prefix('_')?;
            let begun_ms = number.parse().ok()?;
            let text = fs::read_to_string(entry.path().join("metadata.yaml")).ok()?;
            Some(Finished {
                begun_ms,
                seconds: duration(&text)?,
                bytes: bytes(&entry.path()),
                path: entry.path(),
            })
        })
        .collect();
    found.sort_by_key(|one| one.begun_ms);
    found
}

/// s of the whole recording in the metadata of rosbag2: the first duration.
fn duration(metadata: &str) -> Option<f64> {
    let behind = metadata.split_once("duration:")?.1;
    let nanoseconds = behind.split_once("nanoseconds:")?.1;
    let number = nanoseconds.lines().next()?.trim().parse::<u64>().ok()?;
    Some(number as f64 * 1e-9)
}

/// Bytes of the files of a folder.
pub(crate) fn bytes(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .filter_map(|entry| entry.metadata().ok())
        .map(|file| file.len())
        .sum()
}

/// Recordings that are kept no longer, at an instant (s since 1970): those that ended too long ago, and the oldest of too much.
pub(crate) fn outdated<'a>(
    all: &'a [Finished],
    settings: &RecorderSection,
    now: f64,
) -> Vec<&'a Finished> {
    let mut kept: f64 = all.iter().map(|one| one.bytes as f64).sum();
    let most = settings
        .keep_gib
        .map_or(f64::INFINITY, |gib| gib * f64::from(1 << 30));
    let longest = settings.keep_days.map_or(f64::INFINITY, |days| days * DAY);
    all.iter()
        .filter(|one| {
            let goes = now - one.ended() > longest || kept > most;
            if goes {
                kept -= one.bytes as f64;
            }
            goes
        })
        .collect()
}

/// Removes a recording: its files, then its folder. What is not a file of a recording stays, and with it the folder.
pub(crate) fn remove(one: &Finished) -> std::io::Result<()> {
    let entries: Vec<_> = fs::read_dir(&one.path)?.collect::<Result<_, _>>()?;
    let strange = entries.iter().find(|entry| {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let known = name == "metadata.yaml" || name == "seals.txt" || name.ends_with(".mcap");
        !known || !entry.file_type().is_ok_and(|kind| kind.is_file())
    });
    if let Some(strange) = strange {
        return Err(std::io::Error::other(format!(
            "{} is no file of a recording",
            strange.path().display()
        )));
    }
    // The metadata first: a folder that is left half removed is none that was closed.
    fs::remove_file(one.path.join("metadata.yaml"))?;
    for entry in entries
        .iter()
        .filter(|entry| entry.file_name() != "metadata.yaml")
    {
        fs::remove_file(entry.path())?;
    }
    fs::remove_dir(&one.path)
}

/// How long a disk lasts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Forecast {
    /// Bytes that the user may still write.
    pub(crate) free: u64,
    /// Bytes that a second of recording takes; none: nothing was recorded yet.
    pub(crate) rate: Option<f64>,
}

impl Forecast {
    /// Of a folder, by what the newest recordings have taken.
    pub(crate) fn of(folder: &Path, all: &[Finished]) -> Option<Self> {
        let newest = all.iter().rev().take(RATED);
        let (bytes, seconds) = newest.fold((0.0, 0.0), |(bytes, seconds), one| {
            (bytes + one.bytes as f64, seconds + one.seconds)
        });
        Some(Self {
            free: free(folder)?,
            rate: (seconds > 0.0 && bytes > 0.0).then(|| bytes / seconds),
        })
    }

    /// s of recording for which there is room.
    pub(crate) fn seconds(&self) -> Option<f64> {
        self.rate.map(|rate| self.free as f64 / rate)
    }
}

impl fmt::Display for Forecast {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} free", size(self.free as f64))?;
        match (self.seconds(), self.rate) {
            (Some(seconds), Some(rate)) => write!(
                out,
                ", room for {} of recording at {} an hour",
                span(seconds),
                size(rate * 3600.0)
            ),
            _ => Ok(()),
        }
    }
}

/// Bytes that the user may still write to the disk of a folder.
fn free(folder: &Path) -> Option<u64> {
    let known = rustix::fs::statvfs(folder).ok()?;
    Some(known.f_bavail.saturating_mul(known.f_frsize))
}

fn size(bytes: f64) -> String {
    match bytes {
        b if b < 1e6 => format!("{:.0} kB", b / 1e3),
        b if b < 1e9 => format!("{:.0} MB", b / 1e6),
        b => format!("{:.1} GB", b / 1e9),
    }
}

fn span(seconds: f64) -> String {
    match seconds {
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s if s < 2.0 * DAY => format!("{:.0} h", s / 3600.0),
        s => format!("{:.0} days", s / DAY),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(folder: &Path, name: &str, bytes: usize, seconds: u64) {
        let path = folder.join(name);
        fs::create_dir(&path).expect("a folder");
        fs::write(path.join(format!("{name}_0.mcap")), vec![0; bytes]).expect("a file");
        let text = format!(
            "rosbag2_bagfile_information:\n  version: 9\n  duration:\n    nanoseconds: {}\n",
            seconds * 1_000_000_000
        );
        fs::write(path.join("metadata.yaml"), text).expect("a file");
    }

    fn cell(folder: &Path) -> Cell {
        let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../launch-scripts");
        let mut cell = Cell::read(&scripts.join("turn_mill.toml")).expect("a cell");
        cell.recorder.folder = folder.to_owned();
        cell
    }

    fn names(all: &[&Finished]) -> Vec<String> {
        let name = |one: &&Finished| {
            one.path
                .file_name()
                .map(|name| name.to_string_lossy().into_owned())
        };
        all.iter().filter_map(name).collect()
    }

    #[test]
    fn what_is_too_old_or_too_much_goes_the_oldest_first() {
        let folder = tempfile::tempdir().expect("a folder");
        let day_ms = 86_400_000_u64;
        for (day, bytes) in [(10, 1000), (12, 2000), (30, 3000)] {
            recording(
                folder.path(),
                &format!("turn_mill_{}", day * day_ms),
                bytes,
                100,
            );
        }
        // Not of this cell's own names, not closed, and a link: none of them is taken for one.
        recording(folder.path(), "turn_mill_acceptance", 10, 1);
        fs::create_dir(folder.path().join("turn_mill_5")).expect("a folder");
        std::os::unix::fs::symlink("/tmp", folder.path().join("turn_mill_6")).expect("a link");
        let cell = cell(folder.path());
        let all = finished(&cell);
        assert_eq!(all.len(), 3, "{all:?}");

        let now = 31.0 * DAY;
        let kept = |days, gib| RecorderSection {
            keep_days: days,
            keep_gib: gib,
            ..RecorderSection::default()
        };
        assert!(outdated(&all, &kept(None, None), now).is_empty());
        let old = names(&outdated(&all, &kept(Some(20.0), None), now));
        assert_eq!(old, [format!("turn_mill_{}", 10 * day_ms)]);
        // 6 kB and a little of metadata: of at most 5.5 kB one has to go, of 4 kB two.
        let gib = |kilobytes: f64| Some(kilobytes * 1e3 / f64::from(1 << 30));
        assert_eq!(outdated(&all, &kept(None, gib(5.6)), now).len(), 1);
        assert_eq!(outdated(&all, &kept(None, gib(4.0)), now).len(), 2);
    }

    #[test]
    fn a_recording_goes_whole_and_a_strange_file_keeps_it() {
        let folder = tempfile::tempdir().expect("a folder");
        recording(folder.path(), "turn_mill_1", 10, 1);
        recording(folder.path(), "turn_mill_2", 10, 1);
        fs::write(folder.path().join("turn_mill_2/notes.txt"), "look at this").expect("a file");
        let cell = cell(folder.path());
        let all = finished(&cell);
        remove(&all[0]).expect("removed");
        let refused = remove(&all[1]).expect_err("it holds notes").to_string();
        assert!(refused.contains("notes.txt"), "{refused}");
        assert_eq!(finished(&cell), all[1..]);
    }

    #[test]
    fn the_forecast_is_what_is_free_over_what_a_second_takes() {
        let folder = tempfile::tempdir().expect("a folder");
        recording(folder.path(), "turn_mill_1000", 1_000_000, 10);
        let all = finished(&cell(folder.path()));
        let forecast = Forecast::of(folder.path(), &all).expect("a disk");
        let rate = forecast.rate.expect("a rate");
        assert!((1.0e5..1.01e5).contains(&rate), "{rate}");
        let seconds = forecast.seconds().expect("room");
        assert!((seconds * rate / forecast.free as f64 - 1.0).abs() < 1e-12);
        let text = Forecast {
            free: 36_000_000_000,
            rate: Some(1e5),
        }
        .to_string();
        assert_eq!(
            text,
            "36.0 GB free, room for 4 days of recording at 360 MB an hour"
        );
    }
}
