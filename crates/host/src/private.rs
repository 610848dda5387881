//! Services by a Unix socket in a folder that only its user can open: what an operator needs reaches a cell by no way that
//! strangers can fill up.
//!
//! A connection carries one call. Request: the length of the name (`u8`), the name, the length of the request (`u32`), the
//! request; answer: its length (`u32`) and the answer. Numbers are little endian, contents CDR with its header.

use std::{
    collections::BTreeMap,
    fs,
    io::{self, Read, Write},
    os::unix::net::{UnixListener, UnixStream},
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

/// Longest request or answer, bytes.
const LONGEST: u32 = 1 << 20;
/// Calls at once.
const AT_ONCE: usize = 32;
/// In which a caller has sent its request.
const REQUEST: Duration = Duration::from_secs(2);

/// Answers a call: a request to its response.
pub type Answering = Arc<dyn Fn(&[u8]) -> Vec<u8> + Send + Sync>;

/// Where a process of a cell listens for its own user.
pub struct PrivateServices {
    path: PathBuf,
    listener: UnixListener,
}

impl PrivateServices {
    /// Begins to listen; the folder is that of its user alone. What a process that was killed has left is replaced.
    ///
    /// # Errors
    /// What the system says; [`io::ErrorKind::AddrInUse`] where a process answers there.
    pub fn listen(path: &Path) -> io::Result<Self> {
        if UnixStream::connect(path).is_ok() {
            return Err(io::ErrorKind::AddrInUse.into());
        }
        match fs::remove_file(path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        let listener = UnixListener::bind(path)?;
        Ok(Self {
            path: path.to_owned(),
            listener,
        })
    }

    /// Answers calls of these services on threads of their own, until the process ends.
    ///
    /// # Errors
    /// What the system says of a thread.
    pub fn serve(self, services: BTreeMap<&'static str, Answering>) -> io::Result<SocketFile> {
        let running = Arc::new(AtomicUsize::new(0));
        let services = Arc::new(services);
        let answer_all = move || {
            for stream in self.listener.incoming() {
                let Ok(stream) = stream else {
                    // Without a descriptor nothing is taken; the caller sees its call end.
                    std::thread::sleep(Duration::from_millis(20));
                    continue;
                };
                if running.fetch_add(1, Ordering::AcqRel) >= AT_ONCE {
                    running.fetch_sub(1, Ordering::AcqRel);
                    continue;
                }
                let (of_call, services) = (Arc::clone(&running), Arc::clone(&services));
                let begun = std::thread::Builder::new()
                    .name("private call".to_owned())
                    .spawn(move || {
                        if let Err(error) = answer(stream, &services) {
                            tracing::debug!(%error, "a call by the private socket");
                        }
                        of_call.fetch_sub(1, Ordering::AcqRel);
                    });
                if begun.is_err() {
                    running.fetch_sub(1, Ordering::AcqRel);
                }
            }
        };
        let file = SocketFile(self.path.clone());
        std::thread::Builder::new()
            .name("private services".to_owned())
            .spawn(answer_all)?;
        Ok(file)
    }
}

/// The socket in its folder, removed when this is dropped.
pub struct SocketFile(PathBuf);

impl Drop for SocketFile {
    fn drop(&mut self) {
        // Gone already, or not to be removed by this process: the next one replaces it.
        drop(fs::remove_file(&self.0));
    }
}

fn answer(mut stream: UnixStream, services: &BTreeMap<&'static str, Answering>) -> io::Result<()> {
    stream.set_read_timeout(Some(REQUEST))?;
    stream.set_write_timeout(Some(REQUEST))?;
    let mut length = [0];
    stream.read_exact(&mut length)?;
    let mut name = vec![0; usize::from(length[0])];
    stream.read_exact(&mut name)?;
    let request = read(&mut stream)?;
    let service = std::str::from_utf8(&name)
        .ok()
        .and_then(|name| services.get(name))
        .ok_or(io::ErrorKind::NotFound)?;
    write(&mut stream, &service(&request))
}

fn read(stream: &mut UnixStream) -> io::Result<Vec<u8>> {
    let mut length = [0; 4];
    stream.read_exact(&mut length)?;
    let length = u32::from_le_bytes(length);
    if length > LONGEST {
        return Err(io::ErrorKind::InvalidData.into());
    }
    let mut bytes = vec![0; length as usize];
    stream.read_exact(&mut bytes)?;
    Ok(bytes)
}

fn write(stream: &mut UnixStream, bytes: &[u8]) -> io::Result<()> {
    let length = u32::try_from(bytes.len())
        .ok()
        .filter(|&length| length <= LONGEST)
        .ok_or(io::ErrorKind::InvalidData)?;
    stream.write_all(&length.to_le_bytes())?;
    stream.write_all(bytes)
}

/// Calls a service; `None` where nothing listens there, or it does not answer this call: then another way is tried.
pub fn call(path: &Path, name: &str, request: &[u8], timeout: Duration) -> Option<Vec<u8>> {
    let ask = || -> io::Result<Vec<u8>> {
        let mut stream = UnixStream::connect(path)?;
        stream.set_read_timeout(Some(timeout))?;
        stream.set_write_timeout(Some(REQUEST))?;
        let length = u8::try_from(name.len()).map_err(|_| io::ErrorKind::InvalidInput)?;
        stream.write_all(&[&[length], name.as_bytes()].concat())?;
        write(&mut stream, request)?;
        read(&mut stream)
    };
    ask().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn twice(request: &[u8]) -> Vec<u8> {
        request.repeat(2)
    }

    const PATIENCE: Duration = Duration::from_secs(60);

    #[test]
    fn calls_are_answered_and_silent_callers_take_no_call_away_for_long() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cell");
        assert_eq!(call(&path, "twice", b"ab", PATIENCE), None);
        let services = PrivateServices::listen(&path).unwrap();
        let file = services
            .serve(BTreeMap::from([("twice", Arc::new(twice) as Answering)]))
            .unwrap();
        assert_eq!(
            call(&path, "twice", b"ab", PATIENCE),
            Some(b"abab".to_vec())
        );
        assert_eq!(call(&path, "thrice", b"ab", PATIENCE), None);
        let too_long = vec![0; LONGEST as usize + 1];
        assert_eq!(call(&path, "twice", &too_long, PATIENCE), None);
        // More than are served at once, all silent: they are given up, and the next call is answered.
        let silent: Vec<UnixStream> = (0..2 * AT_ONCE)
            .map(|_| UnixStream::connect(&path).unwrap())
            .collect();
        let answered = std::iter::repeat_with(|| call(&path, "twice", b"c", PATIENCE));
        assert!(
            answered
                .take(1 << 20)
                .any(|answer| answer == Some(b"cc".to_vec()))
        );
        drop(silent);
        assert!(PrivateServices::listen(&path).is_err(), "one listens there");
        drop(file);
        assert!(!path.exists());
    }

    #[test]
    fn what_a_killed_process_left_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cell");
        drop(UnixListener::bind(&path).unwrap());
        assert!(path.exists());
        assert!(PrivateServices::listen(&path).is_ok());
    }
}
