"""Deviations of every touch of a bag by the interface contract, in NumPy: one JSON array per bag on standard output.

An implementation of its own (homogeneous matrices, mcap-ros2-support), to check the crate against.
"""

import json
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
from mcap_ros2.reader import read_ros2_messages


def numbers(element, name, usual):
    return np.array([float(v) for v in (element.get(name, usual) if element is not None else usual).split()])


def rigid(rotation, shift):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, shift
    return matrix


def about(axis, angle):
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def branch(urdf, end, positions):
    parents = {joint.find("child").get("link"): joint for joint in urdf.findall("joint")}
    chain, link = [], end
    while link != "foundation":
        chain.insert(0, parents[link])
        link = chain[0].find("parent").get("link")
    pose = np.eye(4)
    for joint in chain:
        origin = joint.find("origin")
        roll, pitch, yaw = numbers(origin, "rpy", "0 0 0")
        turn = about([0, 0, 1], yaw) @ about([0, 1, 0], pitch) @ about([1, 0, 0], roll)
        pose = pose @ rigid(turn, numbers(origin, "xyz", "0 0 0"))
        axis = numbers(joint.find("axis"), "xyz", "1 0 0")
        axis = axis / np.linalg.norm(axis)
        position = positions.get(joint.get("name"), 0.0)
        if joint.get("type") == "prismatic":
            pose = pose @ rigid(np.eye(3), axis * position)
        elif joint.get("type") in ("revolute", "continuous"):
            pose = pose @ rigid(about(axis, position), np.zeros(3))
    return pose


def vector(message):
    return np.array([message.x, message.y, message.z])


def deviations(path):
    urdf = plan = None
    events = []
    for item in read_ros2_messages(path):
        topic = item.channel.topic.rsplit("/", 1)[-1]
        if topic == "robot_description":
            urdf = ElementTree.fromstring(item.ros_msg.data)
        elif topic == "inspection_plan":
            plan = item.ros_msg
        elif topic == "probe_events":
            events.append(item.ros_msg)
    q = plan.part_pose.orientation
    imaginary, real = vector(q), q.w
    half = 2 * np.arctan2(np.linalg.norm(imaginary), real)
    axis = imaginary / np.linalg.norm(imaginary) if np.linalg.norm(imaginary) > 0 else np.array([0, 0, 1.0])
    part_pose = rigid(about(axis, half), vector(plan.part_pose.position))
    result = []
    for event in events:
        positions = dict(zip(event.axis_names, event.axis_positions))
        part = branch(urdf, "workpiece", positions) @ part_pose
        ball = branch(urdf, "probe_mount", positions) @ np.append(vector(plan.stylus.ball_center), 1)
        centre = (np.linalg.inv(part) @ ball)[:3]
        point = plan.points[event.point_index]
        away = centre - vector(point.position)
        result.append(float(vector(point.normal) @ away - plan.stylus.ball_radius))
    return result


for name in sys.argv[1:]:
    print(json.dumps(deviations(name)))
