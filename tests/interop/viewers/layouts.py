"""Every topic and field that a shipped layout names is in a recording, with the type that its panel expects.

usage: layouts.py FOLDER BAG    (layouts of the cell turn_mill, and a recording of it)
"""

import json
import re
import sys
import xml.etree.ElementTree as tree

import yaml
from mcap_ros2.reader import read_ros2_messages

EXPECTED = {"robot_description": "std_msgs/msg/String", "touch_markers": "visualization_msgs/msg/MarkerArray"}


def main(folder, bag):
    seen, types = {}, {}
    for message in read_ros2_messages(bag):
        topic = message.channel.topic
        seen.setdefault(topic, message.ros_msg)
        types[topic] = message.schema.name

    def field(topic, path):
        assert topic in seen, f"{topic} is not in {bag}"
        value = seen[topic]
        for name in path:
            assert hasattr(value, name), f"{topic} has no field {name}"
            value = getattr(value, name)

    count = 0
    with open(f"{folder}/foxglove.json") as file:
        layout = json.load(file)
    panels = set()

    def leaves(node):
        if isinstance(node, str):
            panels.add(node)
        else:
            leaves(node["first"]), leaves(node["second"])

    leaves(layout["layout"])
    assert panels == set(layout["configById"]), "each panel is placed, and each place has a panel"
    for config in layout["configById"].values():
        paths = [path["value"] for path in config.get("paths", [])] + [config.get("topicPath")]
        for path in filter(None, paths):
            topic, *rest = path.split(".")
            field(topic, [re.sub(r"\[.*\]", "", name) for name in rest])
            count += 1
        for topic in [*config.get("topics", {}), *(layer.get("topic") for layer in config.get("layers", {}).values())]:
            if topic:
                assert types[topic] == EXPECTED[topic.rsplit("/", 1)[1]], topic
                count += 1
        if "followTf" in config:
            fixed = next(value for topic, value in seen.items() if topic.endswith("/tf_static"))
            assert fixed.transforms is not None

    with open(f"{folder}/probecell.rviz") as file:
        rviz = yaml.safe_load(file)
    for display in rviz["Visualization Manager"]["Displays"]:
        for key in ("Topic", "Description Topic"):
            if key in display:
                topic = display[key]["Value"]
                assert types[topic] == EXPECTED[topic.rsplit("/", 1)[1]], topic
                count += 1

    for curve in tree.parse(f"{folder}/plotjuggler.xml").iter("curve"):
        _, cell, topic, *path = curve.get("name").split("/")
        field(f"/{cell}/{topic}", path)
        count += 1
    assert count > 12, count
    print(f"{count} topics and fields of the layouts are in {bag}")


main(*sys.argv[1:])
