"""Disks of a recording that are full, slow, refuse what was written when it is to be synced, go away or hang. Needs root and a mount
namespace."""

import fcntl
import os
import pathlib
import struct
import subprocess

SHUTDOWN = 0x8004587D  # EXT4_IOC_SHUTDOWN of linux/ext4.h
WITH_JOURNAL = 1  # EXT4_GOING_FLAGS_LOGFLUSH: what was synced is there when it is mounted again
THROTTLE = pathlib.Path("/sys/fs/cgroup/blkio/blkio.throttle.write_bps_device")


def ran(*words):
    told = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    assert told.returncode == 0, (words, told.stdout, told.stderr)
    return told.stdout.strip()


class Disk:
    """The file system below a folder; `kind` is `sound`, `loop`, `quota`, `small`, `slow` or `refusing`."""

    def __init__(self, kind, folder, random=None):
        self.kind, self.folder, self.mounts, self.device, self.bandwidth = kind, folder, [], None, None
        if kind == "sound":
            return
        folder.mkdir()
        if kind == "loop":
            self.on_loop(folder, None, "64M")
            (folder / "lost+found").rmdir()
        elif kind == "quota":
            # Btrfs, whose quota of a subvolume binds root as well.
            self.on_loop(folder, None, "256M", ["mkfs.btrfs", "-q"], [])
            ran("btrfs", "quota", "enable", folder)
        elif kind == "small":
            # A write says that there is no space left.
            self.mount("-t", "tmpfs", "-o", f"size={random.randint(600, 2500)}k", "tmpfs", folder)
        elif kind == "slow":
            self.on_loop(folder, None, "64M")
            if THROTTLE.exists():  # cgroup v1: a limit for the whole device, the journal of its file system included
                self.bandwidth = random.randint(60_000, 400_000)
                self.throttle(self.bandwidth)
        elif kind == "refusing":
            # Writes go to the page cache and succeed; the device has no room for them when they are synced.
            self.on_loop(folder, random.randint(1_000, 3_500), "64M")
        else:
            raise ValueError(kind)

    def mount(self, *words):
        ran("mount", *words)
        self.mounts.append(words[-1])

    def on_loop(self, folder, room, size, make=None, options=("-o", "errors=continue")):
        """A file system in a sparse file, ext4 unless it is told; `room`: KiB that the file may really take."""
        below = folder.parent / "below"
        below.mkdir()
        if room is not None:
            self.mount("-t", "tmpfs", "-o", f"size={room}k", "tmpfs", below)
        image = below / "image"
        ran("truncate", "-s", size, image)
        journal = [] if room is None else ["-O", "^has_journal"]
        ran(*(make or ["mkfs.ext4", "-q", "-F", *journal, "-E", "lazy_itable_init=1"]), image)
        self.device = ran("losetup", "--find", "--show", image)
        self.mount(*options, self.device, folder)

    def throttle(self, bandwidth):
        """Bytes a second; 0: without a limit."""
        number = ran("lsblk", "-dno", "MAJ:MIN", self.device)
        THROTTLE.write_text(f"{number} {bandwidth}\n")

    def unplug(self):
        """As if the device had gone."""
        descriptor = os.open(self.folder, os.O_RDONLY)
        try:
            fcntl.ioctl(descriptor, SHUTDOWN, struct.pack("I", WITH_JOURNAL))
        finally:
            os.close(descriptor)

    def err(self):
        """The file system finds an error and is read-only from then on."""
        ran("mount", "-o", "remount,errors=remount-ro", self.folder)
        pathlib.Path(f"/sys/fs/ext4/{pathlib.Path(self.device).name}/trigger_fs_error").write_text("1")

    def limit(self):
        """What the quota allows is nearly used."""
        ran("sync", "-f", self.folder)
        used = sum(file.stat().st_blocks * 512 for file in self.folder.rglob("*"))
        ran("btrfs", "qgroup", "limit", used + (1 << 17), self.folder)

    def hang(self, hangs):
        ran("fsfreeze", "--freeze" if hangs else "--unfreeze", self.folder)

    def unmount(self):
        ran("umount", "-l", self.folder)
        self.mounts.remove(self.folder)

    def mount_again(self):
        """What is on the disk, after an end that nobody could prepare."""
        if self.folder in self.mounts:
            self.unmount()
        self.mount(self.device, self.folder)

    @property
    def is_sound(self):
        """All that is written is kept, sooner or later."""
        return self.kind in ("sound", "slow")

    def heal(self):
        """As fast as it can, so that what is written can be read."""
        if self.bandwidth:
            self.throttle(0)
            self.bandwidth = None

    def close(self):
        self.heal()
        for folder in reversed(self.mounts[1:] if self.kind == "refusing" else self.mounts):
            subprocess.run(["umount", "-l", folder], check=True)
        if self.device:
            subprocess.run(["losetup", "-d", self.device], check=True)
        if self.kind == "refusing":
            subprocess.run(["umount", "-l", self.mounts[0]], check=True)
