//! The files of a recording, behind a small interface, so that a test can let each write and each sync fail.

use std::fmt::Debug;
use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::fs::{Access, access};
use rustix::io::Errno;

/// A file that is written from its beginning to its end. Handles of one file may be used by one thread at a time.
pub trait DiskFile: Send + Sync {
    /// Writes bytes at the end; gives how many of them, as [`Write::write`] does.
    fn write(&self, bytes: &[u8]) -> io::Result<usize>;

    /// Makes everything written durable.
    fn sync(&self) -> io::Result<()>;

    /// Whether the file still stands where it was made.
    fn place(&self, _made_at: &Path) -> io::Result<Place> {
        Ok(Place::Kept)
    }

    /// Copies what was written into a new file, durably; works for a file that has no name any more.
    fn copy_to(&self, _path: &Path) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }
}

/// What has become of the name of an open file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// It is where it was made.
    Kept,
    /// It has another name.
    Moved,
    /// It has none, and is gone once it is closed.
    Removed,
    /// It is where it was made, in a folder that may not be written any more, for this reason.
    Closed(Errno),
}

/// Where recordings are written.
pub trait Disk: Debug + Send + Sync {
    /// Makes a file for writing. `anew`: it must not exist; else what it held is gone.
    fn create(&self, path: &Path, anew: bool) -> io::Result<Arc<dyn DiskFile>>;

    /// Gives a file another name, in the place of what had it.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;

    /// Makes the names in a folder durable.
    fn sync_folder(&self, folder: &Path) -> io::Result<()>;
}

/// The files of the operating system.
#[derive(Clone, Copy, Debug, Default)]
pub struct SystemDisk;

impl DiskFile for File {
    fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        let mut file = self;
        Write::write(&mut file, bytes)
    }

    fn sync(&self) -> io::Result<()> {
        self.sync_data()
    }

    fn place(&self, made_at: &Path) -> io::Result<Place> {
        let own = self.metadata()?;
        if own.nlink() == 0 {
            return Ok(Place::Removed);
        }
        let there = match std::fs::symlink_metadata(made_at) {
            Err(error) if error.kind() == io::ErrorKind::PermissionDenied => {
                return Ok(Place::Closed(Errno::ACCESS));
            }
            Err(_) => return Ok(Place::Moved),
            Ok(there) => there,
        };
        if (there.dev(), there.ino()) != (own.dev(), own.ino()) {
            return Ok(Place::Moved);
        }
        // The recording has further files when it goes on and when it ends.
        let folder = made_at.parent().unwrap_or(made_at);
        let may_be_written = access(folder, Access::WRITE_OK);
        Ok(may_be_written.map_or_else(Place::Closed, |()| Place::Kept))
    }

    fn copy_to(&self, path: &Path) -> io::Result<()> {
        let mut reader = self.try_clone()?;
        reader.seek(SeekFrom::Start(0))?;
        let mut to = OpenOptions::new().write(true).create_new(true).open(path)?;
        io::copy(&mut reader, &mut to)?;
        to.sync_all()
    }
}

impl Disk for SystemDisk {
    fn create(&self, path: &Path, anew: bool) -> io::Result<Arc<dyn DiskFile>> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).truncate(!anew);
        let file = if anew {
            options.create_new(true).open(path)?
        } else {
            options.create(true).open(path)?
        };
        Ok(Arc::new(file))
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        std::fs::rename(from, to)
    }

    /// Systems without folder handles have nothing to do here.
    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        if cfg!(unix) {
            File::open(folder)?.sync_all()
        } else {
            Ok(())
        }
    }
}

/// A file as a stream. A disk that has refused once is not tried again, not even by a buffer that is dropped: what it kept
/// of the refused operation is not known.
#[derive(Clone)]
pub(crate) struct Stream {
    file: Arc<dyn DiskFile>,
    refused: Arc<AtomicBool>,
}

impl Stream {
    pub(crate) fn new(file: Arc<dyn DiskFile>) -> Self {
        Self {
            file,
            refused: Arc::default(),
        }
    }

    /// Makes everything written durable.
    pub(crate) fn sync(&self) -> io::Result<()> {
        self.attempt(|| self.file.sync())
    }

    pub(crate) fn file(&self) -> &dyn DiskFile {
        &*self.file
    }

    fn attempt<T>(&self, operation: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
        if self.refused.load(Ordering::Relaxed) {
            return Err(io::Error::other("the disk has refused before"));
        }
        let done = operation();
        let refused =
            (done.as_ref()).is_err_and(|error| error.kind() != io::ErrorKind::Interrupted);
        if refused {
            self.refused.store(true, Ordering::Relaxed);
        }
        done
    }
}

impl Write for Stream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.attempt(|| self.file.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
