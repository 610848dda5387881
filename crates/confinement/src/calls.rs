//! seccomp: system calls that no process of a cell makes, and kinds of sockets.

use std::collections::BTreeMap;

use seccompiler::{
    BpfProgram, Error, SeccompAction, SeccompCmpArgLen as Length, SeccompCmpOp as Compare,
    SeccompCondition, SeccompFilter, SeccompRule, TargetArch, apply_filter_all_threads,
};

use crate::{ConfinementError, Rights};

/// Refused to every process: other processes' memory, the kernel, namespaces, the clock, devices, and ways past this filter.
#[rustfmt::skip]
const NEVER: &[i64] = &[
    // Of other processes.
    libc::SYS_ptrace, libc::SYS_process_vm_readv, libc::SYS_process_vm_writev, libc::SYS_kcmp, libc::SYS_pidfd_getfd,
    libc::SYS_perf_event_open,
    // Sockets and files past this filter, and code of the kernel.
    libc::SYS_io_uring_setup, libc::SYS_io_uring_enter, libc::SYS_io_uring_register, libc::SYS_bpf, libc::SYS_userfaultfd,
    libc::SYS_init_module, libc::SYS_finit_module, libc::SYS_delete_module, libc::SYS_kexec_load,
    libc::SYS_add_key, libc::SYS_request_key, libc::SYS_keyctl, libc::SYS_open_by_handle_at,
    // The system.
    libc::SYS_mount, libc::SYS_umount2, libc::SYS_pivot_root, libc::SYS_chroot, libc::SYS_unshare, libc::SYS_setns,
    libc::SYS_move_mount, libc::SYS_open_tree, libc::SYS_fsopen, libc::SYS_fsconfig, libc::SYS_fsmount, libc::SYS_fspick,
    libc::SYS_mount_setattr, libc::SYS_mknodat, libc::SYS_swapon, libc::SYS_swapoff, libc::SYS_acct, libc::SYS_quotactl,
    libc::SYS_reboot, libc::SYS_sethostname, libc::SYS_setdomainname, libc::SYS_syslog, libc::SYS_vhangup,
    libc::SYS_personality,
    // The clock.
    libc::SYS_settimeofday, libc::SYS_clock_settime, libc::SYS_clock_adjtime, libc::SYS_adjtimex,
];

/// Of the processor.
#[cfg(target_arch = "x86_64")]
const NEVER_HERE: &[i64] = &[
    libc::SYS_ioperm,
    libc::SYS_iopl,
    libc::SYS_modify_ldt,
    libc::SYS_mknod,
    libc::SYS_kexec_file_load,
];
#[cfg(not(target_arch = "x86_64"))]
const NEVER_HERE: &[i64] = &[];

/// Refused to processes that start no program: programs, processes, and signals to any but its own threads.
const ALONE: &[i64] = &[
    libc::SYS_execve,
    libc::SYS_execveat,
    libc::SYS_kill,
    libc::SYS_tkill,
    libc::SYS_rt_sigqueueinfo,
    libc::SYS_rt_tgsigqueueinfo,
    libc::SYS_pidfd_send_signal,
];

/// The same, of the processor.
#[cfg(target_arch = "x86_64")]
const ALONE_HERE: &[i64] = &[libc::SYS_fork, libc::SYS_vfork];
#[cfg(not(target_arch = "x86_64"))]
const ALONE_HERE: &[i64] = &[];

/// Refused to processes that write no file: what changes names, rights and times of files, on kernels without Landlock as well.
#[rustfmt::skip]
const CHANGES: &[i64] = &[
    libc::SYS_mkdirat, libc::SYS_unlinkat, libc::SYS_renameat2, libc::SYS_linkat, libc::SYS_symlinkat, libc::SYS_truncate,
    libc::SYS_fchmod, libc::SYS_fchmodat, libc::SYS_fchmodat2, libc::SYS_fchown, libc::SYS_fchownat, libc::SYS_utimensat,
    libc::SYS_setxattr, libc::SYS_lsetxattr, libc::SYS_fsetxattr,
    libc::SYS_removexattr, libc::SYS_lremovexattr, libc::SYS_fremovexattr,
];

/// The same, of the processor.
#[cfg(target_arch = "x86_64")]
#[rustfmt::skip]
const CHANGES_HERE: &[i64] = &[
    libc::SYS_creat, libc::SYS_mkdir, libc::SYS_rmdir, libc::SYS_unlink, libc::SYS_rename, libc::SYS_renameat, libc::SYS_link,
    libc::SYS_symlink, libc::SYS_chmod, libc::SYS_chown, libc::SYS_lchown, libc::SYS_utime, libc::SYS_utimes,
    libc::SYS_futimesat,
];
#[cfg(not(target_arch = "x86_64"))]
const CHANGES_HERE: &[i64] = &[];

/// Calls that open a file, and which argument says how.
#[cfg(target_arch = "x86_64")]
const OPENS: &[(i64, u8)] = &[(libc::SYS_open, 1), (libc::SYS_openat, 2)];
#[cfg(not(target_arch = "x86_64"))]
const OPENS: &[(i64, u8)] = &[(libc::SYS_openat, 2)];

/// Bits of the second argument of `socket` that are its type; the others are flags.
const TYPE: u64 = 0xf;

/// `SOCK_PACKET` of socket(2): obsolete, and still every packet of an interface.
const SOCK_PACKET: i32 = 10;

/// Filters the system calls of every thread of this process. False where the kernel has no seccomp, or none for this
/// processor.
pub(crate) fn restrict(rights: &Rights) -> Result<bool, ConfinementError> {
    let Ok(processor) = TargetArch::try_from(std::env::consts::ARCH) else {
        return Ok(false);
    };
    let filter = |rules, errno: i32| -> Result<BpfProgram, Error> {
        let action = SeccompAction::Errno(errno.unsigned_abs());
        let filter = SeccompFilter::new(rules, SeccompAction::Allow, action, processor)?;
        Ok(filter.try_into()?)
    };
    let alone = rights.execute.is_empty();
    let refused = filter(refused(rights, alone)?, libc::EPERM)?;
    match apply_filter_all_threads(&refused) {
        Ok(()) => {}
        Err(Error::Seccomp(error) | Error::Prctl(error)) if is_missing(&error) => return Ok(false),
        Err(error) => return Err(error.into()),
    }
    // Arguments of these lie in memory, where no filter sees them: the C library takes clone and openat where they are missing.
    let mut missing = BTreeMap::new();
    if alone {
        missing.insert(libc::SYS_clone3, Vec::new());
    }
    if rights.write.is_empty() {
        missing.insert(libc::SYS_openat2, Vec::new());
    }
    if !missing.is_empty() {
        apply_filter_all_threads(&filter(missing, libc::ENOSYS)?)?;
    }
    Ok(true)
}

/// The kernel does not know the call, or was built without it.
fn is_missing(error: &std::io::Error) -> bool {
    matches!(error.raw_os_error(), Some(libc::ENOSYS | libc::EINVAL))
}

/// System calls that are refused; each under one of its rules, or always where it has none.
fn refused(rights: &Rights, alone: bool) -> Result<BTreeMap<i64, Vec<SeccompRule>>, Error> {
    let always = NEVER.iter().chain(NEVER_HERE);
    let mut rules: BTreeMap<i64, Vec<SeccompRule>> = always.map(|&call| (call, vec![])).collect();
    if alone {
        let always = ALONE.iter().chain(ALONE_HERE);
        rules.extend(always.map(|&call| (call, vec![])));
        // Threads, but no processes.
        let process = argument(0, Compare::MaskedEq(libc::CLONE_THREAD as u64), 0)?;
        rules.insert(libc::SYS_clone, vec![SeccompRule::new(vec![process])?]);
    }
    if rights.write.is_empty() {
        let always = CHANGES.iter().chain(CHANGES_HERE);
        rules.extend(always.map(|&call| (call, vec![])));
        for &(call, how) in OPENS {
            let bits =
                [libc::O_WRONLY, libc::O_RDWR, libc::O_CREAT, libc::O_TRUNC].map(|bit| bit as u64);
            let writes = bits.map(|bit| {
                Ok(SeccompRule::new(vec![argument(
                    how,
                    Compare::MaskedEq(bit),
                    bit,
                )?])?)
            });
            rules.insert(call, writes.into_iter().collect::<Result<_, Error>>()?);
        }
    }
    // Words typed into the terminal that this process shares with others.
    let typed = [libc::TIOCSTI, libc::TIOCLINUX];
    let typed = typed.map(|request| {
        SeccompRule::new(vec![argument(1, Compare::Eq, request)?]).map_err(Error::from)
    });
    rules.insert(
        libc::SYS_ioctl,
        typed.into_iter().collect::<Result<_, _>>()?,
    );
    rules.insert(libc::SYS_socket, sockets(rights)?);
    if !rights.sockets.listens {
        rules.insert(libc::SYS_listen, vec![]);
    }
    Ok(rules)
}

/// Sockets that are refused.
fn sockets(rights: &Rights) -> Result<Vec<SeccompRule>, Error> {
    let sockets = &rights.sockets;
    let mut families = Vec::new();
    if sockets.unix {
        families.push(libc::AF_UNIX);
    }
    if sockets.tcp || sockets.udp {
        families.extend([libc::AF_INET, libc::AF_INET6]);
    }
    if sockets.listens || sockets.udp {
        // Which addresses this computer has.
        families.push(libc::AF_NETLINK);
    }
    if families.is_empty() {
        return Ok(Vec::new());
    }
    let others = families
        .iter()
        .map(|&family| argument(0, Compare::Ne, family as u64))
        .collect::<Result<_, _>>()?;
    let mut rules = vec![SeccompRule::new(others)?];
    for family in [libc::AF_INET, libc::AF_INET6] {
        let mut types = vec![
            libc::SOCK_RAW,
            libc::SOCK_RDM,
            libc::SOCK_SEQPACKET,
            libc::SOCK_DCCP,
            SOCK_PACKET,
        ];
        if !sockets.udp {
            types.push(libc::SOCK_DGRAM);
        }
        if !sockets.tcp {
            types.push(libc::SOCK_STREAM);
        }
        for kind in types {
            rules.push(SeccompRule::new(vec![
                argument(0, Compare::Eq, family as u64)?,
                argument(1, Compare::MaskedEq(TYPE), kind as u64)?,
            ])?);
        }
    }
    let routes = argument(2, Compare::Ne, libc::NETLINK_ROUTE as u64)?;
    rules.push(SeccompRule::new(vec![
        argument(0, Compare::Eq, libc::AF_NETLINK as u64)?,
        routes,
    ])?);
    Ok(rules)
}

/// A condition on an argument, which the kernel takes as 32 bits.
fn argument(
    index: u8,
    compare: Compare,
    value: u64,
) -> Result<SeccompCondition, seccompiler::BackendError> {
    SeccompCondition::new(index, Length::Dword, compare, value)
}
