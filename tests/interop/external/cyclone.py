"""The Python template over Cyclone DDS: the same driver, with DDS in the place of templates/rmw_zenoh.py.

    cyclone.py [--cell NAME]
"""

import argparse
import pathlib
import queue
import sys
import threading

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "templates"), str(ROOT / "tests" / "interop" / "bus")]
import rmw_zenoh  # noqa: E402
from dds_peers import Cyclone, Messages  # noqa: E402
from driver import Driver, Machine  # noqa: E402

PROFILES = {
    "controller_status": "reliable:100", "probe_triggers": "events:0", "controller_replies": "events:0",
    "controller_commands": "events:0", "gate_heartbeat": "reliable:10", "measurement_order": "latched:1",
}


class DdsBus:
    """What rmw_zenoh.Bus is to a driver."""

    message = rmw_zenoh.Bus.message

    def __init__(self, cell):
        messages = Messages(ROOT / "msgs")
        self.cyclone, self.store, self.incoming, self.session = Cyclone(messages), messages.store, queue.Queue(), self
        ends = {}
        for topic, (name, _) in {**rmw_zenoh.Bus.SUBSCRIBED, **rmw_zenoh.Bus.PUBLISHED}.items():
            whole = f"probecell_msgs/msg/{name}"
            make = self.cyclone.reader if topic in rmw_zenoh.Bus.SUBSCRIBED else self.cyclone.writer
            ends[topic] = (whole, make(f"rt/{cell}/{topic}", self.cyclone.idl.type(whole), PROFILES[topic]))
        self.writers = {topic: ends[topic] for topic in rmw_zenoh.Bus.PUBLISHED}
        for topic in rmw_zenoh.Bus.SUBSCRIBED:
            threading.Thread(target=self.listen, args=ends[topic], daemon=True).start()

    def listen(self, name, reader):
        for value in reader.take_iter():
            self.incoming.put((name.rsplit("/", 1)[1], self.cyclone.idl.from_idl(value, name)))

    def publish(self, topic, **fields):
        name, writer = self.writers[topic]
        writer.write(self.cyclone.idl.to_idl(self.message(name, fields), name))

    def close(self):
        """Its participant ends with the process."""


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--cell", default="external")
    Driver(DdsBus(parser.parse_args().cell), Machine()).run()
