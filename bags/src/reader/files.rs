//! Which files make up a recording.

use std::path::{Path, PathBuf};

use crate::damage::{Damage, DamageKind};
use crate::error::Error;
use crate::metadata;

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
    for entry in std::fs::read_dir(path).map_err(failed)? {
        let file = entry.map_err(failed)?.path();
        if file
            .extension()
            .is_some_and(|extension| extension == "mcap")
        {
            present.push(file);
        }
    }
    present.sort_by_key(|file| numbered(file));
    let named = std::fs::read_to_string(path.join(metadata::FILE_NAME)).ok();
    let named = named
        .and_then(|text| metadata::relative_file_paths(&text))
        .unwrap_or_default();
    let mut files: Vec<PathBuf> = Vec::new();
    let mut missing = Vec::new();
    for name in named {
        // Old recorders wrote the folder's name in front; only the file's own name is looked for in the folder.
        let Some(name) = Path::new(&name).file_name() else {
            continue;
        };
        let file = path.join(name);
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
        return Err(Error::NoRecording {
            path: path.to_owned(),
        });
    }
    Ok((files, missing))
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
