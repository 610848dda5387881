"""Compares probecell_msgs with rosbags: type hashes, definitions, and the bytes of random messages.

rosbags parses our .msg, .srv and .action files itself and brings its own standard types; the Rust side answers through the
example program dump_types. Where recordings of others are given, their schemas and messages are compared as well.
"""

import argparse
import keyword
import math
import pathlib
import random
import subprocess
import sys

import numpy
from mcap.reader import make_reader
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROUNDS = 60
LETTERS = "abcXYZ0189_-/ µ°é漢"
OCTETS = ("octet", "byte", "char")

# ROS 2 reads char as uint8 before it hashes (rosidl_adapter); rosbags hashes it as char. The hash is ROS's own.
PUBLISHED = {
    "service_msgs/msg/ServiceEventInfo": "RIHS01_41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45",
}


class Peer:
    """The Rust crate, behind its example program."""

    def __init__(self, program):
        self.program = program

    def ask(self, *arguments, text=None):
        done = subprocess.run([self.program, *arguments], input=text, capture_output=True, text=True, check=True)
        return done.stdout

    def types(self):
        """Kind, name and hash of every type."""
        return [line.split(" ") for line in self.ask("types").splitlines()]

    def echo(self, messages):
        """For each (name, bytes): the bytes as the crate writes them, and its leaves by path."""
        answer = self.ask("echo", text="".join(f"{name} {bytes(raw).hex()}\n" for name, raw in messages))
        blocks = answer.split("\n\n")[:-1]
        assert len(blocks) == len(messages), f"{len(blocks)} answers to {len(messages)} messages"
        for block in blocks:
            again, *leaves = block.split("\n")
            assert not again.startswith("refused"), again
            yield bytes.fromhex(again), [leaf.partition("=")[::2] for leaf in leaves]


def parse(text, name):
    """Types that a definition text defines, by full name."""
    # It knows of no other folder than msg/.
    types = {key.replace("/srv/msg/", "/srv/").replace("/action/msg/", "/action/"): value for key, value in get_types_from_msg(text, name).items()}
    for _, fields in types.values():
        if not fields:
            # The IDL that a .msg stands for has no empty structures; rosbags' own Empty says so, its parser does not.
            fields.append(("structure_needs_at_least_one_member", (Nodetype.BASE, ("uint8", 0))))
    return types


GOAL_ID = "unique_identifier_msgs/UUID goal_id\n"


def parts_of_action(name, text):
    """The messages of which an action consists, by their names: the ROS 2 design of actions."""
    goal, result, feedback = text.split("---\n")
    of = f"probecell_msgs/action/{name}"
    return {
        "Goal": goal, "Result": result, "Feedback": feedback,
        "FeedbackMessage": f"{GOAL_ID}{of}_Feedback feedback\n",
        "SendGoal_Request": f"{GOAL_ID}{of}_Goal goal\n",
        "SendGoal_Response": "bool accepted\nbuiltin_interfaces/Time stamp\n",
        "GetResult_Request": GOAL_ID,
        "GetResult_Response": f"int8 status\n{of}_Result result\n",
    }


def own_types(msgs):
    """Our interfaces as rosbags reads them, and the services of standard packages, which it does not bring."""
    types = {}
    for path in sorted((msgs / "msg").glob("*.msg")):
        types |= parse(path.read_text(), f"probecell_msgs/msg/{path.stem}")
    for path in sorted([*(msgs / "srv").glob("*.srv"), *msgs.glob("standard/*/srv/*.srv")]):
        package = "probecell_msgs" if path.parents[1] == msgs else path.parents[1].name
        request, response = path.read_text().split("---\n")
        types |= parse(request, f"{package}/srv/{path.stem}_Request")
        types |= parse(response, f"{package}/srv/{path.stem}_Response")
    for path in sorted((msgs / "action").glob("*.action")):
        for part, text in parts_of_action(path.stem, path.read_text()).items():
            types |= parse(text, f"probecell_msgs/action/{path.stem}_{part}")
    return types


def random_primitive(kind, rng):
    if kind == "bool":
        return rng.random() < 0.5
    if kind == "string":
        return "".join(rng.choices(LETTERS, k=rng.randrange(9)))
    if kind.startswith("float"):
        value = rng.choice([0.0, -0.0, math.inf, 1e-300, rng.gauss(0, 1), rng.gauss(0, 1e9)])
        return float(numpy.float32(value)) if kind == "float32" else value
    if kind in OCTETS:
        # rosbags packs a single octet as a signed one.
        return rng.randrange(128)
    limits = numpy.iinfo(kind)
    return rng.choice([int(limits.min), int(limits.max), rng.randrange(100)])


def random_element(store, node, rng):
    kind, detail = node
    return random_message(store, detail, rng) if kind == Nodetype.NAME else random_primitive(detail[0], rng)


def random_field(store, node, rng):
    kind, detail = node
    if kind in (Nodetype.BASE, Nodetype.NAME):
        return random_element(store, node, rng)
    element, length = detail
    count = length if kind == Nodetype.ARRAY else rng.randrange(1 + (length or 4))  # a sequence: its bound, or 0
    values = [random_element(store, element, rng) for _ in range(count)]
    if element[0] == Nodetype.NAME or element[1][0] == "string":
        return values
    return numpy.array(values, dtype="uint8" if element[1][0] in OCTETS else element[1][0])


def attribute(field):
    """What rosbags calls a field in Python, where some names are taken."""
    return f"{field}_" if keyword.iskeyword(field) else field


def random_message(store, name, rng):
    _, fields = store.fielddefs[name]
    return store.types[name](**{attribute(field): random_field(store, node, rng) for field, node in fields})


def leaves(store, value, node, path):
    """Path and value of every leaf, as the crate's describe names them."""
    kind, detail = node
    if kind == Nodetype.NAME:
        for field, inner in store.fielddefs[detail][1]:
            yield from leaves(store, getattr(value, attribute(field)), inner, f"{path}.{field}" if path else field)
    elif kind == Nodetype.BASE:
        yield path, value
    elif len(value) == 0:
        yield path, []
    else:
        for index, element in enumerate(value):
            yield from leaves(store, element, detail[0], f"{path}[{index}]")


def same(text, value):
    """Whether the crate printed this value."""
    if isinstance(value, list):
        return text == "[]"
    if isinstance(value, (bool, numpy.bool_)):
        return text == str(bool(value)).lower()
    if isinstance(value, str):
        return text == f'"{value}"'
    if isinstance(value, (float, numpy.floating)):
        return math.copysign(1, float(text)) == math.copysign(1, value) and float(text) == value
    return int(text) == value


def check_hashes(peer, store):
    count = 0
    for kind, name, found in peer.types():
        # rosbags hashes messages only; service hashes are tested against published ones beside the generator.
        if kind == "message":
            expected = PUBLISHED.get(name) or store.hash_rihs01(name)
            assert found == expected, f"{name}: {found}, not {expected}"
            count += 1
    print(f"{count} type hashes are equal")


def check_definitions(peer, store):
    """The schema text alone defines the same fields and constants as the store, dependencies included."""
    names = [name for kind, name, _ in peer.types() if kind == "message"]
    for name in names:
        parsed = parse(peer.ask("definition", name), name)
        for part, definition in parsed.items():
            assert definition == store.fielddefs[part], f"{part} in the schema of {name}"
    print(f"{len(names)} schemas define the same constants and fields")


def check_random_messages(peer, store):
    rng = random.Random(1)
    cases = []
    for kind, name, _ in peer.types():
        if kind == "message":
            cases += [(name, random_message(store, name, rng)) for _ in range(ROUNDS)]
    little = [bytes(store.serialize_cdr(message, name)) for name, message in cases]
    big = [bytes(store.serialize_cdr(message, name, little_endian=False)) for name, message in cases]
    for sent in (little, big):
        answers = peer.echo([(name, raw) for (name, _), raw in zip(cases, sent)])
        for (name, message), expected, (again, found) in zip(cases, little, answers, strict=True):
            assert again == expected, f"{name}: {again.hex()}, rosbags writes {expected.hex()}"
            wanted = list(leaves(store, message, (Nodetype.NAME, name), ""))
            assert [path for path, _ in found] == [path for path, _ in wanted], name
            for (path, text), (_, value) in zip(found, wanted):
                assert same(text, value), f"{name}.{path}: {text}, not {value!r}"
    print(f"{2 * len(cases)} random messages have the same bytes and values")


def check_bags(peer, store, folder):
    bags = sorted(folder.glob("*.mcap"))
    if not bags:
        print("skipped: no recordings of others")
        return
    messages = schemas = 0
    for number, path in enumerate(bags):
        with path.open("rb") as file:
            reader = make_reader(file)
            for schema in reader.get_summary().schemas.values():
                for name, definition in parse(schema.data.decode(), schema.name).items():
                    assert definition == store.fielddefs[name], f"{name} in {path.name}"
                schemas += 1
            # Every kind of recording stands in the first few; all would only take longer.
            if number < 6:
                sent = [(schema.name, message.data) for schema, _, message in reader.iter_messages()]
                for (name, raw), (again, _) in zip(sent, peer.echo(sent), strict=True):
                    assert again == raw, f"{name} in {path.name}"
                messages += len(sent)
    print(f"{schemas} schemas and {messages} messages of {len(bags)} recordings are equal")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--msgs", type=pathlib.Path, required=True, help="folder of the interface package")
    parser.add_argument("--dump", type=pathlib.Path, required=True, help="the example program dump_types")
    parser.add_argument("--bags", type=pathlib.Path, required=True, help="folder of recordings of others; may be absent")
    arguments = parser.parse_args()
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(own_types(arguments.msgs))
    peer = Peer(arguments.dump)
    check_hashes(peer, store)
    check_definitions(peer, store)
    check_random_messages(peer, store)
    check_bags(peer, store, arguments.bags)


if __name__ == "__main__":
    sys.exit(main())
