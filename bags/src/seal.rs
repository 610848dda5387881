//! Seals: signed digests of what a recorder has written, so that a later change is found.
//!
//! Whenever the recorder has synced a file, it adds a line to `seals.txt` in the folder of the recording: the signature in
//! hexadecimal digits, a space, and a [`Seal`] in JSON, which is what is signed. A seal holds the SHA-256 digest (FIPS
//! 180-4) of the file up to there, and that of the line before: the lines are a chain, whose head is the last one. A file
//! of a recording only grows, so each seal stays true. The last one says that the recording ended; without it, the recorder
//! was killed, or something was cut off.
//!
//! Keys are not known here: who signs and who verifies passes a function.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Debug, Formatter};
use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::disk::{Disk, Stream};
use crate::error::Error;

/// Name of the file of seals.
pub(crate) const FILE_NAME: &str = "seals.txt";

/// Signs seals.
#[derive(Clone)]
pub struct Sealer(Arc<Sign>);

/// From the bytes of a seal to their signature.
type Sign = dyn Fn(&[u8]) -> Vec<u8> + Send + Sync;

/// Length of a file, and the SHA-256 digest of so much of it.
pub(crate) type Digested = (u64, String);

impl Sealer {
    /// By a function from the bytes of a seal to their signature.
    pub fn new(sign: impl Fn(&[u8]) -> Vec<u8> + Send + Sync + 'static) -> Self {
        Self(Arc::new(sign))
    }
}

impl Debug for Sealer {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str("Sealer")
    }
}

/// What is signed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Seal {
    /// From 0.
    number: u64,
    /// SHA-256 of the line before, hexadecimal; of nothing for the first.
    previous: String,
    /// Name of the file.
    file: String,
    /// Its length so far.
    bytes: u64,
    /// SHA-256 of so much of it, hexadecimal.
    sha256: String,
    /// The file is finished.
    whole: bool,
    /// The recording has ended.
    last: bool,
}

/// How far the recorder has come with a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reach {
    /// It continues.
    Prefix,
    /// The file is finished.
    Whole,
    /// So is the recording.
    Last,
}

/// Adds seals to a recording.
pub(crate) struct Seals {
    path: PathBuf,
    file: Stream,
    sealer: Sealer,
    number: u64,
    previous: String,
}

impl Seals {
    pub(crate) fn create(disk: &dyn Disk, folder: &Path, sealer: Sealer) -> Result<Self, Error> {
        let path = folder.join(FILE_NAME);
        let file = disk.create(&path, true).map(Stream::new);
        Ok(Self {
            file: file.map_err(|source| Error::io("create the seals", &path, source))?,
            path,
            sealer,
            number: 0,
            previous: hexadecimal(&Sha256::digest([])),
        })
    }

    /// Adds a seal; `sha256` is the digest of the first `bytes` of the file.
    pub(crate) fn add(
        &mut self,
        file: &str,
        (bytes, sha256): Digested,
        reach: Reach,
    ) -> Result<(), Error> {
        let seal = Seal {
            number: self.number,
            previous: self.previous.clone(),
            file: file.to_owned(),
            bytes,
            sha256,
            whole: reach != Reach::Prefix,
            last: reach == Reach::Last,
        };
        // Numbers, digits and a name: JSON holds them all.
        let signed = serde_json::to_vec(&seal).unwrap_or_default();
        let mut line = hexadecimal(&(self.sealer.0)(&signed)).into_bytes();
        line.push(b' ');
        line.extend_from_slice(&signed);
        self.previous = hexadecimal(&Sha256::digest(&line));
        self.number += 1;
        line.push(b'\n');
        let failed = |source| Error::io("write the seals", &self.path, source);
        self.file.write_all(&line).map_err(failed)?;
        if reach == Reach::Last {
            self.file.sync().map_err(failed)?;
        }
        Ok(())
    }

    /// Seals a finished file of the folder, which is read for it.
    pub(crate) fn add_file(&mut self, name: &str, reach: Reach) -> Result<(), Error> {
        let path = self.path.with_file_name(name);
        let content =
            std::fs::read(&path).map_err(|source| Error::io("read back", &path, source))?;
        let digest = hexadecimal(&Sha256::digest(&content));
        self.add(name, (content.len() as u64, digest), reach)
    }
}

/// What the seals of a recording say.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Sealed {
    /// Seals that are in order.
    pub seals: u64,
    /// The recorder ended the recording and sealed it whole. Otherwise it was killed, or the end was cut off.
    pub ended: bool,
    /// Bytes at the end of each file that no seal covers.
    pub unsealed: BTreeMap<String, u64>,
    /// What was changed after it was sealed, a sentence each.
    pub changes: Vec<String>,
}

/// Compares a recording with its seals; `None` where it has none. `is_signed` says whether a signature (second) is that of
/// the recorder on these bytes (first).
///
/// # Errors
/// What the system says of a file; a seal that does not hold is a result, not an error.
pub fn verify(
    folder: &Path,
    is_signed: &dyn Fn(&[u8], &[u8]) -> bool,
) -> Result<Option<Sealed>, Error> {
    let path = folder.join(FILE_NAME);
    let text = match std::fs::read(&path) {
        Ok(text) => text,
        Err(source) if [ErrorKind::NotFound, ErrorKind::NotADirectory].contains(&source.kind()) => {
            return Ok(None);
        }
        Err(source) => return Err(Error::io("read the seals", &path, source)),
    };
    let mut sealed = Sealed::default();
    let seals = chain(&text, is_signed, &mut sealed);
    let mut files: BTreeMap<&str, Vec<&Seal>> = BTreeMap::new();
    for seal in &seals {
        files.entry(&seal.file).or_default().push(seal);
    }
    let entries = std::fs::read_dir(folder).map_err(|source| Error::io("read", folder, source))?;
    let present: BTreeSet<String> = entries
        .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
        .collect();
    for name in &present {
        let is_bag = Path::new(name).extension().is_some_and(|end| end == "mcap")
            || name == crate::metadata::FILE_NAME;
        if is_bag && !files.contains_key(name.as_str()) {
            let bytes = std::fs::metadata(folder.join(name)).map_or(0, |file| file.len());
            sealed.unsealed.insert(name.clone(), bytes);
        }
    }
    for (name, seals) in files {
        compare(folder, name, &seals, &mut sealed)?;
    }
    if sealed.ended {
        // Nothing is written after the end.
        let late = std::mem::take(&mut sealed.unsealed);
        let says = |(name, bytes)| {
            format!("{name}: {bytes} bytes were added after the recording had ended")
        };
        sealed.changes.extend(late.into_iter().map(says));
    }
    Ok(Some(sealed))
}

/// The seals up to the first that is not in order.
fn chain(text: &[u8], is_signed: &dyn Fn(&[u8], &[u8]) -> bool, sealed: &mut Sealed) -> Vec<Seal> {
    let mut seals = Vec::new();
    let mut previous = hexadecimal(&Sha256::digest([]));
    // What follows the last line feed was being written when the recorder was killed.
    let end = text
        .iter()
        .rposition(|byte| *byte == b'\n')
        .map_or(0, |at| at + 1);
    for line in text[..end].split_inclusive(|byte| *byte == b'\n') {
        let line = &line[..line.len() - 1];
        let number = sealed.seals;
        let read = || {
            let at = line.iter().position(|byte| *byte == b' ')?;
            let (signature, signed) = (bytes(&line[..at])?, &line[at + 1..]);
            let seal: Seal = serde_json::from_slice(signed).ok()?;
            let follows = seal.number == number && seal.previous == previous;
            (follows && is_signed(signed, &signature)).then_some(seal)
        };
        let Some(seal) = read().filter(|_| !sealed.ended) else {
            let text = format!("{FILE_NAME}: seal {number} is not the one that was written there");
            sealed.changes.push(text);
            break;
        };
        previous = hexadecimal(&Sha256::digest(line));
        sealed.seals += 1;
        sealed.ended = seal.last;
        seals.push(seal);
    }
    if end < text.len() && sealed.ended {
        sealed
            .changes
            .push(format!("{FILE_NAME}: bytes were added after the last seal"));
    }
    seals
}

/// Compares one file with its seals, which are in order.
fn compare(folder: &Path, name: &str, seals: &[&Seal], sealed: &mut Sealed) -> Result<(), Error> {
    let path = folder.join(name);
    let failed = |source| Error::io("read", &path, source);
    let mut file = match File::open(&path) {
        Ok(file) => file,
        Err(source) if source.kind() == ErrorKind::NotFound => {
            sealed.changes.push(format!("{name} is gone"));
            return Ok(());
        }
        Err(source) => return Err(failed(source)),
    };
    let mut digest = Sha256::new();
    let mut at = 0;
    let mut buffer = vec![0; 1 << 16];
    for seal in seals {
        let from = at;
        while at < seal.bytes {
            let room = (seal.bytes - at).min(buffer.len() as u64) as usize;
            let count = file.read(&mut buffer[..room]).map_err(failed)?;
            if count == 0 {
                let cut = format!(
                    "{name} ends at byte {at}, but was sealed up to byte {}",
                    seal.bytes
                );
                sealed.changes.push(cut);
                return Ok(());
            }
            digest.update(&buffer[..count]);
            at += count as u64;
        }
        if hexadecimal(&digest.clone().finalize()) != seal.sha256 {
            let changed = format!(
                "{name} was changed between byte {from} and byte {}",
                seal.bytes
            );
            sealed.changes.push(changed);
            return Ok(());
        }
    }
    let length = file.metadata().map_err(failed)?.len();
    if length > at {
        if seals.iter().any(|seal| seal.whole) {
            let added = format!("{name}: {} bytes were added to it", length - at);
            sealed.changes.push(added);
        } else {
            sealed.unsealed.insert(name.to_owned(), length - at);
        }
    }
    Ok(())
}

/// Lower-case hexadecimal digits.
pub(crate) fn hexadecimal(bytes: &[u8]) -> String {
    let digit = |value: u8| char::from_digit(value.into(), 16).unwrap_or_default();
    (bytes.iter())
        .flat_map(|byte| [digit(byte >> 4), digit(byte & 15)])
        .collect()
}

fn bytes(digits: &[u8]) -> Option<Vec<u8>> {
    let digit = |byte: &u8| match byte {
        b'0'..=b'9' => Some(byte - b'0'),
        b'a'..=b'f' => Some(byte - b'a' + 10),
        _ => None,
    };
    let (pairs, rest) = digits.as_chunks::<2>();
    let read = |[high, low]: &[u8; 2]| Some(digit(high)? << 4 | digit(low)?);
    rest.is_empty().then(|| pairs.iter().map(read).collect())?
}
