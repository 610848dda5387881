"""`probecell schema`: real outputs of the commands against their schemas, by PyPI jsonschema."""

import copy
import json
import math

from check import ROOT, answer, check, probecell
from kit.recordings import messages

SAMPLES = ["ball_check", "guideway", "punch", "punch_uncalibrated"]


def outputs():
    """Name of a schema, and the output of a command that it describes."""
    for sample in SAMPLES:
        bag = ROOT / "bags" / "samples" / f"{sample}.mcap"
        for name, command in (("gap-report", "diagnose"), ("part-record", "report"), ("info", "info"), ("replay", "replay")):
            yield name, [command, bag]
    yield "info", ["info", ROOT / "bags" / "samples" / "punch.mcap", "--verify"]
    for cell in ("turn_mill", "five_axis", "clamped_casting"):
        yield "plan", ["plan", ROOT / "launch-scripts" / f"{cell}.toml"]
    yield "identifiability", ["identifiability", ROOT / "launch-scripts" / "ball_check.toml"]
    yield "scenarios", ["scenario", "list"]
    yield "doctor", ["doctor", ROOT / "launch-scripts" / "turn_mill.toml"]


def required(schema, path=()):
    """Paths of the keys that an object must have, where no list or alternative lies between."""
    for key in schema.get("required", []):
        yield (*path, key)
        below = schema["properties"][key]
        if below.get("type") == "object":
            yield from required(below, (*path, key))


@check
def real_outputs_are_valid_and_spoiled_ones_are_not(folder):
    import jsonschema

    listed = [line.split()[0] for line in probecell("schema")[0].splitlines()]
    validators = {}
    for name in listed:
        schema = json.loads(probecell("schema", name)[0])
        jsonschema.Draft202012Validator.check_schema(schema)
        assert schema["$id"] == f"probecell/{name}/1"
        validators[name] = jsonschema.Draft202012Validator(schema)
    seen = set()
    spoiled = 0
    for name, command in outputs():
        text, _ = probecell(*command, "--json")
        output = json.loads(text, parse_constant=lambda word: math.nan)
        errors = sorted(validators[name].iter_errors(output), key=str)
        assert not errors, (command, errors[0].json_path, errors[0].message)
        seen.add(name)
        for path in required(validators[name].schema):
            without = copy.deepcopy(output)
            at = without
            for key in path[:-1]:
                at = at[key]
            del at[path[-1]]
            assert not validators[name].is_valid(without), (name, path)
            spoiled += 1
    assert spoiled > 50
    assert seen | {"results"} == set(listed), set(listed) ^ seen


@check
def results_of_a_controller_are_valid(folder):
    import jsonschema

    printed = folder / "printed.txt"
    printed.write_text("AXES Z X Y C\nTOUCH 1 0 10.0 -60.0 0.0 0.0\n")
    validator = jsonschema.Draft202012Validator(json.loads(probecell("schema", "results")[0]))
    for more in ([], ["--plan", ROOT / "launch-scripts" / "turn_mill.toml"]):
        validator.validate(json.loads(probecell("results", printed, *more, "--json")[0]))


@check
def detection_limits_name_their_plan(folder):
    """Table and JSON name the plan that was measured, and of a cell that has not measured its part."""
    bag = folder / "ball_check"
    bag.mkdir()
    (bag / "ball_check.mcap").symlink_to(ROOT / "bags" / "samples" / "ball_check.mcap")
    measured = messages(bag)["probe_events"][-1].plan_id
    assert measured
    for source, name in ((ROOT / "launch-scripts" / "ball_check.toml", "two_balls"), (bag, measured)):
        output = answer("identifiability", source)
        assert output["plan_id"] == name, (output["plan_id"], name)
        table, _ = probecell("identifiability", source)
        assert table.startswith(f'plan "{name}": {output["touches"]} touches'), table.splitlines()[0]
