"""What must hold of the recordings of a session, whatever was done to the cell. Read by libraries that are not ours."""

import collections
import json

import kit
from kit.recordings import decoded

APPLIED = 0
SIGNED_BY = (1, 2)  # policy, operator
WEAR_LIMIT = 0.110e-3  # m, of the cell file
TOPICS = ("probe_triggers", "probe_events", "corrections", "correction_acknowledgements", "part_reports", "part_status")


def messages(bag):
    """Messages of topics of the cell; a latched one that stands twice is one."""
    found = {topic: {} for topic in TOPICS}
    for channel, raw, message in decoded(bag, [f"/turn_mill/{topic}" for topic in TOPICS]):
        topic = channel.topic.removeprefix("/turn_mill/")
        found[topic][raw.publish_time, raw.sequence, bytes(raw.data)] = message
    return {topic: list(known.values()) for topic, known in found.items()}


def stamp(message):
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


class Judge:
    """Of one session; what it counts goes into `figures`."""

    def __init__(self, binary, session, figures):
        self.binary, self.session, self.figures = binary, session, figures
        self.reports, self.applied = {}, {}

    def tell(self, *words):
        return kit.run(self.binary, *words, folder=self.session.folder, environment=self.session.environment, seconds=300)

    def all(self, accepted, orderly):
        """Every recording, and what they say together."""
        bags = sorted((self.session.folder / "recordings").glob("*/"))
        bags = [bag for bag in bags if any(bag.glob("*.mcap"))]
        for bag in bags:
            self.bag(bag, accepted, orderly)
        counted = collections.Counter(name for _, name in self.applied)
        assert all(count == 1 for count in counted.values()), ("a correction twice", counted)
        self.figures["corrections written"] += len(counted)
        self.figures["reports recorded"] += len(self.reports)
        unasked = set(self.reports) - set(accepted)
        assert not unasked, ("a part that nobody was told of", unasked)
        if orderly:
            missing = [name for name in accepted if name not in self.reports]
            assert not missing, ("no report recorded", missing)

    def bag(self, bag, accepted, orderly):
        code, output, errors = self.tell("replay", bag)
        assert code in (0, 3) and "DIFFERENT" not in output, ("replay", code, output[-2000:], errors[-2000:])
        self.figures["replays equal" if code == 0 else "replays incomplete, and said so"] += 1
        code, output, errors = self.tell("info", bag, "--verify", "--json")
        assert code in (0, 3), ("info", code, output[-1000:], errors[-1000:])
        info = json.loads(output)
        unindexed, whole = bool(info["damage"]), bag
        if unindexed:
            # What a killed recorder leaves has no index; readers of others need one.
            assert not orderly, ("damaged", info["damage"])
            whole = self.session.folder / f"whole_{bag.name}"
            code, output, errors = self.tell("recover", bag, whole)
            assert code in (0, 3), ("recover", code, output, errors)
            self.figures["recordings cut off and recovered"] += 1
        elif orderly:
            seals = info["seals"]
            assert seals["ended"] and not seals["changes"] and seals["key"], seals
            self.figures["seals verified"] += 1
        read = messages(whole)
        lacks = {one["topic"].removeprefix("/turn_mill/"): one["losses"] for one in info["topics"]}
        known = lambda topic: sum(lacks[topic][kind] for kind in ("queue", "bus")) - lacks[topic]["recovered"] if topic in lacks else 0
        self.touches(read, known, unindexed)
        self.corrections(read, accepted, known("probe_events") or unindexed)

    def touches(self, read, known, unindexed):
        """Triggers against events, by the numbers of the driver's sessions."""
        triggers = [(one.session, one.sequence) for one in read["probe_triggers"]]
        events = [(one.plan_id, one.sequence, stamp(one)) for one in read["probe_events"]]
        self.figures["triggers"] += len(triggers)
        self.figures["events"] += len(events)
        assert len(events) == len({event[:2] for event in events}), "an event twice"
        assert len(triggers) == len(set(triggers)), "a trigger twice"
        # Between the first and the last number of a session none is missing but what the recording says it lacks.
        numbers = collections.defaultdict(set)
        for session, number in triggers:
            numbers[session].add(number)
        missing = sum(max(own) - min(own) + 1 - len(own) for own in numbers.values())
        self.figures["triggers that the recording says it lacks"] += missing
        assert missing <= known("probe_triggers") or unindexed, ("triggers lost without a number", missing, known("probe_triggers"))
        by_event = {(one.plan_id, one.sequence): one for one in read["probe_triggers"]}
        orphans = [event for event in events if event[:2] not in by_event]
        assert len(orphans) <= known("probe_triggers") or unindexed, ("events without triggers", orphans)
        for plan, number, at in events:
            trigger = by_event.get((plan, number))
            assert trigger is None or stamp(trigger) == at, ("an event of another trigger", plan, number)
        lost = set(by_event) - {event[:2] for event in events}
        self.figures["triggers without event"] += len(lost)
        faults = self.session.faults
        # With its process; or not recorded, which the recording says; or with the bus.
        blamed = any("probe_events" in one or one.startswith(("end", "cut", "kill router")) for one in faults)
        assert len(lost) <= known("probe_events") or blamed or unindexed, ("events lost", lost)

    def corrections(self, read, accepted, lacks_touches):
        touched = {(one.plan_id, one.sequence) for one in read["probe_events"]}
        approved = collections.defaultdict(list)
        for one in read["corrections"]:
            if one.approval in SIGNED_BY:
                approved[one.correction_id].append(one)
        self.reports |= {one.part_id: stamp(one) for one in read["part_reports"]}
        living = {one.run_id for one in read["part_status"]}
        for one in read["correction_acknowledgements"]:
            if one.outcome != APPLIED:
                continue
            self.applied[stamp(one), one.correction_id] = one
            source, name = approved[one.correction_id], one.correction_id
            assert source and all(len(bytes(other.signature)) == 64 for other in source), ("unsigned", name)
            assert all(other.lower_bound <= one.value_after <= other.upper_bound for other in source), ("out of bounds", name)
            assert abs(one.value_after) <= WEAR_LIMIT, ("out of the bounds of the cell", name)
            sources = {(other.plan_id, number) for other in source for number in other.sequences}
            assert sources and (lacks_touches or sources <= touched), ("without its touches", name)
            run = name.split("/")[0]
            assert run.split("#")[0] in accepted, ("without a part", name)
            assert run in living, ("for a part that was not being made", name)
            part = run.split("#")[0]
            assert part not in self.reports or stamp(one) <= self.reports[part], ("late", name)
