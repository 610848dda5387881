//! The sandbox of a cell's processes: access to files, sockets and other processes, restricted by the kernel before a process reads
//! its first message.
//!
//! ```
//! use confinement::{Rights, Sockets};
//!
//! // A node that reaches the router of its cell by a Unix socket: no files, no network, no programs.
//! let rights = Rights::default().with_sockets(Sockets { unix: true, ..Sockets::default() });
//! # if false {
//! let confined = confinement::confine(&rights)?;
//! println!("confined by {confined}");
//! # }
//! # Ok::<(), confinement::ConfinementError>(())
//! ```
//!
//! Landlock refuses files, TCP ports, signals to others and tracing of others by path and port (`EACCES`, `EPERM`); seccomp
//! refuses system calls and kinds of sockets (`EPERM`). Both last until the process ends and hold for what it starts. A kernel
//! that lacks one of them leaves the other, and [`Confined`] says so.
//!
//! Not covered: a Unix socket that the user may open and that has a path (Landlock before ABI 9), and files opened before.

mod calls;
mod files;

use std::{fmt, path::PathBuf};

pub use files::interpreter;

/// What a process may do. By default it may read what programs of the system need, write nothing and open no socket.
#[derive(Clone, Debug, Default)]
pub struct Rights {
    read: Vec<PathBuf>,
    write: Vec<PathBuf>,
    execute: Vec<PathBuf>,
    sockets: Sockets,
}

/// Sockets that a process may open, beside pairs within itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "kinds that are opened or not, each by itself"
)]
pub struct Sockets {
    /// Unix sockets.
    pub unix: bool,
    /// TCP over IPv4 and IPv6.
    pub tcp: bool,
    /// UDP as well: DDS, and the look-up of names.
    pub udp: bool,
    /// Others may connect to it.
    pub listens: bool,
    /// TCP ports to which it may connect; none: to any.
    pub ports: Option<Vec<u16>>,
}

impl Sockets {
    /// All of them.
    pub fn any() -> Self {
        Self {
            unix: true,
            tcp: true,
            udp: true,
            listens: true,
            ports: None,
        }
    }
}

impl Rights {
    /// It may read these files, and folders with all that is in them. What does not exist is left out.
    #[must_use]
    pub fn reads(mut self, paths: impl IntoIterator<Item = impl Into<PathBuf>>) -> Self {
        self.read.extend(paths.into_iter().map(Into::into));
        self
    }

    /// It may read, make, change, rename and remove files in these folders. They must exist.
    #[must_use]
    pub fn writes(mut self, folders: impl IntoIterator<Item = impl Into<PathBuf>>) -> Self {
        self.write.extend(folders.into_iter().map(Into::into));
        self
    }

    /// It may start these programs, which have no more rights than itself.
    #[must_use]
    pub fn starts(mut self, programs: impl IntoIterator<Item = impl Into<PathBuf>>) -> Self {
        self.execute.extend(programs.into_iter().map(Into::into));
        self
    }

    /// It may open these sockets.
    #[must_use]
    pub fn with_sockets(mut self, sockets: Sockets) -> Self {
        self.sockets = sockets;
        self
    }
}

/// What confines this process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Confined {
    /// Version of Landlock that the kernel offers; none: the kernel has none, or it is not enabled.
    pub landlock: Option<u32>,
    /// The kernel filters system calls.
    pub seccomp: bool,
}

impl Confined {
    /// What the kernel lacks, in a sentence; none where it has everything that is asked for.
    pub fn lack(&self) -> Option<String> {
        match (self.landlock, self.seccomp) {
            (Some(files::ABI_USED..), true) => None,
            (Some(abi), true) => Some(format!(
                "Landlock of this kernel has ABI {abi}, older than {}: {}",
                files::ABI_USED,
                files::lacking(abi)
            )),
            (None, true) => Some(
                "this kernel has no Landlock: seccomp alone confines the processes of the cell, which may open every file of \
                 their user"
                    .to_owned(),
            ),
            (Some(_), false) => Some(
                "this kernel has no seccomp: Landlock alone confines the processes of the cell, which may make every system call"
                    .to_owned(),
            ),
            (None, false) => Some(
                "this kernel has neither Landlock nor seccomp: nothing confines the processes of the cell"
                    .to_owned(),
            ),
        }
    }
}

impl fmt::Display for Confined {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.landlock, self.seccomp) {
            (Some(abi), true) => write!(f, "Landlock (ABI {abi}) and seccomp"),
            (Some(abi), false) => write!(f, "Landlock (ABI {abi}) alone"),
            (None, true) => f.write_str("seccomp alone"),
            (None, false) => f.write_str("nothing"),
        }
    }
}

/// Why a process was not confined.
#[derive(Debug, thiserror::Error)]
pub enum ConfinementError {
    /// Landlock holds for the thread that asks and for those that it starts, so those that run already would stay free.
    #[error("the process has {0} threads already: those that it has are not confined")]
    Threads(usize),
    /// A folder or file of the rights cannot be opened.
    #[error("cannot confine the process to {path}: {reason}")]
    Path {
        /// Which.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// The kernel refuses the rules although it has Landlock.
    #[error("Landlock refuses the rules: {0}")]
    Landlock(#[from] landlock::RulesetError),
    /// The kernel refuses the filter although it has seccomp.
    #[error("seccomp refuses the filter: {0}")]
    Seccomp(#[from] seccompiler::Error),
}

/// Confines this process to `rights`, for good. Call it before the process has a second thread.
///
/// # Errors
/// [`ConfinementError`]; a kernel without Landlock or seccomp is none.
pub fn confine(rights: &Rights) -> Result<Confined, ConfinementError> {
    let threads = std::fs::read_dir("/proc/self/task").map_or(1, Iterator::count);
    if threads > 1 {
        return Err(ConfinementError::Threads(threads));
    }
    Ok(Confined {
        landlock: files::restrict(rights)?,
        seccomp: calls::restrict(rights)?,
    })
}
