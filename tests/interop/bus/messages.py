"""Messages of the contract as rosbags (Python) sees them: hashes, random values, bytes. Nothing of ours but the files."""

import pathlib
import random
import sys

import numpy
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "interfaces"))
from compare import own_types  # noqa: E402

# Topic below the cell's namespace, type, quality of service.
CONTRACT = [
    ("robot_description", "std_msgs/msg/String", "latched:1"),
    ("joint_states", "sensor_msgs/msg/JointState", "best_effort:10"),
    ("joint_commands", "sensor_msgs/msg/JointState", "reliable:10"),
    ("machine_state", "probecell_msgs/msg/MachineState", "reliable:10"),
    ("inspection_plan", "probecell_msgs/msg/InspectionPlan", "latched:1"),
    ("probe_events", "probecell_msgs/msg/ProbeEvent", "events"),
    ("reference", "probecell_msgs/msg/ReferenceMeasurement", "latched:1"),
    # Parts of messages; they have no topic in the contract, yet are types of it.
    ("stylus", "probecell_msgs/msg/Stylus", "reliable:10"),
    ("feature", "probecell_msgs/msg/InspectionFeature", "reliable:10"),
    ("operation", "probecell_msgs/msg/MachiningOperation", "reliable:10"),
    ("point", "probecell_msgs/msg/InspectionPoint", "reliable:10"),
]

# How rmw_zenoh spells these qualities of service in its tokens.
TOKEN_QOS = {
    "latched:1": ":1:,1:,:,:,,",
    "latched:3": ":1:,3:,:,:,,",
    "best_effort:10": "2::,10:,:,:,,",
    "reliable:10": "::,10:,:,:,,",
    "events": "::2,:,:,:,,",
}

FLOATS = {"float32": numpy.float32, "float64": numpy.float64}
SMALL = {"int8": 7, "uint8": 8, "byte": 8, "int16": 15, "uint16": 16, "int32": 31, "uint32": 32, "int64": 63, "uint64": 64}


class Messages:
    def __init__(self, root):
        """`root` is the folder of the interface package."""
        self.store = get_typestore(Stores.ROS2_JAZZY)
        types = own_types(pathlib.Path(root))
        self.store.register({key: value for key, value in types.items() if key not in self.store.fielddefs})

    def hash(self, name):
        return self.store.hash_rihs01(name)

    @staticmethod
    def dds(name):
        package, kind, short = name.split("/")
        return f"{package}::{kind}::dds_::{short}_"

    def random(self, name, seed):
        """A message with arbitrary values."""
        return self._struct(name, random.Random(f"{name} {seed}"))

    def encode(self, message, name):
        return bytes(self.store.serialize_cdr(message, name))

    def decode(self, raw, name):
        return self.store.deserialize_cdr(raw, name)

    def fields(self, name):
        return self.store.fielddefs[name][1]

    def _struct(self, name, source):
        return self.store.types[name](**{key: self._value(kind, source) for key, kind in self.fields(name)})

    def _value(self, field, source):
        kind, detail = field
        if kind == Nodetype.BASE:
            return self._base(detail[0], source)
        if kind == Nodetype.NAME:
            return self._struct(detail, source)
        item, count = detail
        count = count if kind == Nodetype.ARRAY else source.randrange(5)
        values = [self._value(item, source) for _ in range(count)]
        if item[0] == Nodetype.BASE and item[1][0] != "string":
            return numpy.array(values, dtype={"byte": "uint8"}.get(item[1][0], item[1][0]))
        return values

    @staticmethod
    def _base(kind, source):
        if kind == "string":
            return "".join(source.choice("abcXYZ019_-/ µ°é") for _ in range(source.randrange(12)))
        if kind == "bool":
            return source.random() < 0.5
        if kind in FLOATS:
            return float(FLOATS[kind](source.uniform(-1e3, 1e3)))
        return source.randrange(1 << SMALL[kind])
