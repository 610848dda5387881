"""Our bus on DDS against Cyclone DDS (Python): every type of the contract both ways, late joiners, services, discovery.

The IDL types of Cyclone are made here from the .msg files as rosbags reads them, without our code. Runs inside a
network namespace whose loopback carries multicast.
"""

import argparse
import contextlib
import dataclasses
import os
import subprocess
import sys

os.environ.setdefault(
    "CYCLONEDDS_URI",
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo' multicast='true'/></Interfaces></General>"
    "</Domain></CycloneDDS>",
)

import numpy  # noqa: E402
from cyclonedds.core import Policy, Qos  # noqa: E402
from cyclonedds.domain import DomainParticipant  # noqa: E402
from cyclonedds.idl import IdlStruct, make_idl_struct, types  # noqa: E402
from cyclonedds.idl.annotations import final  # noqa: E402
from cyclonedds.pub import DataWriter  # noqa: E402
from cyclonedds.sub import DataReader  # noqa: E402
from cyclonedds.topic import Topic  # noqa: E402
from cyclonedds.util import duration  # noqa: E402
from rosbags.interfaces import Nodetype  # noqa: E402

from messages import CONTRACT, Messages  # noqa: E402
from peer import Peer, check, kit  # noqa: E402

SERVICE = "probecell_msgs/srv/StartRecording"


class Idl:
    """Cyclone's types for ROS messages, and values carried from one to the other."""

    def __init__(self, messages):
        self.messages = messages
        self.made = {}

    def type(self, name, extra=()):
        """The struct of a message; `extra` fields come first."""
        if name not in self.made:
            fields = dict(extra)
            fields.update({key: self._field(field) for key, field in self.messages.fields(name)})
            short = name.rsplit("/", 1)[1]
            self.made[name] = final(make_idl_struct(short, self.messages.dds(name), fields))
        return self.made[name]

    def _field(self, field):
        kind, detail = field
        if kind == Nodetype.BASE:
            return {"string": str, "bool": bool}.get(detail[0]) or getattr(types, {"byte": "uint8"}.get(detail[0], detail[0]))
        if kind == Nodetype.NAME:
            return self.type(detail)
        item, count = detail
        if kind == Nodetype.ARRAY:
            return types.array[self._field(item), count]
        return types.sequence[self._field(item)]

    def to_idl(self, value, name, extra=()):
        fields = {key: self._to_idl(getattr(value, key)) for key, _ in self.messages.fields(name)}
        return self.type(name, extra)(**fields)

    def _to_idl(self, value):
        if isinstance(value, numpy.ndarray):
            return value.tolist()
        if isinstance(value, list):
            return [self._to_idl(item) for item in value]
        if dataclasses.is_dataclass(value):
            return self.to_idl(value, value.__msgtype__)
        return value

    def from_idl(self, value, name):
        return self.messages.store.types[name](
            **{key: self._from_idl(getattr(value, key), field) for key, field in self.messages.fields(name)}
        )

    def _from_idl(self, value, field):
        kind, detail = field
        if kind == Nodetype.NAME:
            return self.from_idl(value, detail)
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            item = detail[0]
            if item[0] == Nodetype.BASE and item[1][0] != "string":
                return numpy.array(list(value), dtype=item[1][0])
            return [self._from_idl(part, item) for part in value]
        return value


def policies(qos):
    """The profile of ROS that our spelling stands for."""
    kind, _, depth = qos.partition(":")
    latched = kind == "latched"
    return Qos(
        # What a late joiner gets is this policy's history, as the middleware of ROS sets it.
        *([Policy.DurabilityService(0, Policy.History.KeepLast(int(depth)), -1, -1, -1)] if latched else []),
        Policy.Reliability.BestEffort if kind == "best_effort" else Policy.Reliability.Reliable(duration(seconds=1)),
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepAll if kind == "events" else Policy.History.KeepLast(int(depth)),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


class Cyclone:
    def __init__(self, messages):
        self.participant = DomainParticipant(0)
        self.idl = Idl(messages)

    def writer(self, topic, ty, qos):
        return DataWriter(self.participant, Topic(self.participant, topic, ty), qos=policies(qos))

    def reader(self, topic, ty, qos):
        return DataReader(self.participant, Topic(self.participant, topic, ty), qos=policies(qos))


def take(reader, count=1, what="a sample"):
    samples = []

    def enough():
        samples.extend(reader.take(N=count - len(samples)))
        return len(samples) >= count

    kit.until(f"{count} of {what}", enough)
    return samples


def unpadded(found, wanted):
    """DDS fills a payload up to four bytes."""
    found = bytes.fromhex(found)
    filling = found[len(wanted):]
    return found[: len(wanted)] if len(filling) < 4 and not any(filling) else found


def both_ways(program, cyclone, messages):
    """Every type of the contract, from us to Cyclone and from Cyclone to us."""
    with Peer(program, "dds_peer", transport="dds", namespace="/cell") as ours:
        for topic, name, qos in CONTRACT:
            ty = cyclone.idl.type(name)
            reader = cyclone.reader(f"rt/cell/{topic}_out", ty, qos)
            ours.ask("gid", "offer", f"/cell/{topic}_out", name, qos)
            check("found", ours.ask("found", "await", f"/cell/{topic}_out", 1)["found"], True)
            kit.until("a match", lambda: reader.get_matched_publications())
            message = messages.random(name, 20)
            came = []

            def reaches():
                # Cyclone has matched; whether our writer has is not told.
                ours.ask("published", "publish", f"/cell/{topic}_out", name, qos, messages.encode(message, name).hex())
                came.extend(reader.take(N=1))
                return came

            kit.until(f"{name} of {qos}", reaches)
            (found,) = came
            check(f"{name} as taken by Cyclone", messages.encode(cyclone.idl.from_idl(found, name), name),
                  messages.encode(message, name))
            check("source time, ns", found.sample_info.source_timestamp, 42)

            ours.ask("subscribed", "subscribe", f"/cell/{topic}_in", name, qos)
            writer = cyclone.writer(f"rt/cell/{topic}_in", ty, qos)
            kit.until("a match", lambda: writer.get_matched_subscriptions())
            message = messages.random(name, 21)
            # Cyclone has matched; whether we have is not told, so volatile topics are written until one arrives.
            got = {}

            def arrives():
                writer.write(cyclone.idl.to_idl(message, name))
                got["sample"] = ours.look(("sample",), lambda sample: sample["sample"] == f"/cell/{topic}_in")
                return got["sample"]

            kit.until(f"{name} from Cyclone", arrives)
            again = messages.decode(bytes.fromhex(got["sample"]["cdr"]), name)
            check(f"{name} as published by Cyclone", messages.encode(again, name), messages.encode(message, name))
            del reader, writer


def late_joiners(program, cyclone, messages):
    """A latched topic gives a late joiner exactly the last samples, both ways."""
    name = "std_msgs/msg/String"
    ty = cyclone.idl.type(name)
    texts = [f"state {number}" for number in range(6)]
    with Peer(program, "latcher", transport="dds", namespace="/cell") as ours:
        # A publication is on its way when it is acknowledged; when a reader before the late one has the last of them (of a
        # topic that keeps three it need not get all), none is.
        ours.ask("gid", "offer", "/cell/latched_out", name, "latched:3")
        witness = cyclone.reader("rt/cell/latched_out", ty, "events")
        check("found", ours.ask("found", "await", "/cell/latched_out", 1)["found"], True)
        kit.until("a match", lambda: witness.get_matched_publications())
        for text in texts:
            cdr = messages.encode(messages.store.types[name](data=text), name)
            ours.ask("published", "publish", "/cell/latched_out", name, "latched:3", cdr.hex())
        while take(witness)[0].data != texts[-1]:
            pass
        reader = cyclone.reader("rt/cell/latched_out", ty, "latched:3")
        check("history of ours", [sample.data for sample in take(reader, 3)], texts[3:])
        writer = cyclone.writer("rt/cell/latched_in", ty, "latched:3")
        for text in texts:
            writer.write(ty(data=text))
        ours.ask("subscribed", "subscribe", "/cell/latched_in", name, "latched:3")
        found = [messages.decode(bytes.fromhex(ours.take("sample")["cdr"]), name).data for _ in range(3)]
        check("history of theirs", found, texts[3:])
        writer.write(ty(data="what follows"))
        follows = messages.decode(bytes.fromhex(ours.take("sample")["cdr"]), name).data
        check("what follows", follows, "what follows")


def bursts(program, cyclone, messages):
    """A topic that keeps all loses nothing of a burst, both ways."""
    name, count = "std_msgs/msg/String", 1000
    ty = cyclone.idl.type(name)
    texts = [f"event {number}" for number in range(count)]
    with Peer(program, "bursting", transport="dds", namespace="/cell") as ours:
        ours.ask("gid", "offer", "/cell/burst_out", name, "events")
        reader = cyclone.reader("rt/cell/burst_out", ty, "events")
        check("found", ours.ask("found", "await", "/cell/burst_out", 1)["found"], True)
        kit.until("a match", lambda: reader.get_matched_publications())

        def tell(text):
            cdr = messages.encode(messages.store.types[name](data=text), name)
            ours.tell("publish", "/cell/burst_out", name, "events", cdr.hex())

        # Whether our writer has matched too is not told: write until one arrives, then the burst.
        def heard():
            tell("knock")
            return reader.take(N=1)

        kit.until("a first sample", heard)
        for text in texts:
            tell(text)
        found = []
        while len(found) < count:
            found += [sample.data for sample in take(reader, what=f"a burst after {len(found)}") if sample.data != "knock"]
        check("burst of ours", found, texts)

        # The same from the other side.
        ours.ask("subscribed", "subscribe", "/cell/burst_in", name, "events")
        writer = cyclone.writer("rt/cell/burst_in", ty, "events")
        kit.until("a match", lambda: writer.get_matched_subscriptions())

        own = lambda sample: sample["sample"] == "/cell/burst_in"

        def taken():
            return messages.decode(bytes.fromhex(ours.take("sample", own)["cdr"]), name).data

        def hears():
            writer.write(ty(data="knock"))
            return ours.look(("sample",), own)

        kit.until("a first sample", hears)
        for text in texts:
            writer.write(ty(data=text))
        while (first := taken()) == "knock":
            pass
        check("burst of theirs", [first] + [taken() for _ in texts[1:]], texts)


@contextlib.contextmanager
def busy(processes):
    """So many processes that want the processor all the time."""
    spinning = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(processes)]
    try:
        yield
    finally:
        for process in spinning:
            process.kill()
            process.wait()


def departures(program, messages):
    """On a busy machine the last samples of a writer that leaves at once reach our reader.

    Without its stay after the last acknowledgement some were lost in 17 of 25 rounds.
    """
    name, rounds, topics, count = "std_msgs/msg/String", 6, range(8), 11
    burst = [messages.encode(messages.store.types[name](data=f"last {number}"), name).hex() for number in range(count)]
    with busy(4 * os.cpu_count()):
        for _ in range(rounds):
            with contextlib.ExitStack() as peers:
                stays = peers.enter_context(Peer(program, "stays", transport="dds", namespace="/cell"))
                leaving = [peers.enter_context(Peer(program, f"leaves_{topic}", transport="dds", namespace="/cell")) for topic in topics]
                for topic, peer in zip(topics, leaving):
                    stays.ask("subscribed", "subscribe", f"/cell/last_{topic}", name, "events")
                    peer.ask("gid", "offer", f"/cell/last_{topic}", name, "events")
                for topic, peer in zip(topics, leaving):
                    check("found", peer.ask("found", "await", f"/cell/last_{topic}", 1)["found"], True)
                for topic, peer in zip(topics, leaving):
                    for cdr in burst:
                        peer.tell("publish", f"/cell/last_{topic}", name, "events", cdr)
                    peer.tell("close")
                for topic in topics:
                    for cdr in burst:
                        sample = stays.take("sample", lambda sample, own=f"/cell/last_{topic}": sample["sample"] == own)
                        check("a last sample", unpadded(sample["cdr"], bytes.fromhex(cdr)).hex(), cdr)


def services(program, cyclone, messages):
    """Requests and responses in Cyclone's mapping, both ways, and in the enhanced one between ourselves."""
    header = {"guid": types.uint64, "number": types.int64}
    request_name, response_name = f"{SERVICE}_Request", f"{SERVICE}_Response"
    request_type = cyclone.idl.type(request_name, header)
    response_type = cyclone.idl.type(response_name, header)
    request = messages.encode(messages.store.types[request_name](uri="P1"), request_name)
    response = messages.encode(messages.store.types[response_name](accepted=True, uri="", text="made"), response_name)
    qos = "reliable:10"
    with Peer(program, "server", transport="dds", services="cyclone", namespace="/cell") as ours:
        ours.ask("serving", "serve", "/cell/run", SERVICE, response.hex())
        writer = cyclone.writer("rq/cell/runRequest", request_type, qos)
        reader = cyclone.reader("rr/cell/runReply", response_type, qos)
        kit.until("a match", lambda: writer.get_matched_subscriptions() and reader.get_matched_publications())
        answer = {}

        def answered():
            writer.write(request_type(guid=0x1122334455667788, number=7, uri="P1"))
            answer.update({(reply.guid, reply.number): reply for reply in reader.take(N=10)})
            return answer

        kit.until("a response of ours", answered)
        (((guid, number), reply),) = answer.items()
        check("identity", (guid, number), (0x1122334455667788, 7))
        check("response", (reply.accepted, reply.text), (True, "made"))
        check("request", unpadded(ours.take("request")["request"], request), request)

        reader = cyclone.reader("rq/cell/run_theirsRequest", request_type, qos)
        writer = cyclone.writer("rr/cell/run_theirsReply", response_type, qos)
        ours.tell("call", "/cell/run_theirs", SERVICE, request.hex())
        (asked,) = take(reader)
        check("request of ours", asked.uri, "P1")
        kit.until("a match", lambda: writer.get_matched_subscriptions())
        writer.write(response_type(guid=asked.guid, number=asked.number, accepted=True, uri="", text="made"))
        check("response of theirs", unpadded(ours.take("response")["response"], response), response)
    with (
        Peer(program, "server", transport="dds", namespace="/cell") as server,
        Peer(program, "client", transport="dds", namespace="/cell") as client,
    ):
        server.ask("serving", "serve", "/cell/run_enhanced", SERVICE, response.hex())
        for _ in range(3):
            answer = client.ask("response", "call", "/cell/run_enhanced", SERVICE, request.hex())
            check("enhanced response", unpadded(answer["response"], response), response)
            check("enhanced request", unpadded(server.take("request")["request"], request), request)


def discovery(program, cyclone):
    """ROS discovery: others learn our node and its endpoints, and we learn theirs."""
    gid = final(make_idl_struct("Gid", "rmw_dds_common::msg::dds_::Gid_", {"data": types.array[types.uint8, 16]}))
    node = final(make_idl_struct("Node", "rmw_dds_common::msg::dds_::NodeEntitiesInfo_", {
        "node_namespace": str, "node_name": str, "reader_gid_seq": types.sequence[gid], "writer_gid_seq": types.sequence[gid],
    }))
    info: type[IdlStruct] = final(make_idl_struct(
        "Info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_",
        {"gid": gid, "node_entities_info_seq": types.sequence[node]},
    ))
    with Peer(program, "known", transport="dds", namespace="/cell") as ours:
        offered = ours.ask("gid", "offer", "/cell/state", "std_msgs/msg/String", "latched:1")["gid"]
        reader = cyclone.reader("ros_discovery_info", info, "latched:1")
        told = {}

        def known():
            for item in reader.take(N=10):
                for one in item.node_entities_info_seq:
                    told[(one.node_namespace, one.node_name)] = {bytes(writer.data).hex() for writer in one.writer_gid_seq}
            return offered in told.get(("/cell", "known"), ())

        kit.until("our node", known)
        writer = cyclone.writer("ros_discovery_info", info, "latched:1")
        guid = cyclone.participant.guid
        writer.write(info(
            gid=gid(data=list(guid.bytes)),
            node_entities_info_seq=[node(node_namespace="/other", node_name="theirs", reader_gid_seq=[], writer_gid_seq=[])],
        ))
        kit.until("their node", lambda: "/other/theirs" in ours.ask("nodes", "graph")["nodes"])
        extra = cyclone.writer("rt/other/topic", cyclone.idl.type("std_msgs/msg/String"), "reliable:10")
        kit.until("their topic", lambda: any(
            (topic["name"], topic["type"]) == ("/other/topic", "std_msgs/msg/String")
            for topic in ours.ask("nodes", "graph")["topics"]
        ))
        del extra


def main(_):
    parser = argparse.ArgumentParser()
    parser.add_argument("--peer", required=True, help="the example program bus_peer")
    parser.add_argument("--msgs", required=True, help="the interface package")
    options = parser.parse_args()
    messages = Messages(options.msgs)
    cyclone = Cyclone(messages)
    for check_one, arguments in (
        (both_ways, (cyclone, messages)),
        (late_joiners, (cyclone, messages)),
        (bursts, (cyclone, messages)),
        (departures, (messages,)),
        (services, (cyclone, messages)),
        (discovery, (cyclone,)),
    ):
        check_one(options.peer, *arguments)
        print(f"ok  {check_one.__doc__.splitlines()[0]}", flush=True)


if __name__ == "__main__":
    kit.main({"dds": main})
