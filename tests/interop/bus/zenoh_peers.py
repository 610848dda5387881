"""Our bus on Zenoh against others: every byte of the wire contract, eclipse-zenoh and zenoh-ros2-sdk both ways.

What is expected is built here, from the description of rmw_zenoh, without our code.
"""

import argparse
import itertools
import logging
import pathlib
import queue
import struct

import xxhash
import zenoh
import zenoh.ext
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2ServiceServer, ROS2Subscriber, ZenohSession
from zenoh_ros2_sdk.utils import compute_service_type_hash

from messages import CONTRACT, TOKEN_QOS, Messages
from peer import Peer, check, kit

NODE = "@ros2_lv/0/{zid}/0/0/NN/%/%cell/{node}"
ENDPOINT = "@ros2_lv/0/{zid}/0/{eid}/{kind}/%/%cell/{node}/{name}/{type}/{hash}/{qos}"


def gid(token):
    """XXH3-128 of the token: low half, then high half, each little endian."""
    digest = xxhash.xxh3_128_intdigest(token.encode())
    return struct.pack("<QQ", digest & 0xFFFF_FFFF_FFFF_FFFF, digest >> 64)


def attachment(number, time, source):
    return struct.pack("<qqB", number, time, 16) + source


def heard(samples):
    """Puts what is heard into a queue, and wakes who waits for it."""
    def put(sample):
        samples.put(sample)
        kit.happened()

    return put


def next_of(samples):
    kit.until("a sample", lambda: not samples.empty())
    return samples.get()


class Raw:
    """A session of the bare Zenoh library."""

    def __init__(self, endpoint, mode="peer"):
        config = zenoh.Config()
        config.insert_json5("mode", f'"{mode}"')
        config.insert_json5("connect/endpoints", f'["{endpoint}"]')
        config.insert_json5("listen/endpoints", '["tcp/127.0.0.1:0"]')
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("timestamping/enabled", "true")
        self.session = zenoh.open(config)
        self.alive = set()
        self.graph = self.session.liveliness().declare_subscriber("@ros2_lv/0/**", self._token, history=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.session.close()

    def _token(self, sample):
        change = self.alive.add if sample.kind == zenoh.SampleKind.PUT else self.alive.discard
        change(str(sample.key_expr))
        kit.happened()

    def tokens(self):
        """What is announced now. A subscription knows; a single query may catch the graph half told."""
        return set(self.alive)

    def listen(self, key):
        samples = queue.Queue()
        return self.session.declare_subscriber(key, heard(samples)), samples


def key_of(messages, topic, name):
    return f"0/cell/{topic}/{messages.dds(name)}/{messages.hash(name)}"


def golden_bytes(program, endpoint, messages):
    """Keys, tokens, attachments and payloads, byte by byte, for every type of the contract."""
    with Raw(endpoint) as raw, Peer(program, "golden", endpoint=endpoint, namespace="/cell") as ours:
        kit.until("the node's token", lambda: any("/golden" in token for token in raw.tokens()))
        (node_token,) = raw.tokens()
        zid = node_token.split("/")[2]
        check("node token", node_token, NODE.format(zid=zid, node="golden"))
        wanted = {node_token}
        for number, (topic, name, qos) in enumerate(CONTRACT, start=1):
            subscriber, samples = raw.listen(key_of(messages, topic, name))
            token = ENDPOINT.format(
                zid=zid, eid=number, kind="MP", node="golden", name=f"%cell%{topic}",
                type=messages.dds(name), hash=messages.hash(name), qos=TOKEN_QOS[qos],
            )
            wanted.add(token)
            offered = ours.ask("gid", "offer", f"/cell/{topic}", name, qos)
            check("identifier", offered["gid"], gid(token).hex())
            # A raw subscriber announces nothing to the graph of ROS: publish until the route stands.
            cdr = messages.encode(messages.random(name, 0), name)
            published = []

            def arrives():
                published.append(ours.ask("published", "publish", f"/cell/{topic}", name, qos, cdr.hex())["published"])
                return not samples.empty()

            kit.until(f"a sample of {topic}", arrives)
            check("numbers", published, list(range(1, len(published) + 1)))
            sample = samples.get()
            # Which of them came first is the network's affair.
            (number,) = struct.unpack_from("<q", bytes(sample.attachment))
            check("one of those published", number in published, True)
            check("key", str(sample.key_expr), key_of(messages, topic, name))
            check("payload", bytes(sample.payload), cdr)
            check("attachment", bytes(sample.attachment), attachment(number, 42, gid(token)))
            subscriber.undeclare()
        for eid, (topic, name, qos) in enumerate(CONTRACT, start=len(CONTRACT) + 1):
            ours.ask("subscribed", "subscribe", f"/cell/{topic}", name, qos)
            wanted.add(ENDPOINT.format(
                zid=zid, eid=eid, kind="MS", node="golden", name=f"%cell%{topic}",
                type=messages.dds(name), hash=messages.hash(name), qos=TOKEN_QOS[qos],
            ))
        ours.ask("serving", "serve", "/cell/run", "probecell_msgs/srv/Run", "00010000")
        count = len(wanted) + 1
        kit.until("all tokens", lambda: len(raw.tokens()) >= count)
        found = {token for token in raw.tokens() if token.split("/")[2] == zid}
        service = {token for token in found if "/SS/" in token}
        check("one service", len(service), 1)
        (token,) = service
        parts = token.split("/")
        check("service token", parts[4:11] + parts[12:], [
            str(2 * len(CONTRACT) + 1), "SS", "%", "%cell", "golden", "%cell%run",
            "probecell_msgs::srv::dds_::Run_", "::,10:,:,:,,",
        ])
        check("tokens", found - service, wanted)
        ours.ask("closed", "close")
        kit.until("the tokens to go", lambda: not any(token.split("/")[2] == zid for token in raw.tokens()))


def raw_to_us(program, endpoint, messages):
    """The bare library publishes; we take the bytes as they are, and know the sender and its numbers."""
    with Raw(endpoint) as raw, Peer(program, "taker", endpoint=endpoint, namespace="/cell") as ours:
        for topic, name, _ in CONTRACT:
            ours.ask("subscribed", "subscribe", f"/cell/{topic}_raw", name, "reliable:10")
            publisher = raw.session.declare_publisher(key_of(messages, f"{topic}_raw", name))
            source = gid(topic)
            kit.until("a match", lambda: publisher.matching_status.matching)
            for number, seed in ((1, 1), (2, 2), (2, 2), (5, 3)):
                cdr = messages.encode(messages.random(name, seed), name)
                publisher.put(cdr, attachment=attachment(number, 1000 + number, source))
            for number, seed in ((1, 1), (2, 2), (5, 3)):
                sample = ours.take("sample")
                check("number", sample["number"], number)
                check("source time", sample["source_time"], 1000 + number)
                check("publisher", sample["publisher"], source.hex())
                check("bytes", sample["cdr"], messages.encode(messages.random(name, seed), name).hex())
                check(f"{name} decoded and encoded again", sample["canonical"], True)
            lost = ours.take("lost")
            check("lost", (lost["first"], lost["count"]), (3, 2))
            publisher.undeclare()


def sdk_both_ways(program, endpoint, messages, sdk):
    """A library that follows rmw_zenoh on its own: types by name, values as objects."""
    with Peer(program, "sdk_peer", endpoint=endpoint, namespace="/cell") as ours:
        for topic, name, qos in CONTRACT:
            common = {"msg_type": name, "type_hash": messages.hash(name), "qos": TOKEN_QOS[qos], **sdk}
            # From us to it.
            taken = queue.Queue()
            subscriber = ROS2Subscriber(topic=f"/cell/{topic}_out", callback=heard(taken), **common)
            ours.ask("gid", "offer", f"/cell/{topic}_out", name, qos)
            check("found", ours.ask("found", "await", f"/cell/{topic}_out", 1)["found"], True)
            message = messages.random(name, 10)
            ours.ask("published", "publish", f"/cell/{topic}_out", name, qos, messages.encode(message, name).hex())
            found = next_of(taken)
            check(f"{name} as taken by the SDK", messages.encode(found, name), messages.encode(message, name))
            subscriber.close()
            # From it to us.
            ours.ask("subscribed", "subscribe", f"/cell/{topic}_in", name, qos)
            publisher = ROS2Publisher(topic=f"/cell/{topic}_in", **common)
            kit.until("a match", lambda: publisher.pub.matching_status.matching)
            message = messages.random(name, 11)
            publisher.publish(**{key: getattr(message, key) for key, _ in messages.fields(name)})
            sample = ours.take("sample")
            check(f"{name} as published by the SDK", sample["cdr"], messages.encode(message, name).hex())
            check(f"{name} decoded and encoded again", sample["canonical"], True)
            publisher.close()
        nodes = ours.ask("nodes", "graph")
        check("our node in our graph", "/cell/sdk_peer" in nodes["nodes"], True)


class Witness:
    """A plain subscriber. What it has taken, the network has delivered to everybody: a later joiner finds only history."""

    def __init__(self, session, key):
        self.samples = queue.Queue()
        self.subscriber = session.declare_subscriber(key, heard(self.samples))

    def hears(self):
        return not self.samples.empty()

    def saw(self, encoded):
        """Waits for exactly these payloads, after whatever was sent to find out whether the route stands."""
        seen = []
        while seen[-len(encoded):] != encoded:
            seen.append(bytes(next_of(self.samples).payload))
        self.subscriber.undeclare()


def late_joiners(program, endpoint, messages, sdk):
    """A latched topic gives a late joiner exactly the last samples, in all pairings."""
    name = "std_msgs/msg/String"
    texts = [messages.store.types[name](data=f"state {number}") for number in range(6)]
    encoded = [messages.encode(text, name) for text in texts]
    knock = messages.encode(messages.store.types[name](data="does the route stand?"), name).hex()
    # Clients hang on the router alone: what the router has passed on has no second way to come.
    with (
        Raw(endpoint, "client") as raw,
        Raw(endpoint, "client") as bystander,
        Peer(program, "latcher", endpoint=endpoint, namespace="/cell") as ours,
    ):

        def publish_before_the_joiner(session, topic, qos, key):
            witness = Witness(session, key)

            def knocked():
                ours.ask("published", "publish", topic, name, qos, knock)
                return witness.hears()

            kit.until(f"a route of {topic}", knocked)
            for cdr in encoded:
                ours.ask("published", "publish", topic, name, qos, cdr.hex())
            witness.saw(encoded)

        # Ours publishes; the library's own advanced subscriber, as rmw_zenoh sets it up, joins late.
        key = key_of(messages, "latched", name)
        publish_before_the_joiner(raw.session, "/cell/latched", "latched:3", key)
        taken = queue.Queue()
        subscriber = zenoh.ext.declare_advanced_subscriber(
            raw.session, key, heard(taken),
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=3),
            recovery=zenoh.ext.RecoveryConfig(heartbeat=True), subscriber_detection=True,
        )
        for cdr in encoded[3:]:
            check("history of ours", bytes(next_of(taken).payload), cdr)
        ours.ask("published", "publish", "/cell/latched", name, "latched:3", encoded[0].hex())
        check("what follows", bytes(next_of(taken).payload), encoded[0])
        subscriber.undeclare()
        # The SDK asks for history in its own way: of topics without a namespace, and for the last sample only.
        key = f"0/latched_once/{messages.dds(name)}/{messages.hash(name)}"
        publish_before_the_joiner(ZenohSession.get_instance().session, "/latched_once", "latched:1", key)
        # It asks once who publishes, which may catch the graph half told: then it is joined by another one.
        taken = queue.Queue()

        def joined():
            subscriber = ROS2Subscriber(
                topic="/latched_once", callback=heard(taken), msg_type=name, type_hash=messages.hash(name),
                qos=TOKEN_QOS["latched:1"], **sdk,
            )
            subscriber.close()
            return not taken.empty()

        kit.until("history for the SDK", joined)
        check("history of ours, by the SDK", messages.encode(taken.get(), name), encoded[-1])
        # The library's advanced publisher, as rmw_zenoh sets it up; we join late.
        key = key_of(messages, "latched_raw", name)
        publisher = zenoh.ext.declare_advanced_publisher(
            raw.session, key, cache=zenoh.ext.CacheConfig(max_samples=3), publisher_detection=True,
            sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=0.5),
        )
        source = gid("latched_raw")
        witness, numbers = Witness(bystander.session, key), itertools.count(1)

        def put(cdr):
            number = next(numbers)
            publisher.put(cdr, attachment=attachment(number, number, source))
            return number

        def knocked():
            put(bytes.fromhex(knock))
            return witness.hears()

        kit.until("a route of latched_raw", knocked)
        sent = [put(cdr) for cdr in encoded]
        witness.saw(encoded)
        ours.ask("subscribed", "subscribe", "/cell/latched_raw", name, "latched:3")
        for number, cdr in list(zip(sent, encoded))[3:]:
            sample = ours.take("sample")
            check("number", sample["number"], number)
            check("history of theirs", sample["cdr"], cdr.hex())
        follows = put(encoded[0])
        check("what follows", ours.take("sample")["number"], follows)
        publisher.undeclare()


def services_both_ways(program, endpoint, messages, root, sdk):
    """Requests and responses with the SDK on either side; the hash of the service is the SDK's own."""
    request_name, response_name = "probecell_msgs/srv/StartRecording_Request", "probecell_msgs/srv/StartRecording_Response"
    request = messages.store.types[request_name](uri="P1")
    response = messages.store.types[response_name](accepted=True, uri="", text="made")
    request_text, response_text = (root / "srv/StartRecording.srv").read_text().split("---\n")
    common = {
        "srv_type": "probecell_msgs/srv/StartRecording", "request_definition": request_text,
        "response_definition": response_text, **sdk,
    }
    with Peer(program, "server", endpoint=endpoint, namespace="/cell") as ours:
        cdr = messages.encode(response, response_name)
        ours.ask("serving", "serve", "/cell/run", "probecell_msgs/srv/StartRecording", cdr.hex())
        # A request that comes before its route has no reply, and no end before its timeout.
        knocking = ROS2ServiceClient(service_name="/cell/run", timeout=kit.patience(1), **common)
        kit.until("a route of the service", lambda: knocking.call(uri="P1"))
        knocking.close()
        client = ROS2ServiceClient(service_name="/cell/run", timeout=kit.patience(60), **common)
        for _ in range(3):
            answer = client.call(uri="P1")
            check("response of ours", (answer.accepted, answer.text), (True, "made"))
            check("request", ours.take("request")["request"], messages.encode(request, request_name).hex())
        client.close()

        def handle(asked):
            check("request of ours", asked.uri, "P1")
            return type(answer)(accepted=False, uri="", text="nothing to make")

        server = ROS2ServiceServer(service_name="/cell/run_theirs", callback=handle, **common)
        wanted = messages.store.types[response_name](accepted=False, uri="", text="nothing to make")
        for _ in range(3):
            ours.tell("call", "/cell/run_theirs", "probecell_msgs/srv/StartRecording", messages.encode(request, request_name).hex())
            check("response of theirs", ours.take("response")["response"], messages.encode(wanted, response_name).hex())
        server.close()


def main(_):
    parser = argparse.ArgumentParser()
    parser.add_argument("--peer", required=True, help="the example program bus_peer")
    parser.add_argument("--msgs", required=True, help="the interface package")
    options = parser.parse_args()
    logging.getLogger("zenoh_ros2_sdk").setLevel(logging.ERROR)
    root = pathlib.Path(options.msgs)
    messages = Messages(root)
    endpoint = "tcp/127.0.0.1:7447"
    with Peer(options.peer, "router", listen=endpoint):
        session = ZenohSession.get_instance("127.0.0.1", 7447)
        session.store = messages.store
        session._registered_types.update({name: name for name in messages.store.types if "/srv/" not in name})
        sdk = {"domain_id": 0, "namespace": "/other"}
        try:
            for check_one, arguments in (
                (golden_bytes, ()),
                (raw_to_us, ()),
                (sdk_both_ways, (sdk,)),
                (late_joiners, (sdk,)),
                (services_both_ways, (root, sdk)),
            ):
                check_one(options.peer, endpoint, messages, *arguments)
                print(f"ok  {check_one.__doc__.splitlines()[0]}", flush=True)
        finally:
            # Threads of an open session keep the process from ending.
            session.session.close()


if __name__ == "__main__":
    kit.main({"zenoh": main})
