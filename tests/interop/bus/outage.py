"""Two machines and a router between them; the publisher's link is down for a while.

Nothing may be lost where the publisher's cache is deep enough, and where it is not, every lost message must be told by
number: what came and what is told lost make up all that was published. Machines are network namespaces, links are
veth pairs.
"""

import argparse
import time

from peer import Peer, check, kit

PERIOD_MS = 10
OUTAGE_S = 10.0
TYPE = "probecell_msgs/msg/ProbeEvent"


def run(program, depth, count):
    """Publishes `count` messages while the link is cut; the numbers that came, and those told lost."""
    left, middle, right = kit.Host(), kit.Host(), kit.Host()
    cut, whole = kit.Cable(middle, left, 1), kit.Cable(middle, right, 2)
    with (
        Peer(program, "router", host=middle, listen="tcp/0.0.0.0:7447"),
        Peer(program, "taker", host=right, endpoint=f"tcp/{whole.addresses[0]}:7447") as taker,
        Peer(program, "giver", host=left, endpoint=f"tcp/{cut.addresses[0]}:7447", depth=depth) as giver,
    ):
        taker.ask("subscribed", "subscribe", "/cell/probe_events", TYPE, "events")
        giver.ask("gid", "offer", "/cell/probe_events", TYPE, "events")
        check("found", giver.ask("found", "await", "/cell/probe_events", 1)["found"], True)
        start = time.monotonic()
        giver.tell("flood", "/cell/probe_events", TYPE, "events", count, PERIOD_MS)
        taker.take("sample", lambda sample: sample["number"] == 100)
        gone = time.monotonic()
        cut.pull()
        kit.pause(OUTAGE_S, "the outage")
        cut.plug()
        back = time.monotonic()
        giver.take("flooded")
        done = time.monotonic()
        came, lost = {100}, set()
        order = []
        while len(came | lost) < count:
            item = taker.take_any(("sample", "lost"))
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
            f"    {count} published, link down {back - gone:.1f} s, {len(came)} came, {len(lost)} told lost, complete "
            f"{max(0.0, complete - max(back, done)):.1f} s after link and publishing, {complete - start:.1f} s in all"
        )
        return came, lost


def main(_):
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
    kit.main({"outage": main})
