"""The Python template with one fault planted: `faulty.py --fault NAME`; without it, the template as it is.

Each fault is one mistake that a stranger makes. LINES says which line of `probecell conformance` has to name it: words that
have to stand in one line that begins with WRONG.
"""

import argparse
import itertools
import math
import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "templates"))
import rmw_zenoh  # noqa: E402
from driver import DONE, RUN_MEASUREMENT, SET_TOOL_WEAR, STOP, Driver, Machine  # noqa: E402

LINES = {
    "other_version": ("topics: controller_replies:", "ControllerReply RIHS01_"),
    "no_attachment": ("samples: controller_status:", "33 bytes"),
    "axis_missing": ("samples: axis_names:", '"Z"'),
    "not_finite": ("samples: axis_positions:", "NaN"),
    "millimetres": ("samples: axis_positions:", "0.25"),
    "clock_of_boot": ("samples: header.stamp:", "time since 1970"),
    "session_changes": ("samples: session:", "as long as the driver runs"),
    "foreign_session_obeyed": ("another session: controller_replies.outcome:", "REFUSED"),
    "numbers_skipped": ("numbers: controller_status attachment.sequence:",),
    "stop_not_confirmed": ("first STOP: controller_replies:", "no reply"),
    "stop_confirmed_twice": ("expected one reply to a command",),
    "stop_runs_on": ("STOP in mid-measurement: axis_positions:", "still at"),
    "stopped_is_done": ("STOP in mid-measurement: controller_replies.outcome:", "FAILED, came DONE"),
    "unknown_accepted": ("unknown kind: controller_replies.outcome:", "REFUSED"),
    "wear_not_written": ("wear of tool 1: controller_status.tool_wear:",),
    "wear_before_is_after": ("wear of tool 1: controller_replies.value_before:",),
    "written_twice": ("wear of tool 1: controller_replies:", "delivered twice"),
    "busy_accepted": ("busy: controller_replies",),
    "order_of_plan": ("measurement: probe_triggers.point_index:", "order of the command"),
    "counts_from_one": ("probe_triggers.sequence:", "without gaps"),
    "latched_late": ("measurement: probe_triggers.axis_positions:",),
    "feed_per_minute": ("measurement: probe_triggers.feed:", "m/s"),
    "done_too_early": ("measurement: controller_replies.header.stamp:", "after its last touch"),
    "never_running": ("measurement: execution:", "never 1"),
    "needs_its_order_first": ("controller_replies.outcome:", "came REFUSED", "no such order"),
    "deaf_to_silence": ("silent gate: controller_replies",),
    "blind_to_another_gate": ("replaced gate: controller_replies",),
    "deaf_to_a_clock_set_back": ("gate restarted with its clock set back: controller_replies.outcome:", "DONE, came FAILED"),
    "lost_without_code": ("silent gate: controller_replies.text:", "gate_lost"),
}


class FaultyBus(rmw_zenoh.Bus):
    def __init__(self, arguments):
        self.fault = arguments.fault
        super().__init__(arguments)
        if self.fault == "numbers_skipped":
            name, publisher, _, source = self.publishers["controller_status"]
            numbers = (number for number in itertools.count(1) if number % 50)
            self.publishers["controller_status"] = (name, publisher, numbers, source)

    def type_hash(self, name):
        right = super().type_hash(name)
        return right[:-4] + "0000" if self.fault == "other_version" and name == "ControllerReply" else right

    def publish(self, topic, **fields):
        fault, status = self.fault, topic == "controller_status"
        if fault == "axis_missing" and status:
            fields = fields | {key: fields[key][:2] for key in ("axis_names", "axis_positions")}
        if fault == "not_finite" and status:
            fields["axis_positions"] = [math.nan, *fields["axis_positions"][1:]]
        if fault == "millimetres" and status:
            fields["axis_positions"] = [1e3 * value + 400 for value in fields["axis_positions"]]
        if fault == "clock_of_boot":
            now = time.monotonic_ns()
            fields["header"] = {"stamp": {"sec": now // 10**9, "nanosec": now % 10**9}}
        if fault == "session_changes" and status:
            fields["session"] += str(time.time_ns() // 10**9)
        if fault == "never_running" and status:
            fields["execution"] = 0
        if fault == "feed_per_minute" and topic == "probe_triggers":
            fields["feed"] *= 60e3
        if fault == "lost_without_code" and topic == "controller_replies":
            fields["text"] = fields["text"].replace("gate_lost: ", "")
        if fault == "no_attachment":
            name, publisher, *_ = self.publishers[topic]
            message = self.message(f"probecell_msgs/msg/{name}", fields)
            publisher.put(bytes(self.store.serialize_cdr(message, f"probecell_msgs/msg/{name}")))
        else:
            super().publish(topic, **fields)


class FaultyDriver(Driver):
    def __init__(self, bus, machine, fault):
        super().__init__(bus, machine)
        self.fault = fault
        self.running_on = None

    def obey(self, command):
        fault = self.fault
        if fault == "foreign_session_obeyed" and command.session != self.session:
            return self.reply(command, DONE)
        if fault == "stop_not_confirmed" and command.kind == STOP:
            return self.stop("stopped")
        if fault == "stop_confirmed_twice" and command.kind == STOP:
            self.reply(command, DONE)
        if fault == "stop_runs_on" and command.kind == STOP and self.program:
            self.running_on = self.machine.go([*self.machine.position[:2], 0.0], 0.01)
        if fault == "stopped_is_done" and command.kind == STOP and self.command:
            self.reply(self.command, DONE)
            self.command = self.program = None
        if fault == "unknown_accepted" and command.kind == 200:
            return self.reply(command, DONE)
        if fault == "wear_not_written" and command.kind == SET_TOOL_WEAR and command.value == command.value:
            return self.reply(command, DONE, value_before=self.machine.wear.get(command.tool_number, 0.0), value=command.value)
        if fault == "wear_before_is_after" and command.kind == SET_TOOL_WEAR and command.tool_number in self.machine.wear:
            self.machine.wear[command.tool_number] = command.value
        if fault == "written_twice":
            self.taken.clear()
        if fault == "busy_accepted" and command.kind == RUN_MEASUREMENT and self.command:
            return self.reply(command, DONE)
        if fault == "counts_from_one" and command.kind == RUN_MEASUREMENT:
            self.touches = 0
        if fault == "needs_its_order_first" and command.kind == RUN_MEASUREMENT:
            if self.order is None or self.order.plan_id != command.plan_id:
                return self.reply(command, 1, "there is no such order")
        super().obey(command)

    def take(self, name, message):
        if self.fault == "blind_to_another_gate" and name == "GateHeartbeat":
            self.heard = time.monotonic()
            return
        if self.fault == "deaf_to_a_clock_set_back" and name == "GateHeartbeat" and message.started < self.gate[0]:
            return
        super().take(name, message)

    def measure(self):
        if self.fault == "order_of_plan":
            touches = [list(group) for _, group in itertools.groupby(self.order.moves, key=lambda move: move.point_index)]
            touches.sort(key=lambda group: group[0].point_index)
            self.order.moves = [move for group in touches for move in group]
        yield from super().measure()

    def touch(self, move, latch):
        if self.fault == "done_too_early" and self.touches % len(self.order.order) == len(self.order.order) - 1:
            self.reply(self.command, DONE)
            time.sleep(0.02)  # the fault: the touch comes after the reply
        if self.fault == "latched_late" and latch:
            point = [dict(zip(self.order.axis_names, map(float, move.axis_positions)))[name] for name in self.machine.AXES]
            self.machine.position, latched = point, self.machine.position
            super().touch(move, latch)
            self.machine.position = latched
            return
        super().touch(move, latch)

    def tick(self):
        if self.fault == "deaf_to_silence":
            self.heard = time.monotonic()
        if self.running_on and next(self.running_on, self) is self:
            self.running_on = None
        super().tick()


if __name__ == "__main__":
    parser = rmw_zenoh.arguments(argparse.ArgumentParser())
    parser.add_argument("--fault", choices=sorted(LINES))
    chosen = parser.parse_args()
    FaultyDriver(FaultyBus(chosen), Machine(), chosen.fault).run()
