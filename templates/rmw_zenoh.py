"""A driver's topics in the wire format of rmw_zenoh, after docs/driver-guide.md: keys, tokens, attachments, CDR.

Needs `pip install eclipse-zenoh rosbags xxhash`, and the folder of the message definitions.
"""
import itertools, pathlib, queue, struct, sys, time
import numpy, xxhash, zenoh
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

class Bus:
    """The topics of a driver, docs/driver-guide.md."""
    PUBLISHED = {"controller_status": ("ControllerStatus", "::,100:,:,:,,"), "probe_triggers": ("ProbeTrigger", "::2,:,:,:,,"),
                 "controller_replies": ("ControllerReply", "::2,:,:,:,,")}
    SUBSCRIBED = {"controller_commands": ("ControllerCommand", "::2,:,:,:,,"), "gate_heartbeat": ("GateHeartbeat", "::,10:,:,:,,"),
                  "measurement_order": ("MeasurementOrder", ":1:,1:,:,:,,")}

    def __init__(self, arguments):
        self.store, types = get_typestore(Stores.ROS2_JAZZY), {}
        for path in sorted(pathlib.Path(arguments.messages).glob("*.msg")):
            types |= get_types_from_msg(path.read_text(), f"probecell_msgs/msg/{path.stem}")
        self.store.register({name: fields for name, fields in types.items() if name not in self.store.fielddefs})
        config = zenoh.Config.from_file(arguments.config) if arguments.config else zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", f'["{arguments.endpoint}"]')
        config.insert_json5("connect/timeout_ms", "-1")  # wait for the router
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session, self.incoming, self.publishers = zenoh.open(config), queue.Queue(), {}
        lead = f"@ros2_lv/{arguments.domain}/{self.session.info.zid()}/0"
        node = f"%/%{arguments.cell}/driver"
        self.tokens = [self.session.liveliness().declare_token(f"{lead}/0/NN/{node}")]
        both = [("MS", *item) for item in self.SUBSCRIBED.items()] + [("MP", *item) for item in self.PUBLISHED.items()]
        for number, (kind, topic, (name, qos)) in enumerate(both, start=1):
            tail = f"probecell_msgs::msg::dds_::{name}_/{self.type_hash(name)}"
            key = f"{arguments.domain}/{arguments.cell}/{topic}/{tail}"
            token = f"{lead}/{number}/{kind}/{node}/%{arguments.cell}%{topic}/{tail}/{qos}"
            if kind == "MS":
                self.session.declare_subscriber(key, lambda sample, name=name: self.take(name, sample))
            else:
                digest = xxhash.xxh3_128_intdigest(token.encode())
                source = struct.pack("<QQ", digest & (2**64 - 1), digest >> 64)
                publisher = self.session.declare_publisher(key, congestion_control=zenoh.CongestionControl.BLOCK)
                self.publishers[topic] = (name, publisher, itertools.count(1), source)
            self.tokens.append(self.session.liveliness().declare_token(token))

    def type_hash(self, name):
        return self.store.hash_rihs01(f"probecell_msgs/msg/{name}")

    def take(self, name, sample):
        try:
            message = self.store.deserialize_cdr(bytes(sample.payload), f"probecell_msgs/msg/{name}")
        except Exception as error:  # whatever a stranger has published there
            return print(f"{sample.key_expr}: ignored, not a {name}: {error}", file=sys.stderr, flush=True)
        self.incoming.put((name, message))

    def publish(self, topic, **fields):
        name, publisher, numbers, source = self.publishers[topic]
        payload = bytes(self.store.serialize_cdr(self.message(f"probecell_msgs/msg/{name}", fields), f"probecell_msgs/msg/{name}"))
        publisher.put(payload, attachment=struct.pack("<qqB", next(numbers), time.time_ns(), 16) + source)

    def message(self, name, fields):
        """A message with these fields; the others are empty."""
        def value(key, kind, detail):
            given = fields.get(key)
            if kind == Nodetype.NAME:
                return self.message(detail, given or {})
            if kind == Nodetype.BASE:
                return given if given is not None else {"string": "", "bool": False}.get(detail[0], 0)
            return list(given or []) if detail[0][1][0] == "string" else numpy.array(given or [], dtype=detail[0][1][0])
        return self.store.types[name](**{key: value(key, *field) for key, field in self.store.fielddefs[name][1]})

def arguments(parser):
    """Where the cell is."""
    parser.add_argument("--cell", default="external")
    parser.add_argument("--endpoint", default="tcp/127.0.0.1:7447")
    parser.add_argument("--domain", type=int, default=0)
    parser.add_argument("--config", help="settings of the session, as `probecell secure` writes them")
    parser.add_argument("--messages", default=pathlib.Path(__file__).resolve().parent.parent / "msgs" / "msg")
    return parser
