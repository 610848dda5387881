"""Walks a measuring program through what its plan proves of the part, and tells what is wrong with it.

Shares no code with the product. Metres, radians, seconds; everything is seen from the part frame.

The machine is the URDF's nominal chain. Between two targets every axis goes straight and all arrive together, which is how
the simulator's controller and an interpolated rapid (G0 of LinuxCNC, G1 elsewhere) run a move. Axes that arrive one after
the other (a positioning rapid without interpolation) are NOT covered.

The stylus is the ball, and a stem of 0.75 of its radius (the thickest in the catalogues) from the ball's centre to the
mount's origin. The probe's body, the table and clamps are in no plan, so they are not looked at. Of the machine, links that
carry the probe and have a `collision` cylinder in the URDF (spindle, links of an arm) count as capsules about its axis.

The part is surface that touches prove, a patch for each feature:
  plane            the convex hull of its touches, without the openings of bores
  cylinder, bore,  the feature's surface between its lowest and highest touch, over the angles between neighbouring touches
  cone             that are less than half a turn apart; not over an angle where another feature was touched below it
  sphere           the cap around its touches
  other            a disc about each touch, half as wide as the way to the next one, at most as wide as the ball
A patch is obstacle from both sides. Ball and stem may not come nearer to a patch than their radius, but for the ball to
the patch of a feature while it goes to a touch of it, as far as the nominal contact, and back. Where a plan demands a touch
that no order can make (a face touched where a boss stands, see `impossible`), that boss is no obstacle on that touch's own
moves and on the ones next to them; on all others it is.
What is proved nowhere (an edge beyond the last touch, a floor never touched) is not an obstacle: a way through it is not
found. Ways are searched without gaps: a piece of a move and of the stem is done with when it is farther from the patch than
anything on it can move, else it is halved, down to 20 µm.
"""

import dataclasses
import xml.etree.ElementTree as ElementTree

import numpy

PLANE, CYLINDER, BORE, SPHERE, CONE = range(5)
CLEARANCE, APPROACH, TOUCH, RETRACT = range(4)
STEM = 0.75
FINEST = 20e-6
TOLERANCE = 5e-6
DEEPER = 0.2e-3
ON_TARGET = 5e-6


# --- the plan ---------------------------------------------------------------------------------------------------------


def field(holder, name):
    return holder[name] if isinstance(holder, dict) else getattr(holder, name)


def vector(holder, name=None):
    holder = field(holder, name) if name else holder
    return numpy.array([field(holder, letter) for letter in "xyz"], float)


def unit(v):
    return v / numpy.linalg.norm(v)


def rotation(about, angle):
    """Rotation about an axis by Rodrigues' formula; angle may be an array."""
    x, y, z = unit(about)
    cross = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sine, cosine = (f(angle)[..., None, None] for f in (numpy.sin, numpy.cos))
    return numpy.eye(3) + sine * cross + (1 - cosine) * (cross @ cross)


@dataclasses.dataclass
class Plan:
    """An InspectionPlan, from a decoded message or from JSON."""

    kinds: list
    origins: list
    axes: list
    names: list
    feature: numpy.ndarray
    position: numpy.ndarray
    normal: numpy.ndarray
    approach: numpy.ndarray
    retract: numpy.ndarray
    rotary_names: list
    rotary: list
    ball: numpy.ndarray
    radius: float
    pose: tuple
    stages: list

    @classmethod
    def of(cls, message):
        features, points = field(message, "features"), field(message, "points")
        pose, stylus = field(message, "part_pose"), field(message, "stylus")
        turn = field(pose, "orientation")
        w, (x, y, z) = field(turn, "w"), vector(turn)
        angle = 2 * numpy.arctan2(numpy.linalg.norm([x, y, z]), w)
        about = numpy.array([x, y, z]) if abs(angle) > 1e-15 else numpy.array([0.0, 0.0, 1.0])
        return cls(
            kinds=[field(one, "kind") for one in features],
            origins=[vector(one, "origin") for one in features],
            axes=[vector(one, "axis") for one in features],
            names=[field(one, "id") for one in features],
            feature=numpy.array([field(one, "feature") for one in points], int),
            position=numpy.array([vector(one, "position") for one in points]),
            normal=numpy.array([unit(vector(one, "normal")) for one in points]),
            approach=numpy.array([field(one, "approach_distance") for one in points]),
            retract=numpy.array([field(one, "retract_distance") for one in points]),
            rotary_names=list(field(message, "rotary_names")),
            rotary=[list(field(one, "rotary_positions")) for one in points],
            ball=vector(stylus, "ball_center"),
            radius=field(stylus, "ball_radius"),
            pose=(rotation(about, numpy.asarray(angle)), vector(pose, "position")),
            stages=[0] * len(points),
        )


# --- the machine ------------------------------------------------------------------------------------------------------


class Machine:
    """The nominal chain of a URDF."""

    def __init__(self, urdf, plan):
        self.above = {joint.find("child").get("link"): joint for joint in ElementTree.fromstring(urdf).findall("joint")}
        self.links = {link.get("name"): link for link in ElementTree.fromstring(urdf).findall("link")}
        self.plan = plan
        moving = [joint for joint in self.above.values() if joint.get("type") != "fixed"]
        self.names = [joint.get("name") for joint in moving]

        def limit(joint, what, otherwise):
            element = joint.find("limit")
            told = None if element is None else element.get(what)
            return otherwise if told is None or (what != "velocity" and joint.get("type") == "continuous") else float(told)

        self.lower = {joint.get("name"): limit(joint, "lower", -numpy.inf) for joint in moving}
        self.upper = {joint.get("name"): limit(joint, "upper", numpy.inf) for joint in moving}
        self.speed = {joint.get("name"): limit(joint, "velocity", 0.0) or 0.05 for joint in moving}

    def foundation_from(self, link, positions):
        """Rotations (n,3,3) and translations (n,3)."""
        count = len(next(iter(positions.values())))
        turn, at = numpy.broadcast_to(numpy.eye(3), (count, 3, 3)), numpy.zeros((count, 3))
        while link in self.above:
            joint = self.above[link]
            own_turn, own_at = self.motion(joint, positions, count)
            turn, at = own_turn @ turn, numpy.einsum("nij,nj->ni", own_turn, at) + own_at
            link = joint.find("parent").get("link")
        assert link == "foundation", f"the chain ends in {link}"
        return turn, at

    @staticmethod
    def motion(joint, positions, count):
        def numbers(element, attribute, default):
            text = default if element is None else element.get(attribute, default)
            return numpy.array([float(word) for word in text.split()])

        origin = joint.find("origin")
        x, y, z = numpy.eye(3)
        roll, pitch, yaw = numbers(origin, "rpy", "0 0 0")
        placed = rotation(z, numpy.asarray(yaw)) @ rotation(y, numpy.asarray(pitch)) @ rotation(x, numpy.asarray(roll))
        at = numbers(origin, "xyz", "0 0 0")
        turn, shift = numpy.broadcast_to(placed, (count, 3, 3)), numpy.broadcast_to(at, (count, 3))
        if joint.get("type") == "fixed":
            return turn, shift
        axis = unit(numbers(joint.find("axis"), "xyz", "1 0 0"))
        position = positions[joint.get("name")]
        if joint.get("type") == "prismatic":
            return turn, shift + position[:, None] * (placed @ axis)
        return placed @ rotation(axis, position), shift

    def stylus(self, names, positions):
        """Ball centre and mount's origin in the part frame, (n,3) each, for positions (n, axes)."""
        by_name = {name: positions[:, column] for column, name in enumerate(names)}
        part_turn, part_at = self.foundation_from("workpiece", by_name)
        turn, at = self.plan.pose
        part_at = part_turn @ at + part_at
        part_turn = part_turn @ turn
        mount_turn, mount_at = self.foundation_from("probe_mount", by_name)
        ball = mount_turn @ self.plan.ball + mount_at
        return tuple(numpy.einsum("nji,nj->ni", part_turn, point - part_at) for point in (ball, mount_at))


    def carriers(self):
        """(link, radius, ends of the axis in the link's frame) of each collision cylinder on the way to the probe that moves."""
        found, link, moving = [], "probe_mount", []
        while link in self.above:
            moving.append(link)
            link = self.above[link].find("parent").get("link")
        while moving and self.above[moving[-1]].get("type") == "fixed":
            moving.pop()
        for link in moving:
            for collision in self.links[link].findall("collision"):
                cylinder = collision.find("geometry/cylinder")
                if cylinder is None:
                    continue
                # As a fixed joint: its frame in the link's.
                fixed = ElementTree.fromstring('<joint type="fixed"/>')
                if collision.find("origin") is not None:
                    fixed.append(collision.find("origin"))
                turn, at = self.motion(fixed, {}, 1)
                half = 0.5 * float(cylinder.get("length")) * turn[0][:, 2]
                found.append((link, float(cylinder.get("radius")), (at[0] - half, at[0] + half)))
        return found

    def carrier(self, names, positions, link, ends):
        """Both ends of a carrier's axis in the part frame, (n,3) each."""
        by_name = {name: positions[:, column] for column, name in enumerate(names)}
        part_turn, part_at = self.foundation_from("workpiece", by_name)
        turn, at = self.plan.pose
        part_at = part_turn @ at + part_at
        part_turn = part_turn @ turn
        own_turn, own_at = self.foundation_from(link, by_name)
        return tuple(numpy.einsum("nji,nj->ni", part_turn, own_turn @ end + own_at - part_at) for end in ends)


# --- what touches prove -----------------------------------------------------------------------------------------------


def segment_distance(points, a, b):
    along = b - a
    square = along @ along
    share = numpy.clip((points - a) @ along / square, 0, 1) if square > 0 else numpy.zeros(len(points))
    return numpy.linalg.norm(points - a - share[:, None] * along, axis=1)


def crosswise(axis):
    first = unit(numpy.cross(axis, numpy.eye(3)[numpy.argmin(abs(axis))]))
    return first, numpy.cross(axis, first)


class Polygon:
    """The convex hull of coplanar points, without round holes (origin, axis, radius)."""

    def __init__(self, points, normal, holes=()):
        self.normal, self.points = normal, points
        u, v = crosswise(normal)
        flat = sorted({(round(float(p @ u), 9), round(float(p @ v), 9)) for p in points})

        def turns_right(a, b, c):
            return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) <= 0

        def half(walk):
            chain = []
            for p in walk:
                while len(chain) > 1 and turns_right(*chain[-2:], p):
                    chain.pop()
                chain.append(p)
            return chain[:-1]

        ring = half(flat) + half(flat[::-1]) if len(flat) > 2 else flat
        height = points[0] @ normal
        self.ring = [a * u + b * v + height * normal for a, b in ring]
        self.height = height
        self.holes = []
        for origin, axis, radius in holes:
            lean = abs(axis @ normal)
            if lean > 1e-3:
                # An inclined hole opens wider: the circle around the ellipse.
                self.holes.append((origin + axis * ((height - origin @ normal) / (axis @ normal)), radius / lean))

    def distance(self, points):
        edges = list(zip(self.ring, self.ring[1:] + self.ring[:1]))
        rim = numpy.min([segment_distance(points, a, b) for a, b in edges], axis=0)
        if len(edges) < 3:
            return rim
        inside = numpy.all([(points - a) @ numpy.cross(self.normal, b - a) >= 0 for a, b in edges], axis=0)
        height = points @ self.normal - self.height
        found = numpy.where(inside, abs(height), rim)
        for centre, radius in self.holes:
            across = numpy.linalg.norm(points - height[:, None] * self.normal - centre, axis=1)
            found = numpy.where(across < radius, numpy.maximum(found, numpy.hypot(radius - across, height)), found)
        return found


class Revolved:
    """A straight line turned about an axis, over some angles."""

    def __init__(self, origin, axis, touches, others):
        self.origin, self.axis = origin, unit(axis)
        self.u, self.v = crosswise(self.axis)
        height, radius, angle = self.polar(touches)
        low, high = height.min(), height.max()
        slope = numpy.polyfit(height, radius, 1) if high - low > 1e-6 else numpy.array([0.0, radius.mean()])
        self.ends = [(numpy.polyval(slope, h), h) for h in (low, high)]
        angles = numpy.sort(angle)
        angles = angles[numpy.diff(angles, prepend=angles[-1] - 2 * numpy.pi) > 1e-6]
        h, r, a = self.polar(others) if len(others) else (numpy.zeros(0),) * 3
        below = a[(h >= low) & (h <= high) & (r < numpy.polyval(slope, h) - 1e-6)]
        self.sectors = []
        for start, width in zip(angles, numpy.diff(angles, append=angles[0] + 2 * numpy.pi)):
            proved = width < numpy.pi - 1e-6 and not numpy.any((below - start) % (2 * numpy.pi) <= width)
            self.sectors.append((start, width if proved else 0.0))

    def polar(self, points):
        arm = points - self.origin
        x, y = arm @ self.u, arm @ self.v
        return arm @ self.axis, numpy.hypot(x, y), numpy.arctan2(y, x)

    def encloses(self, points, margin):
        """Inside the solid of which the patch is the skin, a margin (m) longer at both ends."""
        height, radius, _ = self.polar(points)
        (low_radius, low), (high_radius, high) = self.ends
        return (radius < max(low_radius, high_radius)) & (low - margin <= height) & (height <= high + margin)

    def distance(self, points):
        height, radius, angle = self.polar(points)
        a, b = (numpy.array(end) for end in self.ends)
        inside = numpy.zeros(len(points), bool)
        least = numpy.full(len(points), numpy.inf)
        for start, width in self.sectors:
            inside |= (angle - start) % (2 * numpy.pi) <= width
            out = numpy.cos(start) * self.u + numpy.sin(start) * self.v
            rim = [self.origin + r * out + h * self.axis for r, h in (a, b)]
            least = numpy.minimum(least, segment_distance(points, *rim))
        return numpy.where(inside, segment_distance(numpy.column_stack([radius, height]), a, b), least)


class Cap:
    """Of a sphere."""

    def __init__(self, centre, touches):
        out = touches - centre
        self.centre, self.radius = centre, numpy.linalg.norm(out, axis=1).mean()
        middle = out.sum(axis=0)
        self.middle = unit(middle) if numpy.linalg.norm(middle) > 1e-9 else numpy.array([0.0, 0.0, 1.0])
        cosine = out @ self.middle / self.radius
        self.half = numpy.arccos(numpy.clip(cosine, -1, 1)).max() if numpy.linalg.norm(middle) > 1e-9 else numpy.pi

    def distance(self, points):
        arm = points - self.centre
        height = arm @ self.middle
        across = numpy.linalg.norm(arm - height[:, None] * self.middle, axis=1)
        rim = numpy.hypot(across - self.radius * numpy.sin(self.half), height - self.radius * numpy.cos(self.half))
        return numpy.where(numpy.arctan2(across, height) <= self.half, abs(numpy.hypot(across, height) - self.radius), rim)


class Disc:
    def __init__(self, at, normal, radius):
        self.at, self.normal, self.radius = at, normal, radius

    def distance(self, points):
        arm = points - self.at
        height = arm @ self.normal
        across = numpy.linalg.norm(arm - height[:, None] * self.normal, axis=1)
        return numpy.hypot(numpy.maximum(across - self.radius, 0), height)


def patches(plan):
    """(feature, patch) of everything that the plan's touches prove."""
    found, holes = [], []
    for feature, kind in enumerate(plan.kinds):
        own = plan.feature == feature
        if kind == BORE and own.any():
            arm, axis = plan.position[own] - plan.origins[feature], unit(plan.axes[feature])
            radius = numpy.linalg.norm(arm - numpy.outer(arm @ axis, axis), axis=1).mean()
            holes.append((plan.origins[feature], axis, radius))
    for feature, kind in enumerate(plan.kinds):
        own = plan.feature == feature
        touches, others = plan.position[own], plan.position[~own]
        if not len(touches):
            continue
        if kind == PLANE:
            found.append((feature, Polygon(touches, plan.normal[own][0], holes)))
        elif kind in (CYLINDER, BORE, CONE):
            # What was touched below the surface of a hole is its own wall.
            found.append((feature, Revolved(plan.origins[feature], plan.axes[feature], touches, others[:0] if kind == BORE else others)))
        elif kind == SPHERE:
            found.append((feature, Cap(plan.origins[feature], touches)))
        else:
            for at, normal in zip(touches, plan.normal[own]):
                way = numpy.linalg.norm(touches - at, axis=1)
                half = 0.5 * min(way[way > 1e-9], default=numpy.inf)
                found.append((feature, Disc(at, normal, min(half, plan.radius))))
    return found


# --- the walk ---------------------------------------------------------------------------------------------------------


@dataclasses.dataclass
class Move:
    """One straight move of the axes to a touch (of a point), for a touch as far as the contact."""

    kind: int
    point: int
    start: numpy.ndarray
    end: numpy.ndarray


def run(plan, machine, order, complaints):
    """The moves as the cell runs them, from the first approach on."""
    names, at, moves = order["axis_names"], None, []
    for one in order["moves"]:
        target, point = numpy.array(one["axis_positions"], float), one["point_index"]
        if at is not None:
            end = target
            if one["kind"] == TOUCH:
                # The probe triggers at the contact: the rest of the move is not made.
                height = [
                    plan.normal[point] @ (machine.stylus(names, q[None])[0][0] - plan.position[point]) - plan.radius
                    for q in (at, target)
                ]
                if not height[0] > 0 > height[1]:
                    complaints.append(f"point {point}: its probing move goes from {height[0]:.6f} to {height[1]:.6f} m over it")
                    height = [1.0, 0.0]
                end = at + (target - at) * height[0] / (height[0] - height[1])
            moves.append(Move(one["kind"], point, at, end))
            target = end
        at = target
    return moves


def walked(plan, obstacles, moves, stylus, exempt=lambda move, feature: False, shapes=None):
    """{move: (feature of the patch, 'ball' or 'stem', how deep in m)} of what is hit worst. `stylus` gives ball and mount for
    positions; `exempt` tells which feature is no obstacle on which move; `shapes` are names and radii of what is between both
    ends, where that is no stylus."""
    if not moves:
        return {}
    start, way = (numpy.array(part) for part in ([one.start for one in moves], [one.end - one.start for one in moves]))
    # How far ball and mount go in a whole move at the rate of its fastest piece, m.
    pieces = 64
    rates = numpy.zeros(len(moves))
    shares = numpy.linspace(0, 1, pieces + 1)
    places = (start[:, None] + shares[None, :, None] * way[:, None]).reshape(-1, way.shape[1])
    path = [end.reshape(len(moves), pieces + 1, 3) for end in stylus(places)]
    for end in path:
        rates = numpy.maximum(rates, numpy.linalg.norm(numpy.diff(end, axis=1), axis=2).max(axis=1) * pieces * 1.2)
    length = numpy.linalg.norm(path[0][:, 0] - path[1][:, 0], axis=1)

    worst = {}
    for what, radius in shapes or (("ball", plan.radius), ("stem", STEM * plan.radius)):
        if what != "ball" and length.max() < 1e-9:
            continue
        for feature, patch in obstacles:
            own = [what == "ball" and one.kind in (TOUCH, RETRACT) and plan.feature[one.point] == feature for one in moves]
            # Pieces of (move, middle and half width along the move, the same along the stem).
            move = numpy.array([index for index in range(len(moves)) if not own[index] and not exempt(index, feature)], int)
            s, ds = numpy.full(len(move), 0.5), numpy.full(len(move), 0.5)
            t, dt = (numpy.full(len(move), 0.0 if what == "ball" else 0.5) for _ in range(2))
            deepest = numpy.full(len(moves), TOLERANCE)
            while len(move):
                ball, mount = stylus(start[move] + s[:, None] * way[move])
                depth = radius - patch.distance(ball + t[:, None] * (mount - ball))
                numpy.maximum.at(deepest, move, depth)
                walk, stem = ds * rates[move], dt * length[move]
                # Where a move hits already, what is deeper by less is not looked for.
                floor = deepest[move] + numpy.where(deepest[move] > TOLERANCE, DEEPER, 0.0)
                open_ = (depth + walk + stem > floor) & (walk + stem > FINEST)
                along = (walk >= stem)[open_]
                move, s, ds, t, dt = (one[open_] for one in (move, s, ds, t, dt))
                hs, ht = numpy.where(along, ds / 2, 0), numpy.where(along, 0, dt / 2)
                move = numpy.concatenate([move, move])
                s, t = numpy.concatenate([s - hs, s + hs]), numpy.concatenate([t - ht, t + ht])
                ds, dt = (numpy.concatenate([one, one]) for one in (ds - hs, dt - ht))
            for index in numpy.flatnonzero(deepest > TOLERANCE):
                if deepest[index] > worst.get(index, (None, None, 0.0))[2]:
                    worst[index] = (feature, what, deepest[index])
    return worst


def impossible(plan, machine, order):
    """{(point, feature)}: touches that the plan demands where another feature of it is: with approach, contact or retract in
    the attitude demanded, ball or stem meets the feature's patch or is inside what the patch goes round. No order can
    mend it, and the ball must get in and out somehow: such a feature is no obstacle on the moves of that touch and on
    the ones next to them."""
    names, obstacles, found = order["axis_names"], patches(plan), set()
    moves = run(plan, machine, order, [])
    at = [index for index, one in enumerate(moves) if one.kind in (TOUCH, RETRACT)]
    for index, (feature, _, _) in walked(plan, obstacles, [moves[i] for i in at], lambda q: machine.stylus(names, q)).items():
        found.add((moves[at[index]].point, feature))
    ends = [(one.point, q) for one in moves if one.kind in (TOUCH, RETRACT) for q in (one.start, one.end)]
    balls, mounts = machine.stylus(names, numpy.array([q for _, q in ends])) if ends else ((), ())
    for (point, _), ball, mount in zip(ends, balls, mounts):
        stem = ball + numpy.linspace(0, 1, 201)[:, None] * (mount - ball)
        for feature, patch in obstacles:
            if isinstance(patch, Revolved) and plan.feature[point] != feature and plan.kinds[feature] != BORE:
                if patch.encloses(stem, plan.radius).any():
                    found.add((point, feature))
    return found


def seconds(machine, names, targets):
    """Time of straight moves through positions, the slowest axis at its top speed."""
    speed = numpy.array([machine.speed[name] for name in names])
    return float((abs(numpy.diff(numpy.array(targets), axis=0)) / speed).max(axis=1).sum()) if len(targets) > 1 else 0.0


def complaints(plan, machine, order, given=None):
    """What is wrong with a measuring order: a list of sentences. `given`: positions of the axes at the touches in the order to
    beat."""
    found = []
    names = order["axis_names"]
    if sorted(names) != sorted(machine.names):
        return [f"axes {names} are not those of the machine, {machine.names}"]

    touched = [one["point_index"] for one in order["moves"] if one["kind"] == TOUCH]
    if touched != list(order["order"]):
        found.append("the moves do not touch in the order told")
    for point in range(len(plan.position)):
        times = touched.count(point)
        if times != 1:
            found.append(f"point {point} is touched {times} times")
    stages = [plan.stages[point] for point in touched]
    if stages != sorted(stages):
        found.append("a datum is touched after a feature that needs it")

    for index, one in enumerate(order["moves"]):
        for name, position in zip(names, one["axis_positions"]):
            if not machine.lower[name] - 1e-9 <= position <= machine.upper[name] + 1e-9:
                found.append(f"move {index} takes {name} to {position}, outside {machine.lower[name]} to {machine.upper[name]}")

    targets = numpy.array([one["axis_positions"] for one in order["moves"]], float)
    balls = machine.stylus(names, targets)[0]
    for one, ball, target in zip(order["moves"], balls, targets):
        point = one["point_index"]
        height = {APPROACH: plan.approach[point], RETRACT: plan.retract[point]}.get(one["kind"])
        arm = ball - plan.position[point]
        if height is not None and abs(plan.normal[point] @ arm - plan.radius - height) > ON_TARGET:
            found.append(f"point {point}: approach or retract is not {height} m from it")
        if one["kind"] != CLEARANCE and numpy.linalg.norm(arm - (plan.normal[point] @ arm) * plan.normal[point]) > ON_TARGET:
            found.append(f"point {point}: a move to it is beside its normal")
        for name, wanted in zip(plan.rotary_names, plan.rotary[point]):
            if one["kind"] != CLEARANCE and abs(target[names.index(name)] - wanted) > 1e-6:
                found.append(f"point {point}: {name} is not at {wanted}")

    moves = run(plan, machine, order, found)
    excused = impossible(plan, machine, order)

    def exempt(index, feature):
        # A move is next to the touch that it leaves and to the one that it ends at.
        near = [moves[index].point] if moves[index].kind != CLEARANCE else []
        if index and moves[index - 1].kind == RETRACT:
            near.append(moves[index - 1].point)
        return any((point, feature) in excused for point in near)

    hits = walked(plan, patches(plan), moves, lambda q: machine.stylus(names, q), exempt)
    for link, radius, ends in machine.carriers():
        # Nothing that carries the stylus may touch the part, on whatever move.
        own = walked(plan, patches(plan), moves, lambda q: machine.carrier(names, q, link, ends), shapes=[(link, radius)])
        hits = {**own, **hits}
    for move, (feature, what, depth) in sorted(hits.items()):
        kind = ("clearance", "approach", "touch", "retract")[moves[move].kind]
        found.append(f"{kind} move {move + 1} of point {moves[move].point}: the {what} enters {plan.names[feature]} by {1e3 * depth:.3f} mm")

    if given is not None and len(targets):
        # From contact to contact, without the way to the first and from the last.
        contacts = [index for index, one in enumerate(moves) if one.kind == TOUCH]
        own = seconds(machine, names, [moves[contacts[0]].end] + [one.end for one in moves[contacts[0] + 1 : contacts[-1] + 1]])
        other = seconds(machine, names, given)
        if own > other + 1e-9:
            found.append(f"takes {own:.3f} s, longer than the {other:.3f} s of the order to beat")
    return found
