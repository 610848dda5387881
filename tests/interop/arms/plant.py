"""Arms in motion with one planted cause: trajectories, dynamics by Pinocchio, a servo by integration, recordings by mcap_ros2."""

import dataclasses

import mcap_ros2.writer
import numpy as np
import pinocchio
import scipy.signal

import robots

GRAVITY = 9.80665  # m/s²
STEP = 1e-3  # s, of the simulated servo
SLOWEST, FASTEST = 40.0, 100.0  # rad/s, of the joints' servos
SLIPS = 0.01  # rad/s, above which a joint has all of its dry friction
START = 1_780_000_000  # s, the first stamp

# Description, its flange, and joints that are held.
ARMS = {
    "ur5": ("ur_description/urdf/ur5_robot.urdf", "ee_link", ()),
    "panda": ("panda_description/urdf/panda.urdf", "panda_hand", ("panda_finger_joint1",)),
    "xarm7": ("xarm_description/urdf/xarm7.urdf", "link_eef", ()),
    "z1": ("z1_description/urdf/z1.urdf", "gripperStator", ("jointGripper",)),
    "so101": ("so_arm_description/urdf/so101.urdf", "gripper_frame_link", ("gripper",)),
}

STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


POINT = """================================================================================
MSG: trajectory_msgs/JointTrajectoryPoint
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start
================================================================================
MSG: builtin_interfaces/Duration
int32 sec
uint32 nanosec
"""
STANDARD = STATE[STATE.index("=" * 80) :]
# control_msgs/JointTrajectoryControllerState of ROS 2 Humble, and of Jazzy without its parts for several degrees of freedom.
CONTROLLER = {
    "desired": "std_msgs/Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint desired\n"
    "trajectory_msgs/JointTrajectoryPoint actual\ntrajectory_msgs/JointTrajectoryPoint error\n" + STANDARD + POINT,
    "reference": "std_msgs/Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint reference\n"
    "trajectory_msgs/JointTrajectoryPoint feedback\ntrajectory_msgs/JointTrajectoryPoint error\n"
    "trajectory_msgs/JointTrajectoryPoint output\nfloat64 speed_scaling_factor\n" + STANDARD + POINT,
}


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


class Arm:
    def __init__(self, name):
        path, self.flange, held = ARMS[name]
        self.name = name
        self.text = robots.machine((robots.folder() / path).read_text(), self.flange)
        driven, _ = robots.joints(self.text)
        # The link that has the name of its joint is left out of the question by asking for joints only.
        model = pinocchio.buildModelFromXML(robots.apart(self.text))
        locked = [index for index, joint in enumerate(model.names) if index and (joint not in driven or joint in held)]
        self.model = pinocchio.buildReducedModel(model, locked, pinocchio.neutral(model))
        self.model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
        self.joints = list(self.model.names)[1:]
        self.count = len(self.joints)
        # What it declares, N m per rad/s and N m.
        self.damping, self.friction = np.abs(np.asarray(self.model.damping)), np.abs(np.asarray(self.model.lowerDryFrictionLimit))
        self.mass = sum(inertia.mass for inertia in self.model.inertias)
        self.low, self.high = self.model.lowerPositionLimit.copy(), self.model.upperPositionLimit.copy()
        self.fastest = np.minimum(self.model.velocityLimit, 3.0)

    def efforts(self, model, q, v, a):
        data = model.createData()
        rigid = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, v, a)])
        return rigid + self.damping * v + self.friction * np.tanh(v / SLIPS)

    def weight(self, q):
        still = np.zeros_like(q)
        return self.efforts(self.model, q, still, still)


# --- trajectories: positions, speeds and accelerations at any instants ---


class Series:
    """Harmonics of a slow base frequency."""

    def __init__(self, centre, amplitude, fastest, random):
        count, self.centre = len(centre), centre
        self.rate = 2 * np.pi * random.uniform(0.05, 0.12)
        orders = np.arange(1, 6)
        self.wave = self.rate * orders
        self.size = random.normal(size=(count, len(orders))) / orders
        self.phase = random.uniform(0, 2 * np.pi, self.size.shape)
        self.size *= (amplitude / np.maximum(np.abs(self.size).sum(axis=1), 1e-12))[:, None]
        speed = (np.abs(self.size) * self.wave).sum(axis=1)
        self.size *= np.minimum(1.0, fastest / np.maximum(speed, 1e-12))[:, None]

    def at(self, t):
        angle = self.wave[:, None] * t + self.phase[:, :, None]
        sine, cosine = np.sin(angle), np.cos(angle)
        q = np.einsum("jk,jkt->tj", self.size, sine) + self.centre
        v = np.einsum("jk,k,jkt->tj", self.size, self.wave, cosine)
        a = -np.einsum("jk,k,jkt->tj", self.size, self.wave**2, sine)
        return q, v, a


class Points:
    """From pose to pose by polynomials of fifth order, with a rest at each."""

    def __init__(self, centre, amplitude, fastest, random, length):
        at, poses, begins, ends = 0.0, [centre], [], []
        while at < length:
            pose = centre + amplitude * random.uniform(-1, 1, len(centre))
            way = np.abs(pose - poses[-1])
            takes = max(1.875 * np.max(way / fastest), 0.6) * random.uniform(1.0, 1.6)
            begins.append(at)
            ends.append(at + takes)
            poses.append(pose)
            at += takes + random.uniform(0.1, 0.6)
        self.poses, self.begins, self.ends = np.array(poses), np.array(begins), np.array(ends)

    def at(self, t):
        part = np.clip(np.searchsorted(self.begins, t, side="right") - 1, 0, len(self.begins) - 1)
        takes = (self.ends - self.begins)[part][:, None]
        s = np.clip((t - self.begins[part])[:, None] / takes, 0.0, 1.0)
        way = (self.poses[1:] - self.poses[:-1])[part]
        q = self.poses[part] + way * s**3 * (10 - 15 * s + 6 * s**2)
        v = way * 30 * s**2 * (1 - s) ** 2 / takes
        a = way * 60 * s * (1 - s) * (1 - 2 * s) / takes**2
        return q, v, a


def trajectory(arm, moved, rest, pace, length, random):
    """Of the joints `moved`; the others rest at `rest` (0 to 1 over their way)."""
    low, high = np.maximum(arm.low, -1.8), np.minimum(arm.high, 1.8)
    low = np.minimum(low, high - 1.0)
    centre = low + (high - low) * np.where(moved, random.uniform(0.35, 0.65, arm.count), rest)
    amplitude = np.where(moved, np.minimum(centre - low, high - centre) * random.uniform(0.6, 0.95, arm.count), 0.0)
    if random.random() < 0.6:
        return Series(centre, amplitude, pace * arm.fastest, random)
    return Points(centre, amplitude, pace * arm.fastest, random, length)


def slow_noise(random, count, joints, samples):
    """Of unit size, correlated over so many samples."""
    share = np.exp(-1.0 / samples)
    white = random.normal(size=(count + int(5 * samples), joints))
    return scipy.signal.lfilter([np.sqrt(1 - share**2)], [1, -share], white, axis=0)[-count:]


def ripple(random, q):
    """Of unit size: a function of the joint's own angle, as gears and bearings have it."""
    waves = random.uniform(3, 15, (3, q.shape[1]))
    phases = random.uniform(0, 2 * np.pi, waves.shape)
    values = np.sin(q[None] * waves[:, None] + phases[:, None]).sum(axis=0) * np.sqrt(2 / 3)
    return values - values.mean(axis=0)


# --- one drawn session ---


@dataclasses.dataclass
class Draw:
    cause: str
    arm: str
    channel: str  # effort or motion
    moved: list
    rate: float
    length: float
    size: float  # of the cause, over its usual size
    truth: dict  # parameters that an interval must hold
    gap: float = 0.0  # rms that the cause makes, over that of the remainder
    remainder: float = 0.0
    note: str = ""
    contact: tuple = ()  # recording, and from when to when (s) something presses on the flange


EFFORT = ("payload", "links", "coulomb", "viscous", "rotor", "gain", "contact", "none")
MOTION = ("delay", "droop", "friction", "backlash", "still")
IDENTIFIERS = {
    "payload": {"drive.payload"},
    "links": {"drive.link_inertia"},
    "coulomb": {"drive.coulomb_friction"},
    "viscous": {"drive.viscous_friction"},
    "rotor": {"drive.inertia"},
    "gain": {"drive.effort_gain"},
    "delay": {"drive.delay"},
    "droop": {"drive.droop"},
    "friction": {"drive.coulomb_friction", "drive.backlash"},
    "backlash": {"drive.coulomb_friction", "drive.backlash"},
    "contact": set(),
    "none": set(),
    "still": set(),
}
VISIBLE = 3.0  # a cause makes at least so many times the remainder


def instants(rate, length, jitter, random):
    t = np.arange(int(rate * length)) / rate
    return t + jitter / rate * random.uniform(-1, 1, len(t)) if jitter else t


def session(cause, seed, folder, seconds=(20, 40)):
    """Two recordings, `fit.mcap` and `held.mcap`, of one arm with one cause."""
    random = np.random.default_rng(seed)
    arm = Arm(list(ARMS)[random.integers(len(ARMS))])
    moved = np.ones(arm.count, bool)
    if random.random() < 0.5:
        moved[:] = False
        moved[random.choice(arm.count, random.integers(2, arm.count), replace=False)] = True
    draw = Draw(
        cause,
        arm.name,
        "effort" if cause in EFFORT else "motion",
        [joint for joint, moves in zip(arm.joints, moved) if moves],
        float(random.choice([100, 125, 200, 250, 500])),
        float(random.uniform(*seconds)),
        float(np.exp(random.uniform(np.log(0.5), np.log(2)))),
        {},
    )
    # Who looks for rotors moves fast.
    pace = random.uniform(0.4, 0.8) if cause == "rotor" else random.uniform(0.2, 0.6)
    rests = random.uniform(0.1, 0.9, (2, arm.count))
    if random.random() < 0.7:
        rests[1] = rests[0]
    ways = [trajectory(arm, moved, rest, pace, draw.length, random) for rest in rests]
    make = effort_session if draw.channel == "effort" else motion_session
    make(arm, moved, draw, ways, folder, random)
    return draw


def effort_session(arm, moved, draw, ways, folder, random):
    jitter = random.choice([0.0, 0.0, 0.05])
    times = [instants(draw.rate, draw.length, jitter, random) for _ in ways]
    states = [way.at(t) for way, t in zip(ways, times)]
    nominal = [arm.efforts(arm.model, *state) for state in states]
    both = np.vstack(nominal)
    usual = np.maximum(np.sqrt(np.mean(both**2, axis=0)), 0.02 * rms(both))
    speed = np.maximum(np.sqrt(np.mean(np.vstack([state[1] for state in states]) ** 2, axis=0)), 0.05)
    data = arm.model.createData()
    inertia = np.mean([np.diag(pinocchio.crba(arm.model, data, q)).copy() for q in states[0][0][::100]], axis=0)
    inertia = np.maximum(inertia, 0.03 * inertia.max())
    rest = random.uniform(0.003, 0.012)
    white = random.uniform(0.002, 0.02)
    shape = random.uniform(0.5, 1.5, arm.count)
    payload = random.uniform(0.005, 0.2)
    centre = random.uniform([-0.05, -0.05, 0.0], [0.05, 0.05, 0.12])
    links = random.normal(size=(arm.count, 6))
    strong = np.flatnonzero(moved & (usual > 0.2 * usual.max()))
    one = random.random() < 0.5 and len(strong)
    choice = random.choice(strong) if len(strong) else 0
    remainders = [
        usual * rest * (ripple(random, state[0]) + slow_noise(random, len(t), arm.count, 0.3 * draw.rate)) / np.sqrt(2)
        for state, t in zip(states, times)
    ]
    draw.remainder = rms(np.vstack(remainders))

    def plain(values):
        return dict(zip(arm.joints, map(float, values)))

    def caused(size):
        """Efforts of both motions, and the parameters."""
        if draw.cause == "none":
            return nominal, {}
        if draw.cause == "contact":
            return pressed(arm, draw, times, states, nominal, [rms(one) for one in remainders[0].T], random), {}
        if draw.cause in ("payload", "links"):
            model = arm.model.copy()
            truth = {}
            if draw.cause == "payload":
                mass = min(payload * size, 0.2) * arm.mass
                frame = model.frames[model.getFrameId("probe_mount")]
                load = pinocchio.Inertia(mass, centre, mass * np.diag([0.03**2, 0.03**2, 0.02**2]))
                model.appendBodyToJoint(frame.parentJoint, load, frame.placement)
                truth = {"mass": mass, **dict(zip("xyz", map(float, centre)))}
            else:
                for number in range(1, model.njoints):
                    own, part = model.inertias[number], np.clip(links[number - 1], -2, 2)
                    mass = own.mass * np.exp(0.15 * size * part[0])
                    lever = own.lever + 0.1 * size * part[1:4] * max(np.linalg.norm(own.lever), 0.02)
                    turning = own.inertia * mass / own.mass * np.exp(0.15 * size * part[4])
                    model.inertias[number] = pinocchio.Inertia(mass, lever, turning)
            return [arm.efforts(model, *state) for state in states], truth
        if draw.cause == "gain":
            gain = np.zeros(arm.count)
            gain[:] = 0.0 if one else 0.05 * size * shape[0] * (1 if shape[1] > 0.9 else -1)
            if one:
                gain[choice] = 0.1 * size * shape[0]
            return [effort * (1 + gain) for effort in nominal], {f"{k}.gain": v for k, v in plain(gain).items()}
        name = {"coulomb": "coefficient", "viscous": "coefficient", "rotor": "inertia"}[draw.cause]
        each = 0.1 * size * shape * usual
        if draw.cause == "coulomb":
            value = each
            more = [value * np.tanh(state[1] / SLIPS) for state in states]
        elif draw.cause == "viscous":
            value = each / speed
            more = [value * state[1] for state in states]
        else:
            value = 0.3 * size * shape * inertia
            more = [value * state[2] for state in states]
        truth = {f"{k}.{name}": v for k, v in plain(value).items() if k in draw.moved}
        return [effort + added for effort, added in zip(nominal, more)], truth

    for _ in range(10):
        efforts, draw.truth = caused(draw.size)
        draw.gap = rms(np.vstack(efforts) - both) / draw.remainder
        if draw.cause in ("none", "contact") or draw.gap >= VISIBLE:
            break
        draw.size *= 1.5
    resolution = 2 * np.pi / 2 ** random.integers(15, 21)
    speeds = random.random() < 0.5
    for name, t, state, effort, remainder in zip(("fit", "held"), times, states, efforts, remainders):
        read = np.round((state[0] + resolution * random.normal(0, 0.3, state[0].shape)) / resolution) * resolution
        velocity = state[1] + 0.002 * random.normal(size=state[1].shape) if speeds else None
        effort = effort + remainder + white * usual * random.normal(size=effort.shape)
        record(folder / f"{name}.mcap", arm, t, states=(read, velocity, effort))


def pressed(arm, draw, times, states, nominal, remainder, random):
    """Efforts where a constant force presses on the flange for a while, in one of two motions while the arm moves."""
    number, lasts = random.integers(2), random.uniform(0.3, 2.0)
    begin = random.uniform(0.1, 0.8) * (draw.length - lasts)
    draw.contact = (("fit", "held")[number], float(begin), float(begin + lasts))
    during = (times[number] >= begin) & (times[number] <= begin + lasts)
    force = random.normal(size=3)
    data, frame = arm.model.createData(), arm.model.getFrameId("probe_mount")
    pushed = np.zeros_like(nominal[number])
    for row in np.flatnonzero(during):
        jacobian = pinocchio.computeFrameJacobian(arm.model, data, states[number][0][row], frame, pinocchio.LOCAL_WORLD_ALIGNED)
        pushed[row] = -jacobian[:3].T @ force
    # The joint that feels it most feels 8 to 30 times its remainder.
    felt = np.max(np.sqrt(np.mean(pushed[during] ** 2, axis=0)) / np.maximum(remainder, 1e-12))
    efforts = [one.copy() for one in nominal]
    efforts[number] += pushed * random.uniform(8, 30) / felt
    return efforts


def motion_session(arm, moved, draw, ways, folder, random):
    fine = [np.arange(int(draw.length / STEP) + 1) * STEP for _ in ways]
    middle = np.vstack([way.at(t[::200])[0] for way, t in zip(ways, fine)])
    weight = np.sqrt(np.mean(arm.weight(middle) ** 2, axis=0))
    weight = np.maximum(weight, 0.2 * weight.max())
    data = arm.model.createData()
    inertia = np.mean([np.diag(pinocchio.crba(arm.model, data, q)).copy() for q in middle[::10]], axis=0)
    yields = 0.008 * draw.size * random.uniform(0.5, 1.5, arm.count)  # rad, under the weight
    stiff = np.maximum(weight / yields, inertia * SLOWEST**2)
    yields = weight / stiff
    rotor = np.maximum(0.1 * inertia, stiff / FASTEST**2 - inertia)
    damping = 1.6 * np.sqrt(stiff * (inertia + rotor))
    rub = stiff * yields if draw.cause == "friction" else np.zeros(arm.count)
    dead, lag = random.uniform(0.005, 0.06) * draw.size, 0.0
    if random.random() < 0.4:
        lag = random.uniform(0.01, 0.05)
    if draw.cause != "delay":
        dead = lag = 0.0
    weightless = draw.cause == "droop"
    bare = weightless and random.random() < 0.5
    if weightless:
        draw.note = ", knows no load" if bare else ", knows its inertia, not its weight"
    resolution = 2 * np.pi / 2 ** random.integers(13, 19)
    rest = random.uniform(2e-5, 1e-4)
    if draw.cause == "delay":
        draw.truth = {f"{joint}.dead_time": float(dead) for joint in draw.moved} if not lag else {}
    if draw.cause == "friction":
        draw.truth = {f"{joint}.half_width": float(y) for joint, y in zip(arm.joints, yields) if joint in draw.moved}
    play = np.where(moved, yields / 2, 0.0)
    if draw.cause == "backlash":
        draw.truth = {f"{joint}.half_width": float(y) for joint, y in zip(arm.joints, play) if joint in draw.moved}
    made = []
    for name, way, t in zip(("fit", "held"), ways, fine):
        wanted = late(way, t, dead, lag)
        model = Servo(arm, stiff, damping, rotor, rub, weightless, bare)
        q = model.run(wanted)
        if draw.cause == "backlash":
            q = output(q, play)
        stamps = instants(draw.rate, draw.length - 2 * STEP, 0.0, random)
        read = np.column_stack([np.interp(stamps, t, q[:, joint]) for joint in range(arm.count)])
        command = way.at(stamps)[0]
        made.append(read - command - np.mean(read - command, axis=0))
        read = read + rest * (ripple(random, read) + slow_noise(random, len(stamps), arm.count, 0.3 * draw.rate)) / np.sqrt(2)
        read = np.round((read + resolution * random.normal(0, 0.3, read.shape)) / resolution) * resolution
        record(folder / f"{name}.mcap", arm, stamps, states=(read, None, None), commands=command)
    draw.remainder = float(np.hypot(rest, 0.5 * resolution))
    draw.gap = rms(np.vstack(made)) / draw.remainder


def late(way, t, dead, lag):
    """The trajectory as the servo gets it: late, and behind a first-order lag."""
    parts = way.at(np.maximum(t - dead, 0.0))
    parts = [parts[0], *(part * (t >= dead)[:, None] for part in parts[1:])]
    if not lag:
        return parts
    share = 1 - np.exp(-STEP / lag)
    start = parts[0][:1]
    slow = scipy.signal.lfilter([share], [1, share - 1], parts[0] - start, axis=0) + start
    return slow, np.gradient(slow, STEP, axis=0), np.gradient(np.gradient(slow, STEP, axis=0), STEP, axis=0)


class Servo:
    """Stiffness and damping at each joint, with the efforts that the arm is known to need; without its weight where that is asked."""

    def __init__(self, arm, stiff, damping, rotor, rub, weightless, bare):
        self.arm, self.stiff, self.damping, self.rotor, self.rub = arm, stiff, damping, np.diag(rotor), rub
        self.weightless, self.bare = weightless, bare

    def run(self, wanted):
        model, data, still = self.arm.model, self.arm.model.createData(), np.zeros(self.arm.count)
        q, v = wanted[0][0].copy(), wanted[1][0].copy()
        if self.weightless:  # it has come to rest
            for _ in range(20):
                q = wanted[0][0] - pinocchio.rnea(model, data, q, still, still) / self.stiff
        path = np.empty_like(wanted[0])
        for row, (position, speed, change) in enumerate(zip(*wanted)):
            path[row] = q
            effort = self.stiff * (position - q) + self.damping * (speed - v)
            if not self.bare:
                effort += pinocchio.rnea(model, data, position, speed, change) + self.rotor @ change
                if self.weightless:
                    effort -= pinocchio.rnea(model, data, position, still, still)
            mass = pinocchio.crba(model, data, q)
            mass = np.triu(mass) + np.triu(mass, 1).T + self.rotor
            v = v + STEP * np.linalg.solve(mass, effort - pinocchio.nle(model, data, q, v))
            if self.rub.any():
                v = self.rubbed(v, mass)
            q = q + STEP * v
        return path

    def rubbed(self, v, mass):
        """Speeds after dry friction has taken what it can in one step: impulses within bounds, joint after joint."""
        loose = np.linalg.inv(mass)
        most, pushed = STEP * self.rub, np.zeros_like(v)
        for _ in range(4):
            for joint in range(len(v)):
                asked = np.clip(pushed[joint] - v[joint] / loose[joint, joint], -most[joint], most[joint])
                v = v + loose[:, joint] * (asked - pushed[joint])
                pushed[joint] = asked
        return v


def output(q, play):
    """What hangs behind a gear with this play to each side, held by a little friction of its own."""
    out = np.empty_like(q)
    at = q[0].copy()
    for row, motor in enumerate(q):
        at = np.minimum(np.maximum(at, motor - play), motor + play)
        out[row] = at
    return out


# --- recordings ---


def record(path, arm, times, states, commands=None):
    with open(path, "wb") as file:
        writer = mcap_ros2.writer.Writer(file)
        description = writer.register_msgdef("std_msgs/msg/String", "string data")
        state = writer.register_msgdef("sensor_msgs/msg/JointState", STATE)
        controller = "control_msgs/msg/JointTrajectoryControllerState"
        controllers = {} if commands is None else {name: writer.register_msgdef(controller, text) for name, text in CONTROLLER.items()}
        begun = START * 10**9
        writer.write_message("/cell/robot_description", description, {"data": arm.text}, begun, begun)
        position, velocity, effort = states

        def send(topic, row, instant, position, velocity=None, effort=None):
            sec, nanosec = divmod(instant, 10**9)
            message = {
                "header": {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": "foundation"},
                "name": arm.joints,
                "position": position[row].tolist(),
                "velocity": [] if velocity is None else velocity[row].tolist(),
                "effort": [] if effort is None else effort[row].tolist(),
            }
            writer.write_message(topic, state, message, instant, instant, row)

        for row, time in enumerate(times):
            instant = begun + 10**9 + round(time * 1e9)
            if commands is not None:
                send("/cell/joint_commands", row, instant, commands)
            # What a controller says of itself, as two releases of ROS 2 have it.
            for name, schema in controllers.items():
                sec, nanosec = divmod(instant, 10**9)
                point = {"positions": commands[row].tolist()}
                header = {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": ""}
                message = {"header": header, "joint_names": arm.joints, name: point}
                writer.write_message(f"/controller/{name}", schema, message, instant, instant, row)
            send("/cell/joint_states", row, instant, position, velocity, effort)
        writer.finish()
