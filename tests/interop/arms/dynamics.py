"""The inverse dynamics of every robot of `example-robot-data`, its base at rest, against Pinocchio's.

    dynamics.py PROGRAM [STATES]

PROGRAM is the example `inverse_dynamics`. Random positions, speeds and accelerations; joints that follow others are held at 0 on
both sides. The difference of a joint's effort is taken over the root mean square of that joint's efforts.
"""

import subprocess
import sys
import tempfile

import numpy as np
import pinocchio

import robots

WORST = 1e-9
GRAVITY = 9.80665  # m/s², standard
SPEED, ACCELERATION = 3.0, 10.0  # rad/s, rad/s²
REACH = 0.5  # m, of a linear joint
# A joint whose efforts are less than this share of the robot's moves nothing: it is compared with the robot's.
NOTHING = 1e-9


def pinocchio_model(text, driven):
    model = pinocchio.buildModelFromXML(robots.apart(text))
    locked = [index for index, name in enumerate(model.names) if index and name not in driven]
    model = pinocchio.buildReducedModel(model, locked, pinocchio.neutral(model))
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    return model


def configuration(model, q):
    """Positions as Pinocchio counts them: cosine and sine of a joint that turns without end."""
    full = pinocchio.neutral(model)
    for name, value in q.items():
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 2:
            full[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
        else:
            full[joint.idx_q] = value
    return full


def states(model, driven, count, random):
    turns = np.array(["P" not in model.joints[model.getJointId(name)].shortname()[6:8] for name in driven])
    q = np.where(turns, random.uniform(-np.pi, np.pi, (count, len(driven))), random.uniform(-REACH, REACH, (count, len(driven))))
    v = random.uniform(-SPEED, SPEED, q.shape)
    a = random.uniform(-ACCELERATION, ACCELERATION, q.shape)
    return q, v, a


def difference(program, path, count, random):
    text = robots.machine(path.read_text())
    driven, _ = robots.joints(text)
    model = pinocchio_model(text, driven)
    data = model.createData()
    q, v, a = states(model, driven, count, random)
    place = [model.joints[model.getJointId(name)].idx_v for name in driven]
    expected = np.empty_like(q)
    for row in range(count):
        speed, change = np.zeros(model.nv), np.zeros(model.nv)
        speed[place], change[place] = v[row], a[row]
        efforts = pinocchio.rnea(model, data, configuration(model, dict(zip(driven, q[row]))), speed, change)
        expected[row] = efforts[place]
    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
        file.write(text)
        file.flush()
        lines = "\n".join(" ".join(map(repr, map(float, row))) for row in np.hstack([q, v, a]))
        done = subprocess.run([program, file.name, *driven], input=lines, capture_output=True, text=True)
    if done.returncode:
        raise ValueError(done.stderr.strip())
    given = np.array([list(map(float, line.split())) for line in done.stdout.splitlines()])
    size = np.sqrt(np.mean(expected**2, axis=0))
    size[size < NOTHING * size.max()] = max(size.max(), 1e-12)
    return len(driven), np.abs(given - expected).max(axis=0) / size


def main(program, count=200):
    random = np.random.default_rng(1)
    compared, bad, worst = 0, [], 0.0
    for path in robots.files():
        name = path.stem
        if not robots.joints(path.read_text())[0]:
            print(f"{name:40} has no joint that moves")
            continue
        try:
            joints, off = difference(program, path, count, random)
        except ValueError as error:
            bad.append(f"{name}: {error}")
            print(bad[-1])
            continue
        compared += 1
        worst = max(worst, off.max())
        print(f"{name:40} {joints:3} joints  worst relative difference {off.max():.1e}")
        if not off.max() <= WORST:
            bad.append(f"{name}: {off.max():.1e}")
    print(f"{compared} robots, {count} states each: worst relative difference {worst:.1e}")
    assert not bad, bad
    assert compared >= 20, "robots are missing"


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
