#!/usr/bin/env bash
# A cell on one host, its recorder on another, a router between (three network namespaces made here). The link to the
# recorder is cut for ten seconds while the part is measured. No probe event may be missing from the bag; what is lost
# of the unbounded streams (axis samples) must be reported by number.
# Usage: run.sh PROBECELL  (needs root, iproute2, python3)
set -euo pipefail
probecell=$(realpath "$1")
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../.." && pwd)
work=$(mktemp -d)
id=$$
cell_host=pc-cell-$id router_host=pc-router-$id recorder_host=pc-rec-$id

cleanup() {
  for host in "$cell_host" "$router_host" "$recorder_host"; do
    ip netns pids "$host" 2>/dev/null | xargs -r kill 2>/dev/null || true
    ip netns del "$host" 2>/dev/null || true
  done
  rm -rf "$work"
}
trap cleanup EXIT

for host in "$cell_host" "$router_host" "$recorder_host"; do
  ip netns add "$host"
  ip -n "$host" link set lo up
done
join() { # HOST NAME SUBNET
  ip link add "$2-$id" netns "$1" type veth peer name "r$2-$id" netns "$router_host"
  ip -n "$1" addr add "$3.1/24" dev "$2-$id"
  ip -n "$router_host" addr add "$3.2/24" dev "r$2-$id"
  ip -n "$1" link set "$2-$id" up
  ip -n "$router_host" link set "r$2-$id" up
}
join "$cell_host" c 10.77.1
join "$recorder_host" b 10.77.2

cell_file() { # ROUTER_ADDRESS FILE
  sed "s#tcp/127.0.0.1:7447#tcp/$1:7447#" "$root/launch-scripts/turn_mill.toml" >"$work/$2.toml"
}
cp "$root/launch-scripts/turn_mill.urdf" "$work/"
cell_file 10.77.1.2 cell
cell_file 10.77.2.2 recorder

wait_for() { # COMMAND…: until it succeeds, at most 30 s
  for _ in $(seq 300); do "$@" >/dev/null 2>&1 && return 0; read -rt 0.1 <> <(:) || true; done
  echo "gave up waiting for: $*"; return 1
}

ip netns exec "$router_host" "$probecell" router --strangers write --listen tcp/10.77.1.2:7447 \
  --listen tcp/10.77.2.2:7447 \
  >"$work/router.log" 2>&1 &
wait_for grep -q "listens on" "$work/router.log"
ip netns exec "$recorder_host" "$probecell" record --cell "$work/recorder.toml" --folder "$work/bag" \
  >"$work/recorder.log" 2>&1 &
recorder=$!
wait_for test -e "$work/bag/bag_0.mcap"
ip netns exec "$cell_host" "$probecell" up "$work/cell.toml" --once --no-record >"$work/cell.log" 2>&1 &
cell=$!

# The first measurement is on when the first correction-relevant command has been seen: cut the link then, for 10 s.
measuring() { ip netns exec "$router_host" grep -q . /proc/net/tcp && [ "$(stat -c %s "$work/bag/bag_0.mcap")" -gt 200000 ]; }
wait_for measuring
ip -n "$router_host" link set "rb-$id" down
sleep 10
ip -n "$router_host" link set "rb-$id" up

wait "$cell" || { cat "$work/cell.log"; exit 1; }
# What was fetched late arrives within the patience of the recovery.
sleep 12
kill -TERM "$(ip netns pids "$recorder_host" | head -1)"
wait "$recorder" || status=$?
cat "$work/recorder.log"
"$probecell" info "$work/bag" --json >"$work/info.json" || true
python3 - "$work/info.json" "$work/cell.log" "${status:-0}" <<'P'
import json, sys
info = json.load(open(sys.argv[1]))
topics = {t["topic"]: t for t in info["topics"]}
def missing(t): return t["losses"]["queue"] + t["losses"]["bus"] - t["losses"]["recovered"]
for name in ["probe_events", "probe_triggers", "inspection_plan", "feature_results", "verdicts", "corrections",
             "pass_decisions", "part_reports", "machine_state/steps"]:
    t = topics["/turn_mill/" + name]
    print(f"{name}: {t['messages']} recorded, {missing(t)} missing")
    assert missing(t) == 0, name
assert topics["/turn_mill/probe_events"]["messages"] == 96, "every touch of three measurements of 32"
lost = sum(missing(t) for t in info["topics"])
print(f"{lost} messages of other topics reported lost")
assert lost > 0, "a cut of ten seconds costs axis samples: not to report them would be a lie"
assert int(sys.argv[3]) == 3, "a recording with loss ends with status 3"
P
grep -q "from number" "$work/recorder.log"
echo "two hosts: good"
