#!/usr/bin/env bash
# boot.sh TREE INIT...: runs INIT as process 1 of TREE, in namespaces of its own; its network has lo alone. Says "inside" before.
# To be run in a mount namespace of its own; what it mounts goes with that.
set -euo pipefail

inside() {
  local tree=$1 node; shift
  mount --bind "$tree" "$tree"
  mount -t proc proc "$tree/proc"
  mount -t sysfs -o ro sysfs "$tree/sys"
  mount -t tmpfs -o mode=755 tmpfs "$tree/run"
  mount -t tmpfs tmpfs "$tree/tmp"
  mount -t tmpfs -o mode=755 tmpfs "$tree/dev"
  mkdir "$tree/dev/pts" "$tree/dev/shm"
  for node in null zero full random urandom tty; do
    touch "$tree/dev/$node"
    mount --bind "/dev/$node" "$tree/dev/$node"
  done
  mount -t devpts -o newinstance,ptmxmode=0666 devpts "$tree/dev/pts"
  ln -s pts/ptmx "$tree/dev/ptmx"
  ln -s /proc/self/fd "$tree/dev/fd"
  mount -t tmpfs -o mode=1777 tmpfs "$tree/dev/shm"
  if [ -n "${GROUPS_OF:-}" ]; then
    mount -t tmpfs tmpfs "$tree/sys/fs/cgroup" # hides what the kernel has mounted there
    mount -t cgroup2 none "$tree/sys/fs/cgroup"
  fi
  ip link set lo up
  cd "$tree"
  pivot_root . mnt
  umount -l /mnt
  echo inside
  # What systemd calls a container: it leaves the hardware alone.
  exec env -i container=check PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin "$@"
}

if [ "$1" = --inside ]; then
  shift
  inside "$@"
fi

# Control groups of its own, where the kernel has version 2 of them.
groups=$1.groups
mkdir -p "$groups"
export GROUPS_OF=
if mount -t cgroup2 none "$groups"; then
  GROUPS_OF=$groups/probecell-check-$$
  mkdir "$GROUPS_OF"
fi
status=0
(
  [ -z "$GROUPS_OF" ] || echo "$BASHPID" >"$GROUPS_OF/cgroup.procs"
  exec setpriv --pdeathsig=KILL unshare --fork --kill-child=SIGKILL --pid --mount --net --uts --ipc --cgroup --propagation private bash "$0" --inside "$@"
) || status=$?
[ -z "$GROUPS_OF" ] || find "$GROUPS_OF" -depth -type d -exec rmdir {} \;
exit "$status"
