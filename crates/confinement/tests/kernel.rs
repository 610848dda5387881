//! On the kernel that runs: a process of each kind tries what it may not do, and what it needs.
//!
//! The program runs itself again for each attempt, since a process that is confined stays so. Each attempt is made free as well:
//! what would fail anyway proves nothing.

use std::{
    fs,
    io::{self, Read as _, Write as _},
    net::{TcpListener, TcpStream, UdpSocket},
    os::{
        linux::net::SocketAddrExt as _,
        unix::net::{SocketAddr, UnixDatagram, UnixListener, UnixStream},
    },
    path::{Path, PathBuf},
    process::{Command, ExitCode, Stdio},
};

use confinement::{Confined, Rights, Sockets, confine, interpreter};

/// Says to a process of this program what it is to do.
const ATTEMPT: &str = "CONFINEMENT_ATTEMPT";

/// What a process tries, in a folder with the files `inside/file` and `outside/file`.
type Attempt = fn(&Place) -> io::Result<()>;

/// Where attempts are made.
struct Place {
    folder: PathBuf,
    /// A port on which the parent listens, and one on which nobody may be reached.
    ports: [u16; 2],
    parent: u32,
}

impl Place {
    fn inside(&self, name: &str) -> PathBuf {
        self.folder.join("inside").join(name)
    }

    fn outside(&self, name: &str) -> PathBuf {
        self.folder.join("outside").join(name)
    }
}

/// Name, what is tried, and who may: a node, a recorder that writes `inside`.
const ATTEMPTS: &[(&str, Attempt, [bool; 2])] = &[
    (
        "read a file of the user",
        |at| fs::read(at.outside("file")).map(drop),
        [false, false],
    ),
    (
        "list a folder of the user",
        |at| fs::read_dir(at.outside("")).map(drop),
        [false, false],
    ),
    (
        "write a new file",
        |at| fs::write(at.outside("new"), "x"),
        [false, false],
    ),
    (
        "change a file",
        |at| append(&at.outside("file")),
        [false, false],
    ),
    (
        "cut a file",
        |at| {
            fs::OpenOptions::new()
                .write(true)
                .truncate(true)
                .open(at.outside("file"))
                .map(drop)
        },
        [false, false],
    ),
    (
        "remove a file",
        |at| fs::remove_file(at.outside("file")),
        [false, false],
    ),
    (
        "rename a file",
        |at| fs::rename(at.outside("file"), at.outside("other")),
        [false, false],
    ),
    (
        "take a file out",
        |at| fs::rename(at.inside("file"), at.outside("other")),
        [false, false],
    ),
    (
        "make a folder",
        |at| fs::create_dir(at.outside("folder")),
        [false, false],
    ),
    (
        "make a link",
        |at| std::os::unix::fs::symlink("file", at.outside("link")),
        [false, false],
    ),
    (
        "write through a link",
        |at| append(&at.inside("link")),
        [false, false],
    ),
    ("start a program", |_| run("/bin/true"), [false, false]),
    (
        "read the environment of its parent",
        |at| read_all(&format!("/proc/{}/environ", at.parent)),
        [false, false],
    ),
    (
        "write memory by /proc",
        |_| {
            fs::OpenOptions::new()
                .write(true)
                .open("/proc/self/mem")
                .map(drop)
        },
        [false, false],
    ),
    (
        "connect to a port of others",
        |at| TcpStream::connect(("127.0.0.1", at.ports[1])).map(drop),
        [false, false],
    ),
    (
        "listen on a port",
        |_| TcpListener::bind("127.0.0.1:0").map(drop),
        [false, false],
    ),
    (
        "send a datagram",
        |_| UdpSocket::bind("127.0.0.1:0").map(drop),
        [false, false],
    ),
    (
        "listen on an abstract socket",
        |at| UnixListener::bind_addr(&abstract_address(at, "own")).map(drop),
        [false, false],
    ),
    (
        "connect to an abstract socket",
        |at| UnixStream::connect_addr(&abstract_address(at, "parent")).map(drop),
        [false, false],
    ),
    (
        "change the rights of a file",
        |at| rights(&at.outside("file")),
        [false, true],
    ),
    // What they need.
    (
        "read a file of the system",
        |_| fs::read("/etc/passwd").map(drop),
        [true, true],
    ),
    (
        "start a thread",
        |_| std::thread::Builder::new().spawn(|| ()).map(drop),
        [true, true],
    ),
    (
        "connect to the router",
        |at| TcpStream::connect(("127.0.0.1", at.ports[0])).map(drop),
        [true, true],
    ),
    (
        "connect to the socket of the router",
        |at| UnixStream::connect(at.outside("socket")).map(drop),
        [true, true],
    ),
    (
        "make a pair of sockets",
        |_| UnixDatagram::pair().map(drop),
        [true, true],
    ),
    (
        "look up the own computer",
        |at| TcpStream::connect(("localhost", at.ports[0])).map(drop),
        [true, true],
    ),
    ("record", |at| record(at), [false, true]),
];

fn append(path: &Path) -> io::Result<()> {
    let mut file = fs::OpenOptions::new().append(true).open(path)?;
    file.write_all(b"x")
}

fn read_all(path: &str) -> io::Result<()> {
    let mut file = fs::File::open(path)?;
    file.read_to_end(&mut Vec::new()).map(drop)
}

fn run(program: &str) -> io::Result<()> {
    Command::new(program).status().map(drop)
}

fn rights(path: &Path) -> io::Result<()> {
    fs::set_permissions(path, fs::metadata(path)?.permissions())
}

fn abstract_address(at: &Place, name: &str) -> SocketAddr {
    SocketAddr::from_abstract_name(format!("confinement-{}-{name}", at.parent)).expect("a name")
}

/// What a recorder does: a folder, a file that grows under another name, its name, and syncs.
fn record(at: &Place) -> io::Result<()> {
    let folder = at.inside("bag");
    fs::create_dir(&folder)?;
    fs::write(folder.join("new"), "x")?;
    append(&folder.join("new"))?;
    fs::rename(folder.join("new"), folder.join("file"))?;
    fs::File::open(&folder)?.sync_all()?;
    fs::read(folder.join("file"))?;
    fs::remove_file(folder.join("file"))?;
    fs::remove_dir(folder)
}

const KINDS: [&str; 3] = ["free", "node", "recorder"];

/// Confines this process as `kind`, and tries `attempt`. Prints the number of the error, 0 for none.
fn attempt(kind: &str, attempt: &str, at: &Place) {
    let sockets = Sockets {
        unix: true,
        tcp: true,
        ports: Some(vec![at.ports[0]]),
        ..Sockets::default()
    };
    let node = Rights::default().with_sockets(sockets);
    let confined = match kind {
        "node" => confine(&node),
        "recorder" => confine(&node.writes([at.inside("")])),
        _ => Ok(Confined {
            landlock: None,
            seccomp: false,
        }),
    };
    let confined = confined.expect("confined");
    let one = ATTEMPTS.iter().find(|one| one.0 == attempt);
    let code = match one.expect("an attempt").1(at) {
        Ok(()) => 0,
        Err(error) => error.raw_os_error().unwrap_or(-1),
    };
    let (landlock, seccomp) = (confined.landlock.unwrap_or(0), confined.seccomp);
    writeln!(io::stdout(), "{code} {landlock} {seccomp}").expect("output");
}

/// The error, the version of Landlock, and whether seccomp holds, of a process that tries something.
fn tried(kind: &str, name: &str) -> (i32, u32, bool) {
    let folder = tempfile::tempdir().expect("a folder");
    for part in ["inside", "outside"] {
        fs::create_dir(folder.path().join(part)).expect("a folder");
        fs::write(folder.path().join(part).join("file"), "text").expect("a file");
    }
    std::os::unix::fs::symlink("../outside/file", folder.path().join("inside/link"))
        .expect("a link");
    let _socket = UnixListener::bind(folder.path().join("outside/socket")).expect("a socket");
    let listen = || TcpListener::bind("127.0.0.1:0").expect("a port");
    let (router, other) = (listen(), listen());
    let port = |one: &TcpListener| one.local_addr().expect("an address").port();
    let at = Place {
        folder: folder.path().to_owned(),
        ports: [port(&router), port(&other)],
        parent: std::process::id(),
    };
    let _parent = UnixListener::bind_addr(&abstract_address(&at, "parent")).expect("a socket");
    let words = [
        kind.to_owned(),
        name.to_owned(),
        at.folder.display().to_string(),
        at.ports[0].to_string(),
        at.ports[1].to_string(),
        at.parent.to_string(),
    ];
    let own = std::env::current_exe().expect("this program");
    let output = Command::new(own)
        .env(ATTEMPT, words.join("\n"))
        .stderr(Stdio::inherit())
        .output()
        .expect("a process");
    assert!(output.status.success(), "{kind}: {name}: {}", output.status);
    let text = String::from_utf8(output.stdout).expect("text");
    let mut words = text.split_whitespace();
    let mut next = || {
        words
            .next()
            .unwrap_or_else(|| panic!("{kind}: {name}: {text:?}"))
    };
    let error = next().parse().expect("a number");
    (error, next().parse().expect("a number"), next() == "true")
}

/// System calls made by Python in a process that has inherited the rights of one that starts programs.
const CALLS: &str = r#"
import ctypes, os, sys
libc = ctypes.CDLL(None, use_errno=True)
def errno(number, *arguments):
    ctypes.set_errno(0)
    return ctypes.get_errno() if libc.syscall(number, *arguments) < 0 else 0
for name, number, arguments in (
    ("ptrace", %ptrace%, (0, 0, 0, 0)), ("process_vm_readv", %process_vm_readv%, (int(sys.argv[1]), 0, 0, 0, 0, 0)),
    ("io_uring_setup", %io_uring_setup%, (1, 0)), ("bpf", %bpf%, (0, 0, 0)), ("unshare", %unshare%, (0,)),
    ("clock_settime", %clock_settime%, (0, 0)), ("keyctl", %keyctl%, (0, 0, 0)), ("socket packet", %socket%, (17, 3, 0)),
    ("socket raw", %socket%, (2, 3, 1)), ("socket vsock", %socket%, (40, 1, 0)), ("ioctl TIOCSTI", %ioctl%, (0, 0x5412, b"x")),
    ("kill its grandparent", %kill%, (int(sys.argv[1]), 0)), ("getpid", %getpid%, ()),
):
    print(errno(number, *arguments), name)
"#;

/// The calls in Python, free or confined as a process that starts it.
fn calls(confined: bool) -> Vec<(i32, String)> {
    let numbers = [
        ("ptrace", libc::SYS_ptrace),
        ("process_vm_readv", libc::SYS_process_vm_readv),
        ("io_uring_setup", libc::SYS_io_uring_setup),
        ("bpf", libc::SYS_bpf),
        ("unshare", libc::SYS_unshare),
        ("clock_settime", libc::SYS_clock_settime),
        ("keyctl", libc::SYS_keyctl),
        ("socket", libc::SYS_socket),
        ("ioctl", libc::SYS_ioctl),
        ("kill", libc::SYS_kill),
        ("getpid", libc::SYS_getpid),
    ];
    let script = numbers
        .iter()
        .fold(CALLS.to_owned(), |text, (name, number)| {
            text.replace(&format!("%{name}%"), &number.to_string())
        });
    let own = std::env::current_exe().expect("this program");
    let mut command = Command::new(own);
    command.env(
        ATTEMPT,
        format!("python\n{confined}\n{}\n{script}", std::process::id()),
    );
    let output = command
        .stderr(Stdio::inherit())
        .output()
        .expect("a process");
    assert!(output.status.success(), "python: {}", output.status);
    let text = String::from_utf8(output.stdout).expect("text");
    let line = |line: &str| {
        let (number, name) = line.split_once(' ').expect("two words");
        (number.parse().expect("a number"), name.to_owned())
    };
    text.lines().map(line).collect()
}

/// Starts Python, as a launcher starts its processes.
fn python(confined: bool, grandparent: &str, script: &str) {
    let program = fs::canonicalize("/usr/bin/python3").expect("python3");
    if confined {
        let linker = interpreter(&program)
            .expect("readable")
            .expect("a dynamic linker");
        let rights = Rights::default()
            .starts([program.clone(), linker])
            .with_sockets(Sockets::any());
        confine(&rights).expect("confined");
    }
    let status = Command::new(program)
        .args(["-Ic", script, grandparent])
        .status();
    assert!(status.expect("started").success());
}

fn main() -> ExitCode {
    if let Ok(words) = std::env::var(ATTEMPT) {
        let words: Vec<&str> = words.splitn(6, '\n').collect();
        if words[0] == "python" {
            python(words[1] == "true", words[2], &words[3..].join("\n"));
        } else {
            let number = |index: usize| words[index].parse::<u32>().expect("a number");
            let ports = [number(3) as u16, number(4) as u16];
            let (folder, parent) = (PathBuf::from(words[2]), number(5));
            attempt(
                words[0],
                words[1],
                &Place {
                    folder,
                    ports,
                    parent,
                },
            );
        }
        return ExitCode::SUCCESS;
    }
    let mut out = io::stdout();
    let mut failed = 0;
    let mut check = |good: bool, text: String| {
        failed += usize::from(!good);
        writeln!(out, "{}  {text}", if good { "ok    " } else { "FAILED" }).expect("output");
    };
    let refusals = [libc::EACCES, libc::EPERM, libc::EXDEV];
    for (name, _, may) in ATTEMPTS {
        for (kind, may) in KINDS.iter().zip([true].iter().chain(may)) {
            let (error, landlock, seccomp) = tried(kind, name);
            if *kind != "free" && (landlock < 6 || !seccomp) {
                shared_data::note_missing(&format!(
                    "this kernel has Landlock ABI {landlock} of 6, seccomp: {seccomp}"
                ));
                continue;
            }
            let good = if *may {
                error == 0
            } else {
                refusals.contains(&error)
            };
            check(
                good,
                format!("{kind}: {name}: {}", io::Error::from_raw_os_error(error)),
            );
        }
    }
    if Path::new("/usr/bin/python3").exists() {
        let (free, confined) = (calls(false), calls(true));
        for ((free, name), (confined, _)) in free.iter().zip(&confined) {
            let good = if name == "getpid" {
                *confined == 0
            } else {
                *confined == libc::EPERM
            };
            check(
                good && free != &libc::ENOSYS,
                format!("{name}: free {free}, confined {confined}"),
            );
        }
        check(
            free.len() == 13 && confined.len() == 13,
            "all calls were made".to_owned(),
        );
    } else {
        shared_data::note_missing("python3 is not installed");
    }
    ExitCode::from(u8::from(failed > 0))
}
