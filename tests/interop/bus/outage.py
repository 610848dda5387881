"""Two machines and a router between them; the publisher's link is down for a while.

Nothing may be lost where the publisher's cache is deep enough, and where it is not, every lost message must be told by
number: what came and what is told lost make up all that was published. Machines are network namespaces, links are
veth pairs. The sleep below is the outage.
"""

import argparse
import subprocess
import time

from peer import Peer, check

PERIOD_MS = 10
OUTAGE_S = 10.0
TYPE = "probecell_msgs/msg/ProbeEvent"


def ip(*words):
    subprocess.run(["ip", *words], check=True)


class Machines:
    """Namespaces `left`, `middle`, `right`, wired in a row; made in a namespace of our own, so that names are free."""

    def __enter__(self):
        for name in ("left", "middle", "right"):
            ip("netns", "add", f"bus_{name}")
            ip("-n", f"bus_{name}", "link", "set", "lo", "up")
        for number, side in ((1, "left"), (2, "right")):
            ip("link", "add", side, "netns", "bus_middle", "type", "veth", "peer", "name", "middle", "netns", f"bus_{side}")
            ip("-n", "bus_middle", "addr", "add", f"10.77.{number}.1/24", "dev", side)
            ip("-n", f"bus_{side}", "addr", "add", f"10.77.{number}.2/24", "dev", "middle")
            ip("-n", "bus_middle", "link", "set", side, "up")
            ip("-n", f"bus_{side}", "link", "set", "middle", "up")
        return self

    def __exit__(self, *_):
        for name in ("left", "middle", "right"):
            subprocess.run(["ip", "netns", "del", f"bus_{name}"], check=False)

    @staticmethod
    def link(state):
        ip("-n", "bus_middle", "link", "set", "left", state)


def run(program, depth, count):
    """Publishes `count` messages while the link is cut; the numbers that came, and those told lost."""
    with (
        Machines() as machines,
        Peer(program, "router", netns="bus_middle", listen="tcp/0.0.0.0:7447"),
        Peer(program, "taker", netns="bus_right", endpoint="tcp/10.77.2.1:7447") as taker,
        Peer(program, "giver", netns="bus_left", endpoint="tcp/10.77.1.1:7447", depth=depth) as giver,
    ):
        taker.ask("subscribed", "subscribe", "/cell/probe_events", TYPE, "events")
        giver.ask("gid", "offer", "/cell/probe_events", TYPE, "events")
        check("found", giver.ask("found", "await", "/cell/probe_events", 1)["found"], True)
        start = time.monotonic()
        giver.tell("flood", "/cell/probe_events", TYPE, "events", count, PERIOD_MS)
        taker.take("sample", lambda sample: sample["number"] == 100)
        machines.link("down")
        cut = time.monotonic()
        time.sleep(OUTAGE_S)
        machines.link("up")
        back = time.monotonic()
        giver.take("flooded", patience=120)
        done = time.monotonic()
        came, lost = {100}, set()
        order = []
        while len(came | lost) < count:
            item = taker.take_any(("sample", "lost"), patience=60)
            if "sample" in item:
                check("twice", item["number"] in came and item["number"] != 100, False)
                came.add(item["number"])
                order.append(item["number"])
            else:
                lost |= set(range(item["first"], item["first"] + item["count"]))
        complete = time.monotonic()
        check("order", order, sorted(order))
        check("both came and told lost", came & lost, set())
        print(
            f"    {count} published, link down {back - cut:.1f} s, {len(came)} came, {len(lost)} told lost, complete "
            f"{max(0.0, complete - max(back, done)):.1f} s after link and publishing, {complete - start:.1f} s in all"
        )
        return came, lost


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--peer", required=True, help="the example program bus_peer")
    options = parser.parse_args()
    count = 2000
    came, lost = run(options.peer, depth=10_000, count=count)
    check("lost with a deep cache", lost, set())
    check("came with a deep cache", came, set(range(1, count + 1)))
    print("ok  A cut of 10 s loses nothing.")
    came, lost = run(options.peer, depth=50, count=count)
    check("everything accounted for", came | lost, set(range(1, count + 1)))
    check("a cache of 50 cannot bridge the cut", len(lost) > 0, True)
    print("ok  What a cache too small has forgotten is told by number.")


if __name__ == "__main__":
    main()
