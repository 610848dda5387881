"""Deviations of the touches in bags, by the contract's definition and nothing of the project.

    python numpy_deviations.py BAG...

prints one JSON line for each bag: {"bag": path, "deviations": {sequence: metres}}. d = n.(c - p) - r, where c is the
ball centre in the part frame by the URDF's nominal chain at the latched positions. Needs numpy and mcap-ros2-support.
"""

import json
import sys
import xml.etree.ElementTree as ElementTree

import numpy
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory


def turned(axis, angle):
    """Rotation about an axis by Rodrigues' formula."""
    x, y, z = axis / numpy.linalg.norm(axis)
    cross = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return numpy.eye(3) + numpy.sin(angle) * cross + (1 - numpy.cos(angle)) * cross @ cross


def pose(rotation, translation):
    matrix = numpy.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation
    return matrix


def numbers(element, attribute, default):
    return numpy.array([float(word) for word in (element.get(attribute, default) if element is not None else default).split()])


def quaternion(q):
    x, y, z, w = q.x, q.y, q.z, q.w
    n = x * x + y * y + z * z + w * w
    return numpy.eye(3) + (2 / n) * numpy.array(
        [
            [-(y * y + z * z), x * y - z * w, x * z + y * w],
            [x * y + z * w, -(x * x + z * z), y * z - x * w],
            [x * z - y * w, y * z + x * w, -(x * x + y * y)],
        ]
    )


class Machine:
    def __init__(self, urdf):
        root = ElementTree.fromstring(urdf)
        self.above = {joint.find("child").get("link"): joint for joint in root.findall("joint")}

    def foundation_from(self, link, positions):
        matrix = numpy.eye(4)
        while link in self.above:
            joint = self.above[link]
            matrix = self.motion(joint, positions) @ matrix
            link = joint.find("parent").get("link")
        assert link == "foundation", link
        return matrix

    @staticmethod
    def motion(joint, positions):
        origin = joint.find("origin")
        roll, pitch, yaw = numbers(origin, "rpy", "0 0 0")
        z, y, x = numpy.eye(3)[::-1]
        placed = pose(turned(z, yaw) @ turned(y, pitch) @ turned(x, roll), numbers(origin, "xyz", "0 0 0"))
        axis = numbers(joint.find("axis"), "xyz", "1 0 0")
        kind = joint.get("type")
        if kind == "fixed":
            return placed
        position = positions[joint.get("name")]
        if kind == "prismatic":
            return placed @ pose(numpy.eye(3), position * axis / numpy.linalg.norm(axis))
        return placed @ pose(turned(axis, position), numpy.zeros(3))


def deviations(path):
    with open(path, "rb") as stream:
        messages = [
            (channel.topic.rsplit("/", 1)[-1], decoded)
            for _, channel, _, decoded in make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        ]
    machine = Machine(next(message.data for topic, message in messages if topic == "robot_description"))
    plan = next(message for topic, message in messages if topic == "inspection_plan")
    at = plan.part_pose.position
    workpiece_from_part = pose(quaternion(plan.part_pose.orientation), [at.x, at.y, at.z])
    ball = plan.stylus.ball_center
    found = {}
    for topic, event in messages:
        if topic != "probe_events" or event.outcome != 0:
            continue
        positions = dict(zip(event.axis_names, event.axis_positions))
        foundation_from_part = machine.foundation_from("workpiece", positions) @ workpiece_from_part
        foundation_from_mount = machine.foundation_from("probe_mount", positions)
        centre = numpy.linalg.solve(foundation_from_part, foundation_from_mount @ [ball.x, ball.y, ball.z, 1.0])[:3]
        point = plan.points[event.point_index]
        normal = numpy.array([point.normal.x, point.normal.y, point.normal.z])
        nominal = numpy.array([point.position.x, point.position.y, point.position.z])
        normal /= numpy.linalg.norm(normal)
        found[event.sequence] = float(normal @ (centre - nominal) - plan.stylus.ball_radius)
    return found


for bag in sys.argv[1:]:
    print(json.dumps({"bag": bag, "deviations": deviations(bag)}))
