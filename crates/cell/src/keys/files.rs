//! The files of keys.

use std::{
    fs::{self, OpenOptions},
    io::{self, Write as _},
    os::unix::fs::{DirBuilderExt as _, MetadataExt as _, OpenOptionsExt as _},
    path::{Path, PathBuf},
    str::FromStr,
    sync::atomic::{AtomicU64, Ordering},
};

use signatures::{KeyError as NotAKey, PublicKey, SecretKey};

use super::operators::{Operators, OperatorsError};
use crate::Cell;

/// Permissions of files and folders of private keys.
const PRIVATE_FILE: u32 = 0o600;
const PRIVATE_FOLDER: u32 = 0o700;
/// Longest name of an operator, in bytes.
const NAME_LIMIT: usize = 64;

/// Files that this process has begun beside others: each has a name of its own.
static WRITTEN: AtomicU64 = AtomicU64::new(0);

/// Why a key cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// The user has no folder.
    #[error(
        "there is no folder for keys: neither HOME nor XDG_CONFIG_HOME is set; name one by [approvals] key_folder"
    )]
    NoHome,
    /// A file cannot be read or written.
    #[error("cannot {what} {path}: {source}")]
    File {
        /// What was tried.
        what: &'static str,
        /// Where.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// Others can read a private key.
    #[error(
        "the private key {path} can be read or written by others: chmod 600 it, or make another"
    )]
    Exposed {
        /// The file.
        path: PathBuf,
    },
    /// Others can write who the operators are.
    #[error("{path} can be written by others, who could make themselves operators: chmod o-w it")]
    Writable {
        /// The file, or its folder.
        path: PathBuf,
    },
    /// The file holds something else.
    #[error("{path} does not contain a key: {source}")]
    NotAKey {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: NotAKey,
    },
    /// The operator has no private key here.
    #[error("operator {name:?} has no key of this user: probecell key new {name} --cell CELL.toml")]
    NoOperatorKey {
        /// Of the operator.
        name: String,
    },
    /// The operator has a private key already.
    #[error(
        "{path} exists: `probecell key add {name} {key}` registers it for a further cell; to make another key, withdraw this one \
         (probecell key revoke) and remove the file"
    )]
    Exists {
        /// The file.
        path: PathBuf,
        /// Of the operator.
        name: String,
        /// Its public half, as [`PublicKey`] is written.
        key: String,
    },
    /// A name that is no file name.
    #[error(
        "{0:?} is not a valid name of an operator: up to 64 letters, digits, dots, dashes and underscores, no dot first"
    )]
    Name(String),
    /// The list of operators is wrong.
    #[error("{path}: {source}")]
    Operators {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: OperatorsError,
    },
}

/// The folder of a cell's keys.
#[derive(Clone, Debug)]
pub struct KeyFolder(PathBuf);

impl KeyFolder {
    /// That of a cell, which need not exist yet.
    ///
    /// # Errors
    /// No home folder, and none named in the cell file.
    pub fn of(cell: &Cell) -> Result<Self, KeyError> {
        if let Some(folder) = &cell.approvals.key_folder {
            return Ok(Self(folder.clone()));
        }
        Ok(Self(user_folder()?.join("cells").join(&cell.cell.name)))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// The private key of the cell, made if there is none.
    ///
    /// # Errors
    /// A key that others can read, that is none, or that cannot be made.
    pub fn private(&self) -> Result<SecretKey, KeyError> {
        let path = self.0.join("cell.key");
        if !path.exists() {
            let key = new_key(&path)?;
            // Another process may have made it meanwhile: then that one counts.
            keep_first(&path, &key.to_text())?;
        }
        let key = read_private(&path)?;
        let public = self.0.join("cell.pub");
        if fs::read_to_string(&public).ok().as_deref() != Some(&line(&key.public())) {
            replace(&public, &line(&key.public()))?;
        }
        Ok(key)
    }

    /// What a process that joins the bus reads here: the public key of the cell, and the passwords of a secured bus.
    pub fn files_of_bus(&self) -> [PathBuf; 2] {
        [self.0.join("cell.pub"), self.0.join("bus")]
    }

    /// The public key of the cell is there.
    pub fn is_public_there(&self) -> bool {
        self.0.join("cell.pub").exists()
    }

    /// The public key of the cell; its keys are made if there are none.
    ///
    /// # Errors
    /// As of [`Self::private`].
    pub fn public(&self) -> Result<PublicKey, KeyError> {
        let path = self.0.join("cell.pub");
        match fs::read_to_string(&path) {
            Ok(text) => parsed(&path, &text),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(self.private()?.public()),
            Err(source) => Err(file("read", &path, source)),
        }
    }

    /// The operators of the cell.
    ///
    /// # Errors
    /// A file that cannot be read, or that holds no keys.
    pub fn operators(&self) -> Result<Operators, KeyError> {
        let path = self.0.join("operators.toml");
        match fs::read_to_string(&path) {
            Ok(text) => {
                refuse_writable(&path)?;
                refuse_writable(&self.0)?;
                Operators::from_toml(&text).map_err(|source| KeyError::Operators { path, source })
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Operators::default()),
            Err(source) => Err(file("read", &path, source)),
        }
    }

    /// Registers the key of an operator, whose earlier keys stay as they are.
    ///
    /// # Errors
    /// A name that is not valid, a key that is registered already, or a file that cannot be written.
    pub fn register(&self, name: &str, key: PublicKey) -> Result<(), KeyError> {
        checked(name)?;
        self.change(|operators| operators.register(name, key))
    }

    /// Withdraws every key of an operator.
    ///
    /// # Errors
    /// No key of that name, or a file that cannot be written.
    pub fn withdraw(&self, name: &str) -> Result<(), KeyError> {
        self.change(|operators| operators.withdraw(name))
    }

    fn change(
        &self,
        change: impl FnOnce(&mut Operators) -> Result<(), OperatorsError>,
    ) -> Result<(), KeyError> {
        let path = self.0.join("operators.toml");
        let mut operators = self.operators()?;
        change(&mut operators).map_err(|source| KeyError::Operators {
            path: path.clone(),
            source,
        })?;
        make_folder(&self.0)?;
        replace(&path, &operators.to_toml())
    }
}

/// The private key of an operator who works as this user.
///
/// # Errors
/// No key of that name, or one that others can read.
pub fn operator_key(name: &str) -> Result<SecretKey, KeyError> {
    let path = operator_file(name)?;
    if !path.exists() {
        let name = name.to_owned();
        return Err(KeyError::NoOperatorKey { name });
    }
    read_private(&path)
}

/// Makes the private key of an operator; gives its file, too.
///
/// # Errors
/// A key of that name that exists already, or a file that cannot be written.
pub fn new_operator_key(name: &str) -> Result<(SecretKey, PathBuf), KeyError> {
    let path = operator_file(name)?;
    let key = new_key(&path)?;
    if keep_first(&path, &key.to_text())? {
        Ok((key, path))
    } else {
        let key = read_private(&path)?.public().to_string();
        let name = name.to_owned();
        Err(KeyError::Exists { path, name, key })
    }
}

fn operator_file(name: &str) -> Result<PathBuf, KeyError> {
    checked(name)?;
    Ok(user_folder()?.join("operators").join(format!("{name}.key")))
}

/// A name that can be one of a file, and that a terminal shows as it is.
fn checked(name: &str) -> Result<(), KeyError> {
    let allowed = |letter: char| letter.is_alphanumeric() || "._-".contains(letter);
    let good = !name.is_empty()
        && name.len() <= NAME_LIMIT
        && !name.starts_with('.')
        && name.chars().all(allowed);
    good.then_some(())
        .ok_or_else(|| KeyError::Name(name.to_owned()))
}

/// `probecell` in the user's configuration folder (XDG Base Directory Specification 0.8).
fn user_folder() -> Result<PathBuf, KeyError> {
    let absolute = |name| {
        std::env::var_os(name)
            .map(PathBuf::from)
            .filter(|path| path.is_absolute())
    };
    let home = || absolute("HOME").map(|home| home.join(".config"));
    let folder = absolute("XDG_CONFIG_HOME").or_else(home);
    Ok(folder.ok_or(KeyError::NoHome)?.join("probecell"))
}

/// A new key, and the folder of its file.
fn new_key(path: &Path) -> Result<SecretKey, KeyError> {
    let seed = seed(path)?;
    make_folder(path.parent().unwrap_or(Path::new("")))?;
    Ok(SecretKey::from_seed(seed))
}

pub(super) fn make_folder(path: &Path) -> Result<(), KeyError> {
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true).mode(PRIVATE_FOLDER);
    builder
        .create(path)
        .map_err(|source| file("make", path, source))
}

/// Writes a file that nobody has written yet, whole or not at all. False where somebody has.
fn keep_first(path: &Path, text: &str) -> Result<bool, KeyError> {
    let written = written_beside(path, text)?;
    let linked = fs::hard_link(&written, path);
    fs::remove_file(&written).map_err(|source| file("remove", &written, source))?;
    match linked {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
        Err(source) => Err(file("write", path, source)),
    }
}

/// Replaces a file, whole or not at all.
pub(super) fn replace(path: &Path, text: &str) -> Result<(), KeyError> {
    let written = written_beside(path, text)?;
    fs::rename(&written, path).map_err(|source| file("write", path, source))
}

/// A file of this process beside another, readable by its owner only.
fn written_beside(path: &Path, text: &str) -> Result<PathBuf, KeyError> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    let number = WRITTEN.fetch_add(1, Ordering::Relaxed);
    name.push(format!(".{}.{number}", std::process::id()));
    let beside = path.with_file_name(name);
    let mut options = OpenOptions::new();
    options
        .write(true)
        .create(true)
        .truncate(true)
        .mode(PRIVATE_FILE);
    let write = || {
        let mut file = options.open(&beside)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()
    };
    write().map_err(|source| file("write", &beside, source))?;
    Ok(beside)
}

/// Refuses what everybody can write, a folder unless its sticky bit keeps its files (as ssh does with `StrictModes`).
fn refuse_writable(path: &Path) -> Result<(), KeyError> {
    let mode = (fs::metadata(path).map_err(|source| file("read", path, source))?).mode();
    if mode & 0o002 != 0 && mode & 0o1000 == 0 {
        let path = path.to_owned();
        return Err(KeyError::Writable { path });
    }
    Ok(())
}

fn read_private(path: &Path) -> Result<SecretKey, KeyError> {
    parsed(path, &read_private_text(path)?)
}

/// A file that only its owner can read.
pub(super) fn read_private_text(path: &Path) -> Result<String, KeyError> {
    let text = fs::read_to_string(path).map_err(|source| file("read", path, source))?;
    let metadata = fs::metadata(path).map_err(|source| file("read", path, source))?;
    if metadata.mode() & 0o077 != 0 {
        let path = path.to_owned();
        return Err(KeyError::Exposed { path });
    }
    Ok(text)
}

/// 256 random bits in hexadecimal digits.
pub(super) fn random() -> Result<String, KeyError> {
    Ok(SecretKey::from_seed(seed(Path::new("a password"))?).to_text())
}

fn seed(path: &Path) -> Result<[u8; 32], KeyError> {
    let mut seed = [0; 32];
    getrandom::fill(&mut seed).map_err(|error| {
        file(
            "draw a random number for",
            path,
            io::Error::other(error.to_string()),
        )
    })?;
    Ok(seed)
}

fn parsed<K: FromStr<Err = NotAKey>>(path: &Path, text: &str) -> Result<K, KeyError> {
    text.parse().map_err(|source| KeyError::NotAKey {
        path: path.to_owned(),
        source,
    })
}

fn line(key: &PublicKey) -> String {
    format!("{key}\n")
}

pub(super) fn file(what: &'static str, path: &Path, source: io::Error) -> KeyError {
    KeyError::File {
        what,
        path: path.to_owned(),
        source,
    }
}
