"""What the tests share that start processes: deadlines that follow the machine, waits on what happens, checks that have nothing in common."""

from .checks import apart, guarded, main, new_folder, own_mounts, own_places
from .disks import Disk
from .hosts import Cable, Host
from .load import Deadline, Load, patience, processes
from .processes import PATIENCE, Late, Process, child, free_port, happened, late, pause, paused, run, state, until

__all__ = [
    "PATIENCE", "Cable", "Deadline", "Disk", "Host", "Late", "Load", "Process", "apart", "child", "free_port", "guarded", "happened", "late", "main",
    "new_folder", "own_mounts", "own_places", "patience", "pause", "paused", "processes", "run", "state", "until",
]
