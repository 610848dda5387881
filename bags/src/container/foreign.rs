//! Recordings in another form than MCAP, known by their first bytes: what they are, and the command that makes an MCAP file of them.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use crate::error::Error;

/// First bytes, what such a file is, and the command before the two file names, with what stands between them.
const FORMS: [(&[u8], &str, [&str; 2]); 3] = [
    (
        &[0x28, 0xb5, 0x2f, 0xfd],
        "is compressed as a whole by zstd (rosbag2's compression mode FILE)",
        ["zstd -d", "-o"],
    ),
    (
        b"SQLite format 3\0",
        "is a recording of rosbag2 in sqlite3",
        ["mcap convert", ""],
    ),
    (
        b"#ROSBAG V2.0",
        "is a recording of ROS 1",
        ["mcap convert", ""],
    ),
];

/// Why a file that does not begin as MCAP does is not read.
pub(crate) fn error(path: &Path) -> Error {
    of(path).unwrap_or_else(|| Error::NotMcap {
        path: path.to_owned(),
    })
}

/// The error that names the form of a file, if it is one of these.
pub(crate) fn of(path: &Path) -> Option<Error> {
    // Devices and pipes are not opened: reading one may never end.
    if !std::fs::metadata(path).ok()?.is_file() {
        return None;
    }
    let mut first = Vec::new();
    File::open(path)
        .ok()?
        .take(16)
        .read_to_end(&mut first)
        .ok()?;
    let (_, what, [command, between]) =
        FORMS.iter().find(|(magic, ..)| first.starts_with(magic))?;
    let from = path.display().to_string();
    let stem = path.with_extension("");
    let to = if stem
        .extension()
        .is_some_and(|extension| extension == "mcap")
    {
        stem
    } else {
        path.with_extension("mcap")
    };
    let to = to.display().to_string();
    let words = [*command, &from, *between, &to];
    let words: Vec<&str> = words.into_iter().filter(|word| !word.is_empty()).collect();
    Some(Error::OtherForm {
        what,
        command: words.join(" "),
        path: path.to_owned(),
    })
}
