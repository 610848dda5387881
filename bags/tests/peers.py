"""Opens the sample recording with rosbags and mcap-ros2-support and compares what they read with what was written."""

import sys
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.reader import read_ros2_messages
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

folder = Path(sys.argv[1])
TICKS, SPLITS = 300, 3

with Reader(folder) as bag:
    assert bag.message_count == TICKS + 2 + 2 * (SPLITS - 1), bag.message_count
    assert bag.start_time == 1_700_000_000_000_000_000
    assert bag.end_time - bag.start_time == (TICKS - 1) * 10_000_000 + 1, bag.end_time
    types = get_typestore(Stores.EMPTY)
    known = {}
    for connection in bag.connections:
        known |= get_types_from_msg(connection.msgdef.data, connection.msgtype)
    types.register(known)
    for connection in bag.connections:
        computed = types.hash_rihs01(connection.msgtype)
        assert connection.digest == computed, (connection.topic, connection.digest, computed)
    joints = [c for c in bag.connections if c.topic == "/cell/joint_states"]
    states = [types.deserialize_cdr(raw, c.msgtype) for c, _, raw in bag.messages(connections=joints)]
    assert [round(state.position[0] * 1e3) for state in states] == list(range(TICKS))
    latched = [c for c in bag.connections if c.topic == "/cell/robot_description"]
    assert {q.durability.name for c in latched for q in c.ext.offered_qos_profiles} == {"TRANSIENT_LOCAL"}
print("rosbags reads the folder")

ticks = []
for number, path in enumerate(sorted(folder.glob("*.mcap"))):
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary.statistics.message_count == 102
        assert {record.name for record in reader.iter_metadata()} == {"rosbag2"}
        names = [attachment.name for attachment in reader.iter_attachments()]
        assert names == (["cell.toml"] if number == 0 else []), names
    messages = list(read_ros2_messages(path))
    models = [m.ros_msg.data for m in messages if m.channel.topic == "/cell/robot_description"]
    assert models == ['<robot name="sample"/>'], models
    ticks += [m.ros_msg.position[0] for m in messages if m.channel.topic == "/cell/joint_states"]
assert [round(tick * 1e3) for tick in ticks] == list(range(TICKS))
print("mcap-ros2-support reads the files")
