"""Frames and markers of a recording, against an independent implementation of URDF kinematics (PyPI pytransform3d).

usage: frames.py BAG...
Every tf of the recording is compared with the link poses that pytransform3d computes from robot_description for the
joint_states of the same stamp: 1 nm and 1 nrad.
"""

import sys

import numpy as np
from mcap_ros2.reader import read_ros2_messages
from pytransform3d.rotations import matrix_from_quaternion
from pytransform3d.urdf import UrdfTransformManager


def matrix(transform):
    pose = np.eye(4)
    turn, at = transform.rotation, transform.translation
    pose[:3, :3] = matrix_from_quaternion([turn.w, turn.x, turn.y, turn.z])
    pose[:3, 3] = [at.x, at.y, at.z]
    return pose


def stamp(header):
    return header.stamp.sec * 10**9 + header.stamp.nanosec


def in_root(frames, name):
    pose = np.eye(4)
    while name in frames:
        parent, of_it = frames[name]
        pose, name = of_it @ pose, parent
    return name, pose


def check(bag):
    robot, joints, fixed, moving, plan = None, {}, {}, [], None
    for message in read_ros2_messages(bag):
        topic = message.channel.topic.split("/", 2)[2]
        value = message.ros_msg
        if topic == "robot_description":
            robot = value.data
        elif topic == "joint_states":
            joints[stamp(value.header)] = dict(zip(value.name, value.position))
        elif topic == "inspection_plan":
            plan = value
        elif topic == "tf_static":
            for one in value.transforms:
                fixed[one.child_frame_id] = (one.header.frame_id, matrix(one.transform))
        elif topic == "tf":
            moving.append(value)
    manager = UrdfTransformManager()
    manager.load_urdf(robot)
    poses, links, worst = 0, set(), 0.0
    frames = dict(fixed)
    for value in moving:
        for one in value.transforms:
            frames[one.child_frame_id] = (one.header.frame_id, matrix(one.transform))
        for name, position in joints[stamp(value.transforms[0].header)].items():
            manager.set_joint(name, position)
        for name in frames:
            if name in ("part", "stylus"):
                continue
            root, pose = in_root(frames, name)
            assert root == "foundation", (bag, name, root)
            expected = manager.get_transform(name, "foundation")
            worst = max(worst, np.abs(pose - expected).max())
            links.add(name)
        poses += 1
    assert worst < 1e-9, (bag, worst)
    assert {"workpiece", "probe_mount"} <= links, (bag, links)
    part = frames["part"]
    assert part[0] == "workpiece" and frames["stylus"][0] == "probe_mount"
    at = plan.part_pose.position
    assert np.allclose(part[1][:3, 3], [at.x, at.y, at.z], atol=1e-12), bag
    print(f"{bag}: {poses} poses of {len(links)} links agree, worst {worst:.1e} m or rad")
    return poses


if __name__ == "__main__":
    total = sum(check(bag) for bag in sys.argv[1:])
    assert total >= 1000, f"{total} poses are too few"
