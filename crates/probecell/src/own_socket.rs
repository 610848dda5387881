//! The private socket of a router: a Unix socket in a folder that only its user can open, by which that user's processes and
//! commands reach it. Whoever comes by the network is a stranger ([`cell::strangers`]).
//!
//! Its path follows from the endpoint of the router, so that cells which share a router share the socket, and from the host
//! and the network namespace, since an endpoint on loopback means another router in each of them. It lies in the user's state
//! folder (XDG Base Directory Specification 0.8) and not in that of the login session, which a service does not have, and
//! which ends with the last login.

use std::{
    collections::BTreeSet,
    ffi::OsString,
    fs,
    os::unix::{
        ffi::OsStrExt as _,
        fs::{DirBuilderExt as _, MetadataExt as _},
        net::UnixStream,
    },
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use anyhow::{Context, bail};
use cell::{Cell, strangers::SOCKET};
use rustix::process::geteuid;
use serde::{Deserialize, Serialize};

/// Permissions of the folder.
const PRIVATE: u32 = 0o700;
/// Longest path of a Unix socket on Linux, in bytes: `sun_path` of unix(7) without the final zero.
const LONGEST: usize = 107;
/// How long a router that begins is waited for.
pub(crate) const PATIENCE: Duration = Duration::from_secs(5);
/// How long a command waits: another cell takes the place of a router within half a second, and what a killed router has left
/// of its socket looks the same as one that begins; on a computer that compiles beside it a router has needed more than a second.
pub(crate) const COMMAND_PATIENCE: Duration = Duration::from_secs(3);
/// Between two looks.
const PERIOD: Duration = Duration::from_millis(20);

/// The private socket of the router at an endpoint; it need not exist.
pub(crate) struct OwnSocket(PathBuf);

/// What the router behind a socket opens to strangers, for the cells that join it.
#[derive(Serialize, Deserialize)]
struct Opened {
    endpoint: String,
    opened: BTreeSet<String>,
}

impl OwnSocket {
    /// That of a router; none where this user has no folder for it.
    pub(crate) fn of(endpoint: &str) -> Option<Self> {
        Self::named(&[endpoint.as_bytes()], "socket")
    }

    /// Where a cell that uses a router answers its own user past the bus ([`host::private`]).
    pub(crate) fn of_calls(cell: &Cell) -> Option<Self> {
        Self::of_cell(cell, "calls")
    }

    /// The file of the simulated clock of a cell, where it has one ([`host::sim_time`]).
    pub(crate) fn of_clock(cell: &Cell) -> Option<Self> {
        Self::of_cell(cell, "clock")
    }

    fn of_cell(cell: &Cell, kind: &str) -> Option<Self> {
        let (endpoint, name) = (&cell.bus.router_endpoint, cell.namespace());
        let domain = cell.bus.domain_id.unwrap_or_default().to_le_bytes();
        Self::named(&[endpoint.as_bytes(), name.as_bytes(), &domain], kind)
    }

    fn named(identity: &[&[u8]], kind: &str) -> Option<Self> {
        let here = fs::read_link("/proc/self/ns/net").unwrap_or_default();
        let host = fs::read("/proc/sys/kernel/hostname").unwrap_or_default();
        let place = [host.as_slice(), here.as_os_str().as_bytes()];
        let identity = [&place, identity].concat().join(&b'\n');
        Some(Self(
            folder()?.join(format!("{:016x}.{kind}", fnv1a(&identity))),
        ))
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }

    /// Locator of Zenoh.
    pub(crate) fn locator(&self) -> String {
        format!("{SOCKET}/{}", self.0.display())
    }

    /// A router listens there now.
    pub(crate) fn answers(&self) -> bool {
        UnixStream::connect(&self.0).is_ok()
    }

    /// Makes the folder, and refuses one that others could open.
    pub(crate) fn prepare(&self) -> anyhow::Result<()> {
        let folder = self.0.parent().unwrap_or(Path::new("/"));
        let length = self.0.as_os_str().len();
        if length > LONGEST {
            bail!(
                "the path of the cell's private socket has {length} bytes, of which a Unix socket takes {LONGEST}: {}: set \
                 XDG_STATE_HOME to a shorter one",
                self.0.display()
            );
        }
        let mut builder = fs::DirBuilder::new();
        builder.recursive(true).mode(PRIVATE);
        builder
            .create(folder)
            .with_context(|| format!("cannot make {}", folder.display()))?;
        let found = fs::symlink_metadata(folder)
            .with_context(|| format!("cannot read {}", folder.display()))?;
        if !found.is_dir() || found.uid() != geteuid().as_raw() || found.mode() & 0o077 != 0 {
            bail!(
                "{} is the folder of the private sockets of cells, and must belong to this user and be closed to others: chmod 700 it",
                folder.display()
            );
        }
        Ok(())
    }

    /// Writes what the router opens to strangers, beside its socket.
    pub(crate) fn write_opened(
        &self,
        endpoint: &str,
        opened: &BTreeSet<String>,
    ) -> anyhow::Result<()> {
        let (endpoint, opened) = (endpoint.to_owned(), opened.clone());
        let text = serde_json::to_string(&Opened { endpoint, opened })?;
        let path = self.sidecar();
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
    }

    /// What the router there opens to strangers.
    pub(crate) fn read_opened(&self) -> BTreeSet<String> {
        let text = fs::read_to_string(self.sidecar()).unwrap_or_default();
        serde_json::from_str(&text).map_or_else(|_| BTreeSet::new(), |one: Opened| one.opened)
    }

    fn sidecar(&self) -> PathBuf {
        self.0.with_extension("json")
    }
}

/// How a process of this user reaches the router at an endpoint: by its private socket, where it has one, else as a stranger.
/// A router listens on its socket before it listens on the network, so a process that finds the network alone has found
/// the router of others.
pub(crate) fn own_locator(endpoint: &str, patience: Duration) -> String {
    let Some(socket) = OwnSocket::of(endpoint) else {
        return endpoint.to_owned();
    };
    let deadline = Instant::now() + patience;
    // Where none was ever made there is nothing to wait for.
    while socket.0.exists() {
        if socket.answers() {
            return socket.locator();
        }
        if host::endpoint_answers(endpoint) {
            break;
        }
        if Instant::now() > deadline {
            return endpoint.to_owned();
        }
        std::thread::sleep(PERIOD);
    }
    if socket.answers() {
        socket.locator()
    } else {
        endpoint.to_owned()
    }
}

/// Folder of the private sockets in the user's state folder.
pub(crate) fn folder() -> Option<PathBuf> {
    let absolute = |name: &str| {
        let path = std::env::var_os(name).filter(|value: &OsString| !value.is_empty());
        path.map(PathBuf::from).filter(|path| path.is_absolute())
    };
    let state = absolute("XDG_STATE_HOME");
    let state = state.or_else(|| absolute("HOME").map(|home| home.join(".local/state")));
    Some(state?.join("probecell").join("bus"))
}

/// FNV-1a, 64 bits (<https://datatracker.ietf.org/doc/html/draft-eastlake-fnv>): a short name of a place, no secret.
pub(crate) fn fnv1a(bytes: &[u8]) -> u64 {
    let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, step)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the reference implementation by its authors.
    #[test]
    fn names_are_those_of_the_published_hash() {
        assert_eq!(fnv1a(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv1a(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(fnv1a(b"foobar"), 0x8594_4171_f739_67e8);
    }
}
