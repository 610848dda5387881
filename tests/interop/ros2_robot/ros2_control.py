#!/usr/bin/env python3
"""The arm of robot.py under ros2_control: a double of its joint_trajectory_controller and joint_state_broadcaster, written from the
documentation of ros2_controllers (control.ros.org) and what its source says of results and their texts; and of what an owner has beside them.

    ros2_control.py CELL.toml [--trajectory RAD] [--goal RAD] [--goal_time S] [--monitor HZ] [--lag S] [--scale F] [--slow F] [those of robot.py]

Of the controller: goals are validated and sorted into its own order of joints; refused ones get no code, as rclcpp_action sends none. A goal
replaces the active one, which is aborted. A cancelled or aborted goal leaves the arm where it is. Tolerances are those of the parameters, or of the
goal. An active goal ends at a cycle and is answered when it is looked at next, at `action_monitor_rate`. Time on the trajectory is scaled
(speed scaling); at 0 it stands, and the goal with it. The arm follows the command with a lag, and where its own speed is reduced (`--slow`), of
which a controller without speed scaling knows nothing, in a longer time: it still moves when the trajectory is over.

Of the broadcaster: an order of its own, joints of a gripper, NaN for what is not reported, and for everything at its begin.

Lines on standard input are events, `in N WHAT` a fourth of the way through the N-th goal from now on, `now WHAT` at once:

    jam      the arm stays where it is, whatever is commanded; `free` ends this
    scale F  speed scaling
    preempt  another client, as MoveIt, sends a goal: back to where the arm came from, in 3 s
    inactive the controller is deactivated, and refuses goals until `active`

Not doubled: velocity and effort interfaces, splines of waypoints with velocities, partial goals, a goal_time_tolerance of a goal, deferred
trajectories, decelerate_on_cancel, feedback, the topics controller_state and dynamic_joint_states, the controller manager.
"""
import math, queue, sys, threading, time

import numpy

import robot

INVALID_GOAL, PATH_TOLERANCE_VIOLATED, GOAL_TOLERANCE_VIOLATED = -1, -4, -5
NAMES = {robot.STATUS_SUCCEEDED: "SUCCEEDED", robot.STATUS_CANCELED: "CANCELED", robot.STATUS_ABORTED: "ABORTED"}
GRIPPER = ["gripper_left_finger_joint", "gripper_right_finger_joint"]
BLIND = 0.2  # s in which the broadcaster has no values yet
OTHERS = b"moveit".ljust(16, b"\0")  # a goal of another client


def seconds(time):
    return time.sec + time.nanosec * 1e-9


class Controlled(robot.Robot):
    def __init__(self, options, cell):
        super().__init__(options, cell)
        self.scale, self.jammed, self.active = options.scale, False, True
        # What the arm carries out, in its own time: behind the controller where it is slower than that knows.
        self.task, self.done, self.deepest = None, 0.0, 0.0
        self.command, self.progress, self.velocity = self.position.copy(), 0.0, numpy.zeros(len(self.position))
        self.numbers, self.accepted, self.due, self.tolerances = {}, {}, {}, None
        self.events, self.lines, self.first, self.clock = [], queue.Queue(), None, time.time()
        # The gripper is another component of the hardware, and was loaded before the arm.
        self.order = GRIPPER + self.arm.names[3:] + self.arm.names[:3]
        threading.Thread(target=lambda: [self.lines.put(line.split()) for line in sys.stdin], daemon=True).start()

    # The action.

    def refusal(self, goal):
        """Why a goal is not accepted; empty where it is."""
        names, points = list(goal.trajectory.joint_names), goal.trajectory.points
        times = [seconds(one.time_from_start) for one in points]
        start = seconds(goal.trajectory.header.stamp)
        if not self.active:
            return "Can't accept new action goals. Controller is not running."
        if not names:
            return "Empty joint names on incoming trajectory."
        if not points:
            return "Empty trajectory received."
        if sorted(names) != sorted(self.arm.names):
            return "Joints on incoming trajectory don't match the controller joints."
        if start and start + times[-1] < self.clock:
            return "Received trajectory with non-zero start time that ends in the past"
        if any(len(point.velocities) for point in points) and numpy.any(numpy.abs(points[-1].velocities) > 1e-9):
            return "Velocity of last trajectory point is not zero"
        if any(b <= a for a, b in zip(times, times[1:])):
            return "Time between points is not strictly increasing"
        if any(len(point.positions) != len(names) for point in points):
            return "Mismatch between joint_names and positions"
        return ""

    def accept(self, uuid, goal, now):
        if why := self.refusal(goal):
            print(f"a goal is refused: {why}", flush=True)
            return False
        self.begin(uuid, self.way(goal), now, goal)
        return True

    def begin(self, uuid, path, now, goal=None):
        if self.goal:
            self.end(robot.STATUS_ABORTED, INVALID_GOAL, "Current goal cancelled due to new incoming action.")
        self.numbers[uuid] = "of another client" if uuid == OTHERS else len(self.numbers) + 1
        self.goal, self.path, self.progress, self.accepted[uuid] = uuid, path, 0.0, now
        self.task, self.done = path, 0.0
        asked = (goal.path_tolerance, goal.goal_tolerance) if goal else ([], [])
        self.tolerances = [self.limits(*one) for one in zip(asked, (self.options.trajectory, self.options.goal))]
        print(f"goal {self.numbers[uuid]}: accepted, {path[0][-1]:.2f} s", flush=True)
        for event in self.events:
            event[0] -= uuid != OTHERS

    def limits(self, asked, default):
        """Of each joint, rad: 0 is the parameter, negative none; unknown names, and the parameters are taken instead."""
        known = {one.name: one.position for one in asked if one.name in self.arm.names}
        if len(known) != len(asked):
            known = {}
        values = [known.get(name, 0.0) or default for name in self.arm.names]
        return numpy.array([value if value > 0 else math.inf for value in values])

    def cancel(self, asked):
        wanted = bytes(asked.uuid)
        if not self.goal or (any(wanted) and wanted != self.goal):
            return []
        ended = self.goal
        self.hold(robot.STATUS_CANCELED)
        return [ended]

    def hold(self, status, code=0, text=""):
        self.end(status, code, text)
        self.task, self.command = None, self.position.copy()

    def end(self, status, code=0, text=""):
        goal = self.goal
        print(f"goal {self.numbers[goal]}: {NAMES[status]} {code} {text}".rstrip(), flush=True)
        period = 1 / self.options.monitor
        looks = math.floor((self.clock - self.accepted[goal]) / period) + 1
        self.due[goal] = self.accepted[goal] + looks * period
        super().end(status, code, text)

    def tell_results(self):
        # Nobody waits for the result of another client here.
        late = {goal: query for goal, query in self.waiting.items() if self.due.get(goal, math.inf) > self.clock}
        self.waiting = {goal: query for goal, query in self.waiting.items() if goal not in late}
        super().tell_results()
        self.waiting |= late

    # A cycle of the controller and of the arm.

    def tick(self, before, now):
        self.clock = now
        while not self.lines.empty():
            when, *words = self.lines.get()
            self.events.append([int(words.pop(0)), words] if when == "in" else [-math.inf, words])
        due = lambda event: event[0] < 0 or (event[0] == 0 and self.goal and self.goal != OTHERS and self.progress >= self.path[0][-1] / 4)
        for event in [one for one in self.events if due(one)]:
            self.events.remove(event)
            self.happen(now, *event[1])
        super().tick(before, now)
        self.tell_results()
        if not self.tripped and self.deepest:
            print(f"deepest {self.deepest * 1e3:.3f} mm", flush=True)
        self.deepest = max(self.deepest, -self.clearance(self.position)) if self.tripped else 0.0

    def happen(self, now, what, value=None):
        if what in ("jam", "free"):
            self.jammed = what == "jam"
        elif what == "scale":
            self.scale = float(value)
        elif what == "preempt":
            self.begin(OTHERS, (numpy.array([0.0, 3.0]), numpy.array([self.position, self.path[1][0]])), now)
        elif what in ("active", "inactive"):
            self.active = what == "active"
            if self.goal and not self.active:
                self.hold(robot.STATUS_ABORTED, INVALID_GOAL, "Current goal cancelled during deactivate transition.")
        print(f"{what} {value or ''}".rstrip(), flush=True)

    def moves(self, before, now):
        span, begin, start = max(now - before, 1e-6), self.command, self.position
        if self.path is not None:
            self.progress += self.scale * span
        if self.task is not None:
            self.done += self.scale * self.options.slow * span
            self.command = robot.on(self.task, self.done)
        if self.jammed:
            self.velocity = numpy.zeros(len(start))
            return None
        # The lag is of the first order, behind a command that rises evenly.
        rate, lag = (self.command - begin) / span, self.options.lag

        def place(at):
            since = at - before
            behind = start - begin + rate * lag
            return begin + rate * (since - lag) + behind * math.exp(-since / lag)

        self.velocity = (place(now) - start) / span
        return place

    def follow(self, now):
        if not self.goal:
            return
        error, over = numpy.abs(self.at(self.progress) - self.position), self.progress - self.path[0][-1]
        if over < 0:
            if numpy.any(error > self.tolerances[0]):
                self.hold(robot.STATUS_ABORTED, PATH_TOLERANCE_VIOLATED, "Aborted due to path tolerance violation")
        elif not numpy.any(error > self.tolerances[1]):
            self.end(robot.STATUS_SUCCEEDED, 0, "Goal successfully reached!")
        elif 0 < self.options.goal_time < over:
            text = f"Aborted due to goal_time_tolerance exceeding by {over:f} seconds"
            self.hold(robot.STATUS_ABORTED, GOAL_TOLERANCE_VIOLATED, text)

    # The broadcaster.

    def state(self, publish, at, position):
        self.first = self.first or at
        blind = at < self.first + BLIND
        of_arm = dict(zip(self.arm.names, zip(position, self.velocity)))
        values = [(math.nan, math.nan) if blind else of_arm.get(name, (0.01, math.nan)) for name in self.order]
        position, velocity = map(numpy.array, zip(*values))
        publish(at, header=self.node.header(at), name=self.order, position=position, velocity=velocity, effort=numpy.full(len(self.order), math.nan))


if __name__ == "__main__":
    parser = robot.arguments()
    # Those of ur_controllers.yaml of the Universal Robots ROS 2 driver; upstream has no limits at all.
    parser.add_argument("--trajectory", type=float, default=0.2)
    parser.add_argument("--goal", type=float, default=0.1)
    parser.add_argument("--goal_time", type=float, default=0.0)
    parser.add_argument("--monitor", type=float, default=20.0)
    parser.add_argument("--lag", type=float, default=0.02)
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("--slow", type=float, default=1.0)
    robot.main(Controlled, parser)
