#!/usr/bin/env python3
"""A robot on plain ROS 2 that is none of ours: joint_states, the action FollowJointTrajectory, a contact signal std_msgs/Bool, and a
program with services and parameters, over eclipse-zenoh in the wire format of rmw_zenoh.

    robot.py CELL.toml [--zero A2=200e-6]... [--delay S] [--jitter S] [--noise M] [--latched] [--seed N]

Behind it are the arm of the cell's URDF with zero errors of its joints, a probe that triggers late, and the cell's part: faces that
are clamped off their place, a bore that its program cuts, or balls. Metres, radians, seconds.
"""
import argparse, itertools, math, os, pathlib, queue, signal, struct, sys, time, tomllib
import xml.etree.ElementTree as ElementTree

import numpy, xxhash, zenoh
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

PERIOD = 0.004  # s between two samples of the joints
STATUS_SUCCEEDED, STATUS_CANCELED, STATUS_ABORTED = 4, 5, 6

# Published definitions of control_msgs 6.10 (ros-controls, Apache-2.0), without what does not change the bytes.
CONTROL = {
    "control_msgs/msg/JointTolerance": "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n",
    "control_msgs/msg/JointComponentTolerance": "string joint_name\nuint16 component\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n",
    "control_msgs/msg/SendGoalRequest": "uint8[16] uuid\ntrajectory_msgs/JointTrajectory trajectory\n"
    "trajectory_msgs/MultiDOFJointTrajectory multi_dof_trajectory\ncontrol_msgs/JointTolerance[] path_tolerance\n"
    "control_msgs/JointComponentTolerance[] component_path_tolerance\ncontrol_msgs/JointTolerance[] goal_tolerance\n"
    "control_msgs/JointComponentTolerance[] component_goal_tolerance\nbuiltin_interfaces/Duration goal_time_tolerance\n",
    "control_msgs/msg/SendGoalResponse": "bool accepted\nbuiltin_interfaces/Time stamp\n",
    "control_msgs/msg/GetResultRequest": "uint8[16] uuid\n",
    "control_msgs/msg/GetResultResponse": "int8 status\nint32 error_code\nstring error_string\n",
    "control_msgs/msg/CancelRequest": "uint8[16] uuid\nbuiltin_interfaces/Time stamp\n",
    "control_msgs/msg/GoalInfo": "uint8[16] uuid\nbuiltin_interfaces/Time stamp\n",
    "control_msgs/msg/CancelResponse": "int8 return_code\ncontrol_msgs/GoalInfo[] goals_canceling\n",
    "control_msgs/msg/TriggerRequest": "uint8 structure_needs_at_least_one_member\n",
    "control_msgs/msg/TriggerResponse": "bool success\nstring message\n",
    "control_msgs/msg/Value": "uint8 type\nbool bool_value\nint64 integer_value\nfloat64 double_value\nstring string_value\n"
    "byte[] byte_array_value\nbool[] bool_array_value\nint64[] integer_array_value\nfloat64[] double_array_value\nstring[] string_array_value\n",
    "control_msgs/msg/Parameter": "string name\ncontrol_msgs/Value value\n",
    "control_msgs/msg/SetRequest": "control_msgs/Parameter[] parameters\n",
    "control_msgs/msg/SetResult": "bool successful\nstring reason\n",
    "control_msgs/msg/SetResponse": "control_msgs/SetResult[] results\n",
    "control_msgs/msg/GetRequest": "string[] names\n",
    "control_msgs/msg/GetResponse": "control_msgs/Value[] values\n",
}
# Hashes by the generator of ROS 2 (rosidl_generator_type_description 5.2.1).
HASHES = {
    "sensor_msgs::msg::dds_::JointState_": "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "std_msgs::msg::dds_::Bool_": "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
    "std_srvs::srv::dds_::Trigger_": "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    "rcl_interfaces::srv::dds_::SetParameters_": "RIHS01_56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0",
    "rcl_interfaces::srv::dds_::GetParameters_": "RIHS01_bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc",
    "control_msgs::action::dds_::FollowJointTrajectory_SendGoal_": "RIHS01_b13789dddc325a7a962825c45e28c77d37237ec129dd0c34dc5994562938c57f",
    "control_msgs::action::dds_::FollowJointTrajectory_GetResult_": "RIHS01_e3ceb38e3e1867c8dc0f46014df26e90eb93422f27e9e97f936e07f94be4bc8b",
    "action_msgs::srv::dds_::CancelGoal_": "RIHS01_573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a",
}


class Node:
    """One node of ROS 2."""

    def __init__(self, name):
        self.store, types = get_typestore(Stores.ROS2_JAZZY), {}
        for key, text in CONTROL.items():
            types |= get_types_from_msg(text, key)
        self.store.register({key: value for key, value in types.items() if key not in self.store.fielddefs})
        config = zenoh.Config()
        for key, value in [("mode", '"client"'), ("connect/endpoints", '["tcp/127.0.0.1:7447"]'), ("connect/timeout_ms", "-1"),
                           ("scouting/multicast/enabled", "false")]:
            config.insert_json5(key, value)
        self.session, self.requests, self.numbers = zenoh.open(config), queue.Queue(), itertools.count(1)
        self.node = f"%/%/{name}"
        self.lead = f"@ros2_lv/0/{self.session.info.zid()}/0"
        self.held = [self.session.liveliness().declare_token(f"{self.lead}/0/NN/{self.node}")]

    def announce(self, kind, name, ty, qos):
        tail = f"{ty}/{HASHES[ty]}"
        token = f"{self.lead}/{next(self.numbers)}/{kind}/{self.node}/{name.replace('/', '%')}/{tail}/{qos}"
        self.held.append(self.session.liveliness().declare_token(token))
        digest = xxhash.xxh3_128_intdigest(token.encode())
        return f"0/{name.strip('/')}/{tail}", struct.pack("<QQ", digest & (2**64 - 1), digest >> 64)

    def publisher(self, name, ty, qos, message):
        key, gid = self.announce("MP", name, ty, qos)
        publisher = self.session.declare_publisher(key, congestion_control=zenoh.CongestionControl.DROP)
        sequence = itertools.count(1)

        def publish(at, **fields):
            payload = bytes(self.store.serialize_cdr(self.store.types[message](**fields), message))
            publisher.put(payload, attachment=struct.pack("<qqB", next(sequence), round(at * 1e9), 16) + gid)

        return publish

    def serve(self, name, ty, request):
        key, _ = self.announce("SS", name, ty, "::,10:,:,:,,")

        def take(query):
            self.requests.put((name, query, self.store.deserialize_cdr(bytes(query.payload), request)))

        self.held.append(self.session.declare_queryable(key, take, complete=True))

    def answer(self, query, kind, /, **fields):
        asked = bytes(query.attachment)
        payload = bytes(self.store.serialize_cdr(self.store.types[kind](**fields), kind))
        query.reply(query.key_expr, payload, attachment=asked[:8] + struct.pack("<q", time.time_ns()) + asked[16:])

    def stamp(self, at):
        nanos = round(at * 1e9)
        return self.store.types["builtin_interfaces/msg/Time"](sec=nanos // 10**9, nanosec=nanos % 10**9)

    def header(self, at):
        return self.store.types["std_msgs/msg/Header"](stamp=self.stamp(at), frame_id="")


def turn(about, angle):
    x, y, z = numpy.asarray(about, float) / numpy.linalg.norm(about)
    cross = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return numpy.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def on(path, since):
    """The place on a trajectory so long after its start."""
    times, places = path
    return numpy.array([numpy.interp(since, times, column) for column in places.T])


class Arm:
    """The chain of the URDF: where the ball is in the part, for readings of the joints."""

    def __init__(self, urdf, cell, zeros):
        above = {joint.find("child").get("link"): joint for joint in ElementTree.fromstring(urdf).findall("joint")}

        def branch(link):
            joints = []
            while link in above:
                joints.insert(0, above[link])
                link = joints[0].find("parent").get("link")
            return [self.fixed(joint) for joint in joints]

        self.tool, part = branch("probe_mount"), branch("workpiece")
        self.names = [name for name, *_ in self.tool if name]
        assert not any(name for name, *_ in part), "the part stands"
        self.zeros = numpy.array([zeros.get(name, 0.0) for name in self.names])
        turned, at = numpy.eye(3), numpy.zeros(3)
        for _, own, shift, _ in part:
            at, turned = turned @ shift + at, turned @ own
        at = turned @ (numpy.array(cell["part"].get("position_mm", [0, 0, 0])) * 1e-3) + at
        self.part = (turned, at)
        self.ball = numpy.array(cell["part"]["stylus"]["ball_center_mm"]) * 1e-3

    @staticmethod
    def fixed(joint):
        origin, axis = joint.find("origin"), joint.find("axis")
        numbers = lambda text: numpy.array([float(word) for word in text.split()])
        roll, pitch, yaw = numbers(origin.get("rpy", "0 0 0"))
        placed = turn((0, 0, 1), yaw) @ turn((0, 1, 0), pitch) @ turn((1, 0, 0), roll)
        moves = joint.get("type") != "fixed"
        assert not moves or numpy.allclose(numbers(axis.get("xyz")), (0, 0, 1)), "every axis is z"
        return (joint.get("name") if moves else None, placed, numbers(origin.get("xyz", "0 0 0")), moves)

    def centre(self, readings):
        """Ball centre in the part frame."""
        turned, at, angles = numpy.eye(3), numpy.zeros(3), iter(readings + self.zeros)
        for name, placed, shift, _ in self.tool:
            at, turned = turned @ shift + at, turned @ placed
            if name:
                angle = next(angles)
                c, s = math.cos(angle), math.sin(angle)
                turned = turned @ numpy.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        centre = turned @ self.ball + at
        own, origin = self.part
        return own.T @ (centre - origin)


class Part:
    """Faces that are clamped off their place, a bore through them, or balls."""

    def __init__(self, cell, shift, tilt):
        of_kind = lambda kind: [one for one in cell["part"]["features"] if one["kind"] == kind]
        self.planes = [(numpy.array(one["origin_mm"]) * 1e-3, numpy.array(one["axis"], float)) for one in of_kind("plane")]
        self.balls = {tuple(one["origin_mm"]): one["radius_mm"] * 1e-3 for one in of_kind("sphere")}
        self.balls = [(numpy.array(centre) * 1e-3, radius) for centre, radius in self.balls.items()]
        self.bore = [(numpy.array(one["origin_mm"]) * 1e-3, one["radius_mm"] * 1e-3) for one in of_kind("bore")]
        self.radius = self.bore and self.bore[0][1]
        self.radius_now, self.offset = None, numpy.zeros(3)
        self.shift, self.tilt = numpy.array(shift), turn((1, 0, 0), tilt[0]) @ turn((0, 1, 0), tilt[1]) @ turn((0, 0, 1), tilt[2])
        self.blank()

    def blank(self):
        self.radius_now, self.offset = (self.radius - 200e-6 if self.bore else None), numpy.zeros(3)

    def distance(self, at):
        """Of a point from the surface, outside positive, m."""
        if self.balls:
            return min(numpy.linalg.norm(at - centre) - radius for centre, radius in self.balls)
        clamped = self.tilt.T @ (at - self.shift)
        out = [normal @ (clamped - origin) for origin, normal in self.planes]
        if self.bore:
            centre = self.bore[0][0] + self.offset
            out.append(self.radius_now - math.hypot(*(at - centre)[:2]))
        beyond = [one for one in out if one > 0]
        return math.hypot(*beyond) if beyond else max(out)


class Robot:
    def __init__(self, options, cell):
        self.node, self.options = Node("robot"), options
        urdf = (options.cell.parent / cell["cell"]["robot_description"]).read_text()
        zeros = {name: float(value) for name, value in (one.split("=") for one in options.zero)}
        self.arm = Arm(urdf, cell, zeros)
        self.part = Part(cell, [410e-6, -280e-6, 195e-6] if not options.true else [0, 0, 0], [60e-6, -45e-6, 30e-6])
        self.ball, self.random = cell["part"]["stylus"]["ball_radius_mm"] * 1e-3, numpy.random.default_rng(options.seed)
        home = {"A2": -90.0, "A3": 90.0, "A4": -90.0, "A5": 90.0}
        self.position = numpy.radians([home.get(name, 0.0) for name in self.arm.names])
        self.goal, self.path, self.begun, self.results, self.waiting = None, None, 0.0, {}, {}
        self.parameters = {"tool_1_wear": 0.0, "work_offset_x": 0.0, "work_offset_y": 0.0, "work_offset_z": 0.0, "run_id": ""}
        self.run_cut, self.cutting, self.tripped, self.extra, self.trips, self.ended = None, None, False, self.error(), [], False
        self.shown = False  # the level as it was published, late
        node, message = self.node, "control_msgs/msg/"
        self.joints = node.publisher("/joint_states", "sensor_msgs::msg::dds_::JointState_", "::,10:,:,:,,", "sensor_msgs/msg/JointState")
        self.contact = node.publisher("/contact", "std_msgs::msg::dds_::Bool_", "::,10:,:,:,,", "std_msgs/msg/Bool")
        if options.latched:
            self.latched = node.publisher("/contact_joint_states", "sensor_msgs::msg::dds_::JointState_", "::,10:,:,:,,", "sensor_msgs/msg/JointState")
        action = "/arm_controller/follow_joint_trajectory/_action"
        node.serve(f"{action}/send_goal", "control_msgs::action::dds_::FollowJointTrajectory_SendGoal_", message + "SendGoalRequest")
        node.serve(f"{action}/get_result", "control_msgs::action::dds_::FollowJointTrajectory_GetResult_", message + "GetResultRequest")
        node.serve(f"{action}/cancel_goal", "action_msgs::srv::dds_::CancelGoal_", message + "CancelRequest")
        node.serve("/robot_program/set_parameters", "rcl_interfaces::srv::dds_::SetParameters_", message + "SetRequest")
        node.serve("/robot_program/get_parameters", "rcl_interfaces::srv::dds_::GetParameters_", message + "GetRequest")
        for name in ("bore", "stop"):
            node.serve(f"/robot_program/{name}", "std_srvs::srv::dds_::Trigger_", message + "TriggerRequest")

    def error(self):
        """What this touch's probe adds, m."""
        return self.random.normal(0.0, self.options.noise)

    def take(self, name, query, asked, now):
        last, answer = name.rsplit("/", 1)[-1], lambda kind, /, **fields: self.node.answer(query, f"control_msgs/msg/{kind}", **fields)
        types = self.node.store.types
        if last == "send_goal":
            answer("SendGoalResponse", accepted=self.accept(bytes(asked.uuid), asked, now), stamp=self.node.stamp(now))
        elif last == "get_result":
            self.waiting[bytes(asked.uuid)] = query
            self.tell_results()
        elif last == "cancel_goal":
            ended = self.cancel(asked)
            goals = [types["control_msgs/msg/GoalInfo"](uuid=numpy.frombuffer(one, numpy.uint8), stamp=self.node.stamp(now)) for one in ended]
            answer("CancelResponse", return_code=0, goals_canceling=goals)
        elif last == "set_parameters":
            results = []
            for one in asked.parameters:
                known = one.name in self.parameters
                if known:
                    self.parameters[one.name] = one.value.double_value if one.value.type == 3 else one.value.string_value
                results.append(types["control_msgs/msg/SetResult"](successful=known, reason="" if known else "not declared"))
            answer("SetResponse", results=results)
        elif last == "get_parameters":
            empty = dict(bool_value=False, integer_value=0, string_value="", byte_array_value=numpy.array([], numpy.uint8),
                         bool_array_value=numpy.array([], bool), integer_array_value=numpy.array([], numpy.int64),
                         double_array_value=numpy.array([], float), string_array_value=[])
            values = [types["control_msgs/msg/Value"](type=3, double_value=float(self.parameters[one]), **empty) for one in asked.names]
            answer("GetResponse", values=values)
        elif last == "bore":
            self.cutting = (query, now + 1.0)
        elif last == "stop":
            if self.cutting:
                self.node.answer(self.cutting[0], "control_msgs/msg/TriggerResponse", success=False, message="stopped")
            self.cutting = None
            answer("TriggerResponse", success=True, message="")

    def way(self, goal):
        """Instants after the start, the first of which is now, and places of a trajectory in the order of the arm."""
        order = [list(goal.trajectory.joint_names).index(one) for one in self.arm.names]
        points = goal.trajectory.points
        times = [0.0] + [one.time_from_start.sec + one.time_from_start.nanosec * 1e-9 for one in points]
        return numpy.array(times), numpy.array([self.position] + [numpy.array(one.positions)[order] for one in points])

    def accept(self, uuid, goal, now):
        """Whether a goal is accepted, which then begins."""
        path = self.way(goal)
        if self.goal is not None or len(path[0]) < 2 or any(numpy.diff(path[0]) <= 0):
            return False
        self.goal, self.path, self.begun = uuid, path, now
        return True

    def cancel(self, _asked):
        """Goals that end now."""
        ended = [self.goal] if self.goal else []
        if self.goal:
            self.end(STATUS_CANCELED)
        return ended

    def end(self, status, code=0, text=""):
        self.results[self.goal], self.goal, self.path = (status, code, text), None, None
        self.tell_results()

    def tell_results(self):
        for goal in [one for one in self.waiting if one in self.results]:
            status, code, text = self.results[goal]
            self.node.answer(self.waiting.pop(goal), "control_msgs/msg/GetResultResponse", status=status, error_code=code, error_string=text)

    def cut(self):
        """The tool is 60 µm too small in radius; wear offset enlarges the bore; the work offset moves it."""
        run = self.parameters["run_id"]
        if run != self.run_cut:
            self.part.blank()
            self.run_cut = run
        radius = self.part.radius - 60e-6 + self.parameters["tool_1_wear"] / 2
        self.part.radius_now = max(self.part.radius_now, radius)
        self.part.offset = numpy.array([self.parameters[f"work_offset_{axis}"] for axis in "xyz"])
        query, self.cutting = self.cutting[0], None
        self.node.answer(query, "control_msgs/msg/TriggerResponse", success=True, message="")

    def at(self, since):
        """Where its trajectory is so long after the start."""
        return on(self.path, since)

    def moves(self, _before, _now):
        """Where the arm is at each instant between two; none where it stands."""
        return (lambda at: self.at(at - self.begun)) if self.path is not None else None

    def follow(self, now):
        """Ends the goal that has come to its end."""
        if self.goal and now - self.begun >= self.path[0][-1]:
            self.end(STATUS_SUCCEEDED)

    def clearance(self, position):
        return self.part.distance(self.arm.centre(position)) - self.ball + self.extra

    def tick(self, before, now):
        """Moves, and looks for a contact between two instants."""
        if place := self.moves(before, now):
            position = place(now)
            if not self.tripped and self.clearance(position) <= 0:
                low, high = before, now
                for _ in range(20):
                    middle = (low + high) / 2
                    low, high = (low, middle) if self.clearance(place(middle)) <= 0 else (middle, high)
                self.tripped = True
                if self.options.latched:
                    self.state(self.latched, high, place(high))
                late = max(0.0, self.options.delay + self.random.normal(0.0, self.options.jitter))
                self.trips.append(high + late)
            self.position = position
        if self.tripped and self.clearance(self.position) > 0.1e-3:
            self.tripped, self.extra = False, self.error()
            self.shown = False
            self.contact(now, data=False)
        self.state(self.joints, now, self.position)
        for at in [one for one in self.trips if one <= now]:
            self.shown = True
            self.contact(at, data=True)
        self.trips = [one for one in self.trips if one > now]
        self.follow(now)

    def state(self, publish, at, position):
        empty = numpy.array([], float)
        publish(at, header=self.node.header(at), name=self.arm.names, position=position, velocity=empty, effort=empty)

    def run(self):
        signal.signal(signal.SIGTERM, lambda *_: setattr(self, "ended", True))
        before = time.time()
        beat = itertools.count()
        while not self.ended:
            now = time.time()
            while not self.node.requests.empty():
                self.take(*self.node.requests.get(), now)
            self.tick(before, now)
            if self.cutting and now > self.cutting[1]:
                self.cut()
            if next(beat) % 50 == 0:
                self.contact(now, data=self.shown)
            before = now
            time.sleep(max(0.0, now + PERIOD - time.time()))  # its clock, not a wait
        sys.stdout.flush()
        os._exit(0)  # its router may be gone already, which a session would wait for


def arguments():
    parser = argparse.ArgumentParser()
    parser.add_argument("cell", type=pathlib.Path)
    parser.add_argument("--zero", action="append", default=[])
    parser.add_argument("--delay", type=float, default=0.0)
    parser.add_argument("--jitter", type=float, default=0.0)
    parser.add_argument("--noise", type=float, default=4e-6, help="standard deviation of a touch, m")
    parser.add_argument("--latched", action="store_true")
    parser.add_argument("--true", action="store_true", help="the part is where it belongs")
    parser.add_argument("--seed", type=int, default=1)
    return parser


def main(robot, parser):
    options = parser.parse_args()
    robot(options, tomllib.loads(options.cell.read_text())).run()


if __name__ == "__main__":
    main(Robot, arguments())
