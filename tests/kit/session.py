"""A measuring session of a three-axis machine, made here, and its ways to go wrong.

The machine cuts nothing: it touches the top and the four sides of a block. Lengths in m, times in ns since 1970. What
is written follows the interface contract, by the libraries `mcap` and `mcap-ros2-support`; nothing of ours but the
message files is used.
"""

import copy
import pathlib
import random

from mcap.writer import CompressionType
from mcap_ros2.writer import Writer

MSGS = pathlib.Path(__file__).resolve().parents[2] / "msgs"
START = 1_760_000_000_000_000_000
BALL = 3e-3  # radius
MOUNT = (0.0, 0.0, -0.1)  # ball centre in the mount
PART = (0.05, -0.02, -0.3)  # origin of the part

AXIS = """<link name="{child}"/><joint name="{name}" type="prismatic"><parent link="{parent}"/><child link="{child}"/>
<axis xyz="{axis}"/><limit lower="-1" upper="1" effort="1" velocity="0.5"/></joint>"""
URDF = (
    '<robot name="three_axis"><link name="foundation"/><link name="workpiece"/>'
    '<joint name="table" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>'
    + AXIS.format(name="X", parent="foundation", child="x", axis="1 0 0")
    + AXIS.format(name="Y", parent="x", child="y", axis="0 1 0")
    + AXIS.format(name="Z", parent="y", child="probe_mount", axis="0 0 1")
    + "</robot>"
)

# Topic below the namespace and type.
TYPES = {
    "robot_description": "std_msgs/String",
    "joint_states": "sensor_msgs/JointState",
    "joint_commands": "sensor_msgs/JointState",
    "machine_state": "probecell_msgs/MachineState",
    "inspection_plan": "probecell_msgs/InspectionPlan",
    "probe_events": "probecell_msgs/ProbeEvent",
    "reference": "probecell_msgs/ReferenceMeasurement",
}
BUILT_IN = {"bool", "byte", "char", "string", "wstring", "float32", "float64"}
BUILT_IN |= {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}


def read(name):
    """Text of a message file: `package/Type`."""
    package, short = name.split("/")
    own = MSGS / "msg" / f"{short}.msg"
    return (own if package == "probecell_msgs" else MSGS / "standard" / package / "msg" / f"{short}.msg").read_text()


def definition(name):
    """Schema of encoding ros2msg: the definition and all that it uses."""
    texts, wanted = {}, [name]
    while wanted:
        current = wanted.pop(0)
        if current in texts:
            continue
        texts[current] = read(current)
        for line in texts[current].splitlines():
            words = line.split("#")[0].split()
            if words and (kind := words[0].split("[")[0].split("<")[0]) not in BUILT_IN:
                parts = kind.split("/")
                wanted.append(f"{parts[0]}/{parts[-1]}" if len(parts) > 1 else f"{current.split('/')[0]}/{kind}")
    first = texts.pop(name)
    return first + "".join(f"{'=' * 80}\nMSG: {key}\n{text}" for key, text in texts.items())


def xyz(values):
    return dict(zip("xyz", values, strict=True))


def header(time):
    return {"stamp": {"sec": time // 10**9, "nanosec": time % 10**9}, "frame_id": ""}


def block():
    """Feature, position and outward normal of each point."""
    for feature, normal in enumerate([(0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)]):
        for step in range(12):
            u, v = 0.01 * (step % 4) - 0.015, 0.008 * (step // 4) - 0.008
            yield feature, normal, {
                (0, 0, 1): (u, v, 0.0),
                (1, 0, 0): (0.03, u, v - 0.02),
                (-1, 0, 0): (-0.03, u, v - 0.02),
                (0, 1, 0): (u, 0.02, v - 0.02),
                (0, -1, 0): (u, -0.02, v - 0.02),
            }[normal]


class Session:
    """Messages in the order of their log times: topic, content, log time. Change them, then `write`."""

    def __init__(self, namespace="/cell"):
        self.namespace = namespace
        self.types = dict(TYPES)
        noise = random.Random(1)
        points = list(block())
        plan = {
            "header": header(START),
            "plan_id": "plan-1",
            "part_id": "block",
            "machined_on_this_machine": False,
            "part_pose": {"position": xyz(PART), "orientation": {**xyz((0.0, 0.0, 0.0)), "w": 1.0}},
            "stylus": {"id": "s", "ball_center": xyz(MOUNT), "ball_radius": BALL},
            "rotary_names": [],
            "features": [
                {
                    "id": f"plane_{number}",
                    "kind": 0,
                    "origin": xyz(next(at for feature, _, at in points if feature == number)),
                    "axis": xyz(map(float, next(normal for feature, normal, _ in points if feature == number))),
                    "radius": 0.0,
                    "half_angle": 0.0,
                    "lower_tolerance": -1e-5,
                    "upper_tolerance": 1e-5,
                }
                for number in range(5)
            ],
            "operations": [],
            "points": [
                {
                    "feature": feature,
                    "position": xyz(at),
                    "normal": xyz(map(float, normal)),
                    "rotary_positions": [],
                    "approach_distance": 2e-3,
                    "retract_distance": 2e-3,
                    "feed": 5e-3,
                    "operation": -1,
                    "cut_length": 0.0,
                    "tool_height": 0.0,
                    "overhang": 0.0,
                }
                for feature, normal, at in points
            ],
        }
        self.messages = [("robot_description", {"data": URDF}, START), ("inspection_plan", plan, START + 1)]
        for number, (_, normal, at) in enumerate(points):
            time = START + (number + 1) * 2_000_000_000
            ball = [a + n * (BALL + noise.gauss(0.0, 5e-7)) for a, n in zip(at, normal, strict=True)]
            axes = [c + part - mount for c, part, mount in zip(ball, PART, MOUNT, strict=True)]
            joints = {"header": header(time), "name": ["X", "Y", "Z"], "position": axes, "velocity": [], "effort": []}
            self.messages.append(("joint_states", joints, time - 1))
            state = {
                "header": header(time),
                "machine_id": "three_axis",
                "mode": 2,
                "execution": 1,
                "program": "p",
                "line": number,
                "tool_number": 1,
                "feed_override": 1.0,
                "spindle_speed": 0.0,
                "temperature_names": ["part"],
                "temperatures": [20.0],
                "alarms": [],
            }
            self.messages.append(("machine_state", state, time - 1))
            event = {
                "header": header(time),
                "sequence": number,
                "plan_id": "plan-1",
                "point_index": number,
                "outcome": 0,
                "axis_names": ["X", "Y", "Z"],
                "axis_positions": axes,
                "tip": xyz(ball),
                "approach": xyz([float(-n) for n in normal]),
                "feed": 5e-3,
            }
            self.messages.append(("probe_events", event, time))

    def of(self, topic):
        """Contents on a topic."""
        return [content for name, content, _ in self.messages if name == topic]

    @property
    def plan(self):
        return self.of("inspection_plan")[0]

    @property
    def events(self):
        return self.of("probe_events")

    def without(self, *topics):
        self.messages = [message for message in self.messages if message[0] not in topics]
        return self

    def add(self, topic, content, time=START + 3):
        self.messages.append((topic, copy.deepcopy(content), time))
        return self

    def reference(self, **changes):
        """Adds what a CMM says of the first two points."""
        content = {"header": header(START), "plan_id": "plan-1", "instrument": "CMM", "point_index": [0, 1]}
        content |= {"deviation": [0.0, 1e-7], "standard_uncertainty": 5e-7}
        return self.add("reference", content | changes)

    def drive(self, effort=0.5):
        """No touches: one axis to and fro, with its commands."""
        self.without("inspection_plan", "probe_events", "machine_state", "joint_states")
        for tick in range(400):
            time = START + tick * 10_000_000
            phase = abs((tick % 200) - 100) / 100
            speed = -1.0 if tick % 200 < 100 else 1.0
            joints = {"header": header(time), "name": ["X"], "position": [0.1 * phase], "velocity": [0.1 * speed]}
            self.add("joint_states", joints | {"effort": [effort * speed]}, time)
            self.add("joint_commands", joints | {"effort": []}, time)
        return self

    def write(self, path, *, compression=CompressionType.ZSTD, raw=None):
        """Writes the file. `raw`: topics whose payloads are these bytes instead of messages."""
        raw = raw or {}
        with open(path, "wb") as stream:
            writer = Writer(stream, chunk_size=4096, compression=compression)
            schemas = {}
            for name in self.types.values():
                schemas[name] = writer.register_msgdef(name.replace("/", "/msg/"), definition(name))
            channels = {}
            for sequence, (topic, content, time) in enumerate(self.messages):
                name, schema = f"{self.namespace}/{topic}", schemas[self.types[topic]]
                if topic in raw:
                    if topic not in channels:
                        channels[topic] = writer._writer.register_channel(name, "cdr", schema.id)
                    writer._writer.add_message(channels[topic], time, raw[topic], time, sequence)
                else:
                    writer.write_message(name, schema, content, time, time, sequence)
            writer.finish()
        return path
