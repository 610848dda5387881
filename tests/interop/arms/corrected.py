"""From recordings of an arm in motion to its corrected description: corrected.py PROGRAM [SEED].

Arms of several makers have other masses than their descriptions say, friction, and in some recordings a load. Two motions without and with
the load are fitted, a third judges; `probecell cure` writes the description, which Pinocchio and MuJoCo read. What both need for the third
motion is compared with what the arm needed. With the opposite sign of the masses it gets worse.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import mujoco
import numpy as np
import pinocchio

import plant
import planted
import robots

LEFT = 0.25  # of the gap, at most
LOADED = 0.2  # of the load's mass, at most
# Friction that is small beside what the description declares may have an interval wider than itself.
VAGUE = ("drive.viscous_friction", "drive.coulomb_friction")
AGREE = 1e-6  # between two readers, over the size of the efforts


def run(*words):
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, words))}: {done.stderr.strip()}")
    return done.stdout


def refused(what, *words):
    """The program says in one line what is wrong, with exit status 2."""
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True)
    told = done.stderr.strip()
    assert done.returncode == 2 and what in told and "\n" not in told, f"{' '.join(map(str, words))}: {done.returncode}, {told}"


def wrong(program, work, urdf, flange):
    """What a new user typed."""
    without, held = work / "without", work / "held.mcap"
    refused("is fitted and withheld", program, "diagnose", "--fit", without, work / "with", "--withhold", without)
    refused("joint states are on /cell/joint_states", program, "import", "motion", held, "--out", work / "none")
    table = planted.tabulated(held)
    refused("--units time=s", program, "import", "motion", table, "--urdf", urdf, "--out", work / "none")
    rows = table.read_text().splitlines()
    few = work / "few.csv"
    few.write_text("\n".join(rows[:30]))
    settings = ("--urdf", urdf, "--units", "time=s,angle=rad", "--mount", flange)
    run(program, "import", "motion", few, *settings, "--out", work / "few")
    refused("fewer than 50 samples", program, "diagnose", "--fit", without, "--withhold", work / "few")
    # Milliseconds that are read as seconds.
    late = work / "late.csv"
    moments = [row.split(",", 1) for row in rows[1:]]
    late.write_text("\n".join([rows[0], *(f"{(float(time) - plant.START) * 1000},{rest}" for time, rest in moments)]))
    run(program, "import", "motion", late, *settings, "--out", work / "late")
    refused("is the unit of its times right?", program, "diagnose", "--fit", without, "--withhold", work / "late")


def hidden(arm, random):
    """The arm as it is: a model without and one with a load, viscous and dry friction, and the load."""
    bare = arm.model.copy()
    for number in range(1, bare.njoints):
        own, part = bare.inertias[number], np.clip(random.normal(size=5), -2, 2)
        mass = own.mass * np.exp(0.1 * part[0])
        lever = own.lever + 0.05 * part[1:4] * max(np.linalg.norm(own.lever), 0.02)
        bare.inertias[number] = pinocchio.Inertia(mass, lever, own.inertia * mass / own.mass * np.exp(0.1 * part[4]))
    loaded = bare.copy()
    mass, centre = 0.08 * arm.mass, np.array([0.02, -0.01, 0.05])
    frame = loaded.frames[loaded.getFrameId("probe_mount")]
    load = pinocchio.Inertia(mass, centre, mass * np.diag([0.03**2, 0.03**2, 0.02**2]))
    loaded.appendBodyToJoint(frame.parentJoint, load, frame.placement)
    return bare, loaded, mass


class Read:
    """A description read by Pinocchio, with the joints of an arm."""

    def __init__(self, text, arm):
        model = pinocchio.buildModelFromXML(robots.apart(text))
        locked = [index for index, joint in enumerate(model.names) if index and joint not in arm.joints]
        self.model = pinocchio.buildReducedModel(model, locked, pinocchio.neutral(model))
        self.model.gravity.linear = np.array([0.0, 0.0, -plant.GRAVITY])
        self.order = [arm.joints.index(joint) for joint in list(self.model.names)[1:]]
        self.damping, self.friction = self.model.damping, self.model.lowerDryFrictionLimit
        self.friction = np.abs(np.asarray(self.friction))

    def efforts(self, q, v, a):
        data, found = self.model.createData(), np.zeros_like(q)
        for row in range(len(q)):
            at, speed, change = (values[row, self.order] for values in (q, v, a))
            own = pinocchio.rnea(self.model, data, at, speed, change)
            found[row, self.order] = own + self.damping * speed + self.friction * np.tanh(speed / plant.SLIPS)
        return found


def by_mujoco(text, arm, q, v, a):
    """Inverse dynamics with viscous friction of the same text; pictures are left out, other joints are fixed."""
    robot = robots.tree.fromstring(robots.machine(text) if "foundation" not in text else text)
    for link in robot.findall("link"):
        for unused in link.findall("visual") + link.findall("collision"):
            link.remove(unused)
    for joint in robot.findall("joint"):
        if joint.get("name") not in arm.joints:
            joint.set("type", "fixed")
            for unused in joint.findall("mimic") + joint.findall("dynamics"):
                joint.remove(unused)
    model = mujoco.MjModel.from_xml_string(robots.tree.tostring(robot, encoding="unicode"))
    model.opt.gravity = [0.0, 0.0, -plant.GRAVITY]
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data, found = mujoco.MjData(model), np.zeros_like(q)
    place = [model.joint(name).dofadr[0] for name in arm.joints]
    for row in range(len(q)):
        data.qpos[place], data.qvel[place], data.qacc[place] = q[row], v[row], a[row]
        mujoco.mj_inverse(model, data)
        found[row] = data.qfrc_inverse[place]
    return found


def opposite(report):
    for effect in report["effects"]:
        if effect["effect"] == "drive.link_inertia":
            for parameter in effect["parameters"]:
                parameter["value"] *= -1
                parameter["ci95"] = [-one for one in reversed(parameter["ci95"])]
    return report


def main(program, seed=0):
    for place, name in enumerate(("ur5", "panda", "z1")):
        random = np.random.default_rng((seed, place))
        arm = plant.Arm(name)
        file, flange, _ = plant.ARMS[name]
        urdf = robots.folder() / file
        shipped = Read(robots.apart(urdf.read_text()), arm)
        bare, loaded, mass = hidden(arm, random)
        ways = [plant.trajectory(arm, np.ones(arm.count, bool), np.full(arm.count, 0.5), 0.5, 40.0, random) for _ in range(3)]
        t = plant.instants(125.0, 40.0, 0.0, random)
        usual = plant.rms(arm.weight(ways[0].at(t)[0]))
        viscous, dry = 0.1 * usual * random.uniform(0.5, 1.5, (2, arm.count))
        with tempfile.TemporaryDirectory() as work:
            work = pathlib.Path(work)
            for model, way, motion in zip((bare, loaded, loaded), ways, ("without", "with", "held")):
                q, v, a = way.at(t)
                truth = arm.efforts(model, q, v, a) + viscous * v + dry * np.tanh(v / plant.SLIPS)
                noise = 0.01 * usual
                read = q + 1e-5 * random.normal(size=q.shape)
                plant.record(work / f"{motion}.mcap", arm, t, (read, v + 0.002 * random.normal(size=v.shape), truth + noise * random.normal(size=v.shape)))
                run(program, "import", "motion", work / f"{motion}.mcap", "--joint-states", "/cell/joint_states", "--urdf", urdf,
                    "--mount", flange, "--out", work / motion)  # fmt: skip
            text = run(program, "diagnose", "--fit", work / "without", work / "with", "--withhold", work / "held", "--json")
            report = json.loads(text)
            (work / "report.json").write_text(text)
            (work / "opposite.json").write_text(json.dumps(opposite(json.loads(text))))
            if place == 0:
                wrong(program, work, urdf, flange)
            named = {effect["effect"] for effect in report["effects"]}
            chosen = [word for name in VAGUE if name in named for word in ("--member", name)]
            written = {
                name: run(program, "cure", work / f"{name}.json", "--as", "urdf", "--urdf", urdf, *chosen)
                for name in ("report", "opposite")
            }  # fmt: skip
        found = {effect["effect"]: effect for effect in report["effects"]}
        load = next(one["value"] for one in found["drive.payload"]["parameters"] if one["name"] == "mass")
        readers = {"shipped": shipped, **{name: Read(text, arm) for name, text in written.items()}}
        gap = {name: plant.rms(reader.efforts(q, v, a) - truth) for name, reader in readers.items()}
        rigid = readers["report"]
        smooth = rigid.efforts(q, v, a) - rigid.friction[np.argsort(rigid.order)] * np.tanh(v / plant.SLIPS)
        apart = np.abs(by_mujoco(written["report"], arm, q, v, a) - smooth).max() / plant.rms(truth)
        print(
            f"{name}: gap of the withheld motion {gap['shipped']:.3f} -> {gap['report']:.3f} N m (masses of the opposite sign"
            f" {gap['opposite']:.3f}), load {load:.2f} kg of {mass:.2f}, MuJoCo differs from Pinocchio by {apart:.1e}",
            flush=True,
        )
        assert gap["report"] < LEFT * gap["shipped"] and abs(load - mass) < LOADED * mass, f"{name}: not corrected"
        assert "drive.link_inertia" not in found or gap["opposite"] > 1.5 * gap["report"], f"{name}: the sign does not matter"
        assert apart < AGREE, f"{name}: two readers, two arms"


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:3]))
