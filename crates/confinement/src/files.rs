//! Landlock: files by path, TCP by port, and a scope that signals and abstract sockets do not leave.

use std::{
    fs::File,
    os::unix::fs::FileExt as _,
    path::{Path, PathBuf},
};

use landlock::{
    ABI, Access, AccessFs, AccessNet, BitFlags, LandlockStatus, NetPort, PathBeneath, PathFd,
    Ruleset, RulesetAttr, RulesetCreated, RulesetCreatedAttr, Scope,
};

use crate::{ConfinementError, Rights};

/// Version of Landlock whose rights are taken away; the newest one that this was tried on.
const USED: ABI = ABI::V6;
/// The same as a number.
pub(crate) const ABI_USED: u32 = 6;

/// What programs of the system read: libraries, names of hosts, the time zone, figures of the kernel.
///
/// Of `/proc` only what is the process's own: root, who has `CAP_PERFMON`, reads the environment of others there although
/// Landlock refuses to trace them.
const SYSTEM: [&str; 14] = [
    "/etc",
    "/usr",
    "/lib",
    "/lib64",
    "/nix/store",
    "/proc/self",
    "/proc/sys",
    "/proc/cpuinfo",
    "/proc/meminfo",
    "/proc/stat",
    "/sys",
    "/run/systemd/resolve",
    "/dev/null",
    "/dev/urandom",
];

/// What an older version does not take away.
pub(crate) fn lacking(abi: u32) -> &'static str {
    match abi {
        ..=1 => "files can be moved between folders and cut, TCP ports and signals are not refused",
        2 => "files can be cut, TCP ports and signals are not refused",
        3 => "TCP ports and signals are not refused",
        _ => "signals and abstract sockets are not refused",
    }
}

/// Takes away every file, port and signal that `rights` does not give.
pub(crate) fn restrict(rights: &Rights) -> Result<Option<u32>, ConfinementError> {
    let mut rules = Ruleset::default().handle_access(AccessFs::from_all(USED))?;
    // A process that may connect to any port and listen has nothing to lose here.
    let ports = match &rights.sockets {
        sockets if !sockets.tcp => Some(Vec::new()),
        sockets => sockets.ports.clone(),
    };
    if ports.is_some() {
        rules = rules.handle_access(AccessNet::ConnectTcp)?;
    }
    if !rights.sockets.listens {
        rules = rules.handle_access(AccessNet::BindTcp)?;
    }
    let mut rules = rules.scope(Scope::from_all(USED))?.create()?;
    let read = AccessFs::ReadFile | AccessFs::ReadDir;
    let own = std::env::current_exe();
    let system = SYSTEM.iter().map(PathBuf::from).chain(own);
    for path in system.chain(rights.read.iter().cloned()) {
        if path.exists() {
            rules = allow(rules, &path, read)?;
        }
    }
    // The output of programs that want to be silent.
    rules = allow(
        rules,
        Path::new("/dev/null"),
        read | AccessFs::WriteFile | AccessFs::Truncate,
    )?;
    let write = read
        | AccessFs::WriteFile
        | AccessFs::Truncate
        | AccessFs::MakeReg
        | AccessFs::MakeDir
        | AccessFs::MakeSock
        | AccessFs::RemoveFile
        | AccessFs::RemoveDir;
    for folder in &rights.write {
        rules = allow(rules, folder, write)?;
    }
    for program in &rights.execute {
        rules = allow(rules, program, AccessFs::Execute | AccessFs::ReadFile)?;
    }
    for port in ports.into_iter().flatten() {
        rules = rules.add_rule(NetPort::new(port, AccessNet::ConnectTcp))?;
    }
    match rules.restrict_self()?.landlock {
        LandlockStatus::Available {
            effective_abi,
            kernel_abi,
        } => Ok(Some(
            kernel_abi.map_or(effective_abi as u32, i32::unsigned_abs),
        )),
        _ => Ok(None),
    }
}

fn allow(
    rules: RulesetCreated,
    path: &Path,
    access: BitFlags<AccessFs>,
) -> Result<RulesetCreated, ConfinementError> {
    let unopened = |reason: String| ConfinementError::Path {
        path: path.to_owned(),
        reason,
    };
    let open = PathFd::new(path).map_err(|error| {
        unopened(std::error::Error::source(&error).map_or(error.to_string(), ToString::to_string))
    })?;
    // Rights of folders do not apply to a file.
    let access = if path.is_dir() {
        access
    } else {
        access & AccessFs::from_file(USED)
    };
    Ok(rules.add_rule(PathBeneath::new(open, access))?)
}

/// The dynamic linker that a program names, which the kernel executes first: `PT_INTERP` of an ELF file of 64 bits
/// (System V ABI, figure 5-1). None for a program without one.
///
/// # Errors
/// What the system says of the file.
pub fn interpreter(program: &Path) -> std::io::Result<Option<PathBuf>> {
    const HEADER: usize = 64;
    const INTERP: u32 = 3;
    let file = File::open(program)?;
    let mut header = [0; HEADER];
    file.read_exact_at(&mut header, 0)?;
    let half = |at: usize| u64::from(u16::from_le_bytes([header[at], header[at + 1]]));
    if header[..5] != [0x7f, b'E', b'L', b'F', 2] || cfg!(target_endian = "big") {
        return Ok(None);
    }
    let word = |bytes: &[u8], at: usize| {
        let mut word = [0; 8];
        word.copy_from_slice(&bytes[at..at + 8]);
        u64::from_le_bytes(word)
    };
    let (first, size, count) = (word(&header, 32), half(54), half(56));
    for index in 0..count {
        let mut segment = [0; 56];
        file.read_exact_at(&mut segment, first + index * size)?;
        if segment[..4] == INTERP.to_le_bytes() {
            let length = usize::try_from(word(&segment, 32)).unwrap_or_default();
            let mut name = vec![0; length.min(libc::PATH_MAX as usize)];
            file.read_exact_at(&mut name, word(&segment, 8))?;
            name.pop();
            return Ok(Some(PathBuf::from(
                String::from_utf8_lossy(&name).into_owned(),
            )));
        }
    }
    Ok(None)
}
