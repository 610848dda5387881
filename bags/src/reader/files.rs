//! Which files make up a recording.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::container::{Contents, foreign};
use crate::damage::{Damage, DamageKind};
use crate::error::Error;
use crate::metadata;

/// Recordings of a folder that a sentence names.
const MOST_NAMED: usize = 20;

/// A pause between parts that is always believed, ns: topics may be silent for a minute.
const LEAST_PAUSE_NS: u64 = 60_000_000_000;

/// Longest `metadata.yaml` that is read, bytes: some 100,000 files.
const LONGEST: u64 = 16 << 20;

/// The text of a regular file that is not too long; a pipe may never end.
fn read_regular(path: &Path) -> Option<String> {
    let known = std::fs::metadata(path).ok()?;
    let is_read = known.is_file() && known.len() <= LONGEST;
    is_read.then(|| std::fs::read_to_string(path).ok())?
}

/// The files of a recording in reading order, and those that `metadata.yaml` names and that are gone.
///
/// `metadata.yaml` gives the order; other files of the folder (of a recorder that was killed) follow, and
/// without it all `.mcap` files are taken, ordered by the number at the end of their names.
pub(super) fn of(path: &Path) -> Result<(Vec<PathBuf>, Vec<Damage>), Error> {
    let failed = |source| Error::io("read the recording", path, source);
    let kind = std::fs::metadata(path).map_err(failed)?.file_type();
    if kind.is_file() {
        return Ok((vec![path.to_owned()], Vec::new()));
    }
    if !kind.is_dir() {
        let source = std::io::Error::new(
            std::io::ErrorKind::InvalidInput,
            "neither a file nor a folder",
        );
        return Err(failed(source));
    }
    let mut present = Vec::new();
    let mut others = Vec::new();
    for entry in std::fs::read_dir(path).map_err(failed)? {
        let file = entry.map_err(failed)?.path();
        // Opening a pipe or a device may never end.
        let regular = std::fs::metadata(&file).is_ok_and(|known| known.is_file());
        let named = file
            .extension()
            .is_some_and(|extension| extension == "mcap");
        if named && regular {
            present.push(file);
        } else {
            others.push(file);
        }
    }
    others.sort();
    present.sort_by_key(|file| numbered(file));
    let named = path.join(metadata::FILE_NAME);
    let named = others.contains(&named).then(|| read_regular(&named));
    let named = named.flatten();
    let named = named
        .and_then(|text| metadata::read(&text))
        .unwrap_or_default();
    if let Some(format) = named.compressed_messages {
        return Err(Error::CompressedMessages {
            format,
            path: path.to_owned(),
        });
    }
    let mut files: Vec<PathBuf> = Vec::new();
    let mut missing = Vec::new();
    // A file that is named again is read once.
    let mut known = BTreeSet::new();
    for name in named.relative_file_paths {
        // Old recorders wrote the folder's name in front; only the file's own name is looked for in the folder.
        let Some(name) = Path::new(&name).file_name() else {
            continue;
        };
        let mut file = path.join(name);
        if !known.insert(file.clone()) {
            continue;
        }
        if let Some(error) = foreign::of(&file) {
            return Err(error);
        }
        // A file that was compressed when it was named, and has been unpacked since.
        if !present.contains(&file) && present.contains(&file.with_extension("")) {
            file.set_extension("");
        }
        if present.contains(&file) {
            files.push(file);
        } else {
            missing.push(Damage {
                file,
                offset: 0,
                length: 0,
                kind: DamageKind::MissingFile,
            });
        }
    }
    let rest: Vec<PathBuf> = present
        .into_iter()
        .filter(|file| !files.contains(file))
        .collect();
    files.extend(rest);
    if files.is_empty() {
        if let Some(error) = others.iter().find_map(|file| foreign::of(file)) {
            return Err(error);
        }
        let mut recordings: Vec<String> = others
            .iter()
            .filter(|folder| folder.join(metadata::FILE_NAME).is_file())
            .filter_map(|folder| Some(folder.file_name()?.to_string_lossy().into_owned()))
            .collect();
        if !recordings.is_empty() {
            let more = recordings.len().saturating_sub(MOST_NAMED);
            recordings.truncate(MOST_NAMED);
            return Err(Error::SeveralRecordings {
                count: recordings.len() + more,
                recordings,
                path: path.to_owned(),
            });
        }
        return Err(Error::NoRecording {
            path: path.to_owned(),
        });
    }
    Ok((files, missing))
}

/// Fails where the files of a folder without `metadata.yaml` are not the numbered parts of one recording.
///
/// A recorder begins the next part where the last one ends. Files that bear one name with numbers are taken for parts of
/// one recording unless more time lies between two of them than they hold.
pub(super) fn are_of_one_recording(folder: &Path, files: &[Contents]) -> Result<(), Error> {
    if files.len() < 2 || folder.join(metadata::FILE_NAME).exists() {
        return Ok(());
    }
    let names: BTreeSet<String> = files.iter().map(|file| numbered(&file.path).0).collect();
    let bounds: Vec<(u64, u64)> = files.iter().filter_map(Contents::bounds).collect();
    let held: u64 = bounds
        .iter()
        .map(|(start, end)| end.saturating_sub(*start))
        .sum();
    let pause = bounds
        .windows(2)
        .map(|pair| pair[1].0.saturating_sub(pair[0].1))
        .max();
    if names.len() == 1 && pause.is_none_or(|pause| pause <= held.max(LEAST_PAUSE_NS)) {
        return Ok(());
    }
    let recordings = files
        .iter()
        .take(MOST_NAMED)
        .map(|file| {
            let messages: u64 = file.counts.values().sum();
            let name = file.path.file_name().unwrap_or_default();
            format!("{} with {messages} messages", name.to_string_lossy())
        })
        .collect();
    Err(Error::SeveralRecordings {
        count: files.len(),
        recordings,
        path: folder.to_owned(),
    })
}

/// Name without its trailing number, the number, the whole name.
fn numbered(path: &Path) -> (String, u64, PathBuf) {
    let stem = path
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let name = stem.trim_end_matches(|character: char| character.is_ascii_digit());
    let number = stem[name.len()..].parse().unwrap_or(0);
    (name.to_owned(), number, path.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tenth_split_follows_the_ninth() {
        let folder = tempfile::tempdir().unwrap();
        for number in [10, 9, 0, 1] {
            std::fs::write(folder.path().join(format!("run_{number}.mcap")), b"").unwrap();
        }
        let (files, missing) = of(folder.path()).unwrap();
        let names: Vec<_> = files
            .iter()
            .map(|file| file.file_name().unwrap().to_str().unwrap())
            .collect();
        assert_eq!(
            names,
            ["run_0.mcap", "run_1.mcap", "run_9.mcap", "run_10.mcap"]
        );
        assert!(missing.is_empty());
    }
}
