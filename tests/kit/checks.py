"""Checks that have nothing in common: each runs in a process, a network namespace and a folder of its own."""

import ctypes
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import traceback

from . import load, processes

NEW_NETWORK = 0x4000_0000  # CLONE_NEWNET of sched.h
NEW_MOUNTS = 0x0002_0000  # CLONE_NEWNS
NOT_PERMITTED = 1  # EPERM


def own_network():
    """A network of this process with nothing but loopback, which carries multicast. Without the rights for one the process stays where it is."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(NEW_NETWORK) != 0:
        assert ctypes.get_errno() == NOT_PERMITTED, os.strerror(ctypes.get_errno())
        return
    for words in ("link set lo up multicast on", "route add 224.0.0.0/4 dev lo"):
        subprocess.run(["ip", *words.split()], check=True)


def own_mounts():
    """File systems that are mounted from now on are those of this process and of what it starts, and go with them. Needs root."""
    libc = ctypes.CDLL(None, use_errno=True)
    assert libc.unshare(NEW_MOUNTS) == 0, os.strerror(ctypes.get_errno())
    subprocess.run(["mount", "--make-rprivate", "/"], check=True)


def own_places(folder):
    """Keys of cells and operators, and private sockets of routers, are those of the test, and its processes bear its mark."""
    for name, place in (("XDG_CONFIG_HOME", "config"), ("XDG_STATE_HOME", "state")):
        os.environ[name] = str(pathlib.Path(folder).resolve() / place)
    os.environ[load.MARK] = f"{os.getpid()} {folder}"


def end_all():
    """Kills what a test has left behind; how much of it there was."""
    left = load.processes() - {os.getpid()}
    for one in left:
        try:
            os.kill(one, signal.SIGKILL)
        except ProcessLookupError:
            pass
    return len(left)


def guarded(function, *arguments):
    """Carries out a test in this process; whether it holds. When it does not, the state of its processes is shown."""
    processes.show_again()
    try:
        function(*arguments)
        return True
    except SystemExit as end:
        if end.code in (None, 0):
            return True
        processes.state()
        print(end.code, file=sys.stderr, flush=True)
    except BaseException:
        processes.state()
        traceback.print_exc()
    return False


def apart(check, *arguments):
    """Whether a check holds, carried out in a process of its own with a network, keys and sockets of its own. The first argument is its folder."""
    load.at_start()
    sys.stdout.flush()
    sys.stderr.flush()
    number = os.fork()
    if number == 0:
        code = 1
        try:
            own_network()
            own_places(arguments[0])
            code = 0 if guarded(check, *arguments) else 1
            end_all()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(number, 0)[1]) == 0


def new_folder():
    """A folder that is removed in the end, with a path so short that sockets can be in it."""
    return tempfile.TemporaryDirectory(prefix="pc_", ignore_cleanup_errors=True)


def main(checks, wanted=()):
    """Carries out checks by name, all or those wanted, one after the other, until one does not hold."""
    for name in wanted or checks:
        with new_folder() as folder:
            if not apart(checks[name], pathlib.Path(folder)):
                raise SystemExit(f"FAILED: {name}")
        print(f"{name}: good", flush=True)
