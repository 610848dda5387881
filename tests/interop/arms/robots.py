"""Robots of the package `example-robot-data` as machines: the root link hangs on a link `foundation`, pictures are left out."""

import pathlib
import sys
import xml.etree.ElementTree as tree

MOVES = ("revolute", "continuous", "prismatic")


def folder():
    """Where pip has put the robots."""
    for place in map(pathlib.Path, sys.path):
        found = place / "cmeel.prefix/share/example-robot-data/robots"
        if found.is_dir():
            return found
    raise SystemExit("example-robot-data is not installed")


def files():
    """All robot descriptions of the package, each once."""
    return sorted(folder().rglob("*.urdf"))


def joints(text):
    """Names of the joints that move and follow no other, and of all others that are not fixed."""
    driven, held = [], []
    for joint in tree.fromstring(text).findall("joint"):
        if joint.get("type") in MOVES and joint.find("mimic") is None:
            driven.append(joint.get("name"))
        elif joint.get("type") != "fixed":
            held.append(joint.get("name"))
    return driven, held


def apart(text):
    """The same with no link named like a joint: Pinocchio cannot tell them apart."""
    robot = tree.fromstring(text)
    names = {joint.get("name") for joint in robot.findall("joint")}
    links = robot.findall("link") + robot.findall("joint/parent") + robot.findall("joint/child")
    for element in links:
        key = "name" if element.tag == "link" else "link"
        if element.get(key) in names:
            element.set(key, element.get(key) + " link")
    return tree.tostring(robot, encoding="unicode")


def fixed(robot, name, parent, child):
    joint = tree.SubElement(robot, "joint", name=name, type="fixed")
    tree.SubElement(joint, "parent", link=parent)
    tree.SubElement(joint, "child", link=child)


def machine(text, flange=None):
    """A robot description whose root is `foundation`, with `workpiece` and, at a link of that name, `probe_mount`."""
    robot = tree.fromstring(text)
    for unused in ("transmission", "gazebo", "material", "ros2_control"):
        for element in robot.findall(unused):
            robot.remove(element)
    for link in robot.findall("link"):
        for unused in ("visual", "collision"):
            for element in link.findall(unused):
                link.remove(element)
    children = {joint.find("child").get("link") for joint in robot.findall("joint")}
    roots = [link.get("name") for link in robot.findall("link") if link.get("name") not in children]
    assert len(roots) == 1, roots
    for name in ("foundation",) + (("workpiece", "probe_mount") if flange else ()):
        tree.SubElement(robot, "link", name=name)
    fixed(robot, "foundation_to_root", "foundation", roots[0])
    if flange:
        fixed(robot, "foundation_to_workpiece", "foundation", "workpiece")
        fixed(robot, "flange_to_probe_mount", flange, "probe_mount")
    return tree.tostring(robot, encoding="unicode")
