#!/usr/bin/env python3
"""Template of an external driver, after docs/driver-guide.md: a simulated three-axis machine with a part of its own.

    driver.py [--cell NAME] [--endpoint tcp/HOST:PORT] [--domain N] [--messages FOLDER]

Replace class Machine by your controller. Lengths are m; rmw_zenoh.py beside this file carries the messages.
"""
import argparse, itertools, math, signal, time
from rmw_zenoh import Bus, arguments

PERIOD, GATE_SILENCE = 0.01, 1.0  # s between two samples, and without a sign of life of the gate
RUN_OPERATION, RUN_MEASUREMENT, SET_TOOL_WEAR, STOP = 0, 1, 2, 4  # kinds of commands; the others are refused
DONE, REFUSED, FAILED, TOUCH = 0, 1, 2, 2  # outcomes, and the kind of a probing move

class Machine:
    """Axes X, Y, Z that carry the ball centre; a drilled plate of its own, and a probe that triggers late."""
    AXES, LIMIT, RAPID = ["X", "Y", "Z"], 0.25, 0.2
    BALL, PRETRAVEL, FACE, CENTRE = 3e-3, 3e-6, -0.04, (0.020005, -0.010003)  # the bore is off its nominal place

    def __init__(self):
        self.position, self.diameter, self.wear, self.tool = [0.0, 0.0, 0.0], 29.90e-3, {1: 0.0}, 0

    def clearance(self, at):
        """Distance that the ball still has to go until the probe triggers, m."""
        out = math.hypot(at[0] - self.CENTRE[0], at[1] - self.CENTRE[1])
        above, beside = at[2] - self.FACE, self.diameter / 2 - out  # from the face; from the wall of the bore
        return (math.hypot(above, beside) if min(above, beside) > 0 else max(above, beside)) - self.BALL + self.PRETRAVEL

    def go(self, target, speed):
        start, length = self.position, max(math.dist(self.position, target), 1e-12)
        for step in itertools.count(1):
            share = min(1.0, step * PERIOD * speed / length)
            self.position = [a + (b - a) * share for a, b in zip(start, target)]
            yield
            if share == 1.0:
                return

    def contact(self, target):
        """Where on the way to the target the probe triggers; None: nowhere."""
        on_way = lambda share: [a + (b - a) * share for a, b in zip(self.position, target)]
        low, high = 0.0, 1.0
        if self.clearance(on_way(low)) <= 0 or self.clearance(on_way(high)) > 0:
            return None
        for _ in range(40):
            low, high = (low, (low + high) / 2) if self.clearance(on_way((low + high) / 2)) <= 0 else ((low + high) / 2, high)
        return on_way(high)

    def cut(self):
        self.tool = 1
        for _ in range(200):  # two seconds
            yield
        self.diameter = max(self.diameter, 30e-3 - 30e-6 + self.wear[1])  # the tool is 30 µm too small

class Driver:
    def __init__(self, bus, machine):
        self.bus, self.machine, self.session, self.touches = bus, machine, f"template-{time.time_ns()}", 0
        self.taken, self.order, self.command, self.program = set(), None, None, None  # under way: command and its program
        self.gate, self.heard, self.ended = (0, 0), -math.inf, False
        self.silence = lambda: time.monotonic() - self.heard  # s since the last sign of life of the gate

    def header(self):
        now = time.time_ns()
        return {"stamp": {"sec": now // 10**9, "nanosec": now % 10**9}}

    def reply(self, command, outcome, text="", **values):
        fields = {"command_id": command.command_id, "outcome": outcome, "text": text, **values}
        self.bus.publish("controller_replies", header=self.header(), session=self.session, **fields)

    def stop(self, why):
        """The machine stands from here on; what was under way has failed."""
        command, self.command, self.program = self.command, None, None
        if command:
            self.reply(command, FAILED, why)

    def take(self, name, message):
        if name == "MeasurementOrder":
            self.order = message
        elif name == "ControllerCommand":
            self.heard = time.monotonic()
            self.obey(message)
        elif (message.started, message.count) > self.gate or message.started != self.gate[0] and self.silence() > GATE_SILENCE:
            if self.gate[0] not in (0, message.started):
                self.stop("gate_lost: machine_state is another process than before")
            self.gate, self.heard = (message.started, message.count), time.monotonic()  # not counted yet, or of a successor

    def obey(self, command):
        if command.session != self.session:
            self.reply(command, REFUSED, "it is addressed to another session")
        elif command.command_id in self.taken:
            return  # delivered twice
        elif command.kind == STOP:
            self.stop("stopped")
            self.reply(command, DONE)
        elif command.kind == SET_TOOL_WEAR and command.tool_number in self.machine.wear and math.isfinite(command.value):
            before, self.machine.wear[command.tool_number] = self.machine.wear[command.tool_number], command.value
            self.reply(command, DONE, value_before=before, value=self.machine.wear[command.tool_number])
        elif command.kind == RUN_MEASUREMENT and not self.command:
            self.command = command  # begins when its order is here
        elif command.kind == RUN_OPERATION and command.operation == "bore" and not self.command:
            self.command, self.program = command, self.machine.cut()
        else:
            self.reply(command, REFUSED, "a program is running" if self.command else "the machine cannot do this")
        self.taken.add(command.command_id)

    def measure(self):
        self.machine.tool = 0
        for move in self.order.moves:
            order = dict(zip(self.order.axis_names, map(float, move.axis_positions)))
            target = [order[name] for name in self.machine.AXES]
            latch = self.machine.contact(target) if move.kind == TOUCH else None
            yield from self.machine.go(latch or target, move.feed or self.machine.RAPID)
            if move.kind == TOUCH:
                self.touch(move, latch)

    def touch(self, move, latch):
        self.bus.publish("probe_triggers", header=self.header(), session=self.session, plan_id=self.command.plan_id,
                         point_index=move.point_index, tripped=latch is not None, axis_names=self.machine.AXES,
                         axis_positions=self.machine.position, feed=move.feed, sequence=self.touches)
        self.touches += 1

    def sample(self):
        self.bus.publish("controller_status", header=self.header(), session=self.session, mode=2, execution=int(self.command is not None),
                         program=(self.command.operation or self.command.plan_id) if self.command else "", tool_number=self.machine.tool,
                         feed_override=1.0, axis_names=self.machine.AXES, axis_positions=self.machine.position,
                         tool_numbers=list(self.machine.wear), tool_wear=list(self.machine.wear.values()))

    def tick(self):
        while not self.bus.incoming.empty():
            self.take(*self.bus.incoming.get())
        if self.silence() > GATE_SILENCE:
            self.stop("gate_lost: machine_state has fallen silent")
        waiting, order = self.command and not self.program, self.order
        if waiting and order and order.plan_id == self.command.plan_id and list(order.order) == list(self.command.order):
            self.program = self.measure()
        if self.program and next(self.program, self) is self:
            command, self.command, self.program = self.command, None, None
            self.reply(command, DONE)
        self.sample()

    def run(self):
        signal.signal(signal.SIGTERM, lambda *_: setattr(self, "ended", True))
        while not self.ended:
            begun = time.monotonic()
            self.tick()
            time.sleep(max(0.0, begun + PERIOD - time.monotonic()))
        self.stop("the driver was ended")
        self.bus.session.close()

if __name__ == "__main__":
    Driver(bus := Bus(arguments(argparse.ArgumentParser()).parse_args()), Machine()).run()
