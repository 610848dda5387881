"""The package answers as the command does, byte for byte."""

import probecell
import pytest
from conftest import CELLS, SAMPLES, command

BAGS = sorted(SAMPLES.glob("*.mcap"))
TOUCHED = [bag for bag in BAGS if bag.stem in ("ball_check", "guideway", "punch_uncalibrated")]


def name(path):
    return path.stem


@pytest.mark.parametrize("bag", BAGS, ids=name)
def test_diagnose(bag):
    found = probecell.diagnose(bag)
    assert found.json() + "\n" == command("diagnose", bag, "--json")
    assert str(found) + "\n" == command("diagnose", bag) == bag.with_suffix(".report.txt").read_text()


def test_diagnose_jointly():
    bags = [SAMPLES / "guideway.mcap", SAMPLES / "guideway.mcap"]
    joint = probecell.diagnose(bags, withhold=SAMPLES / "guideway_straight.mcap", without=["thermal.drift"])
    withheld = ["--withhold", SAMPLES / "guideway_straight.mcap", "--without", "thermal.drift"]
    assert joint.json() + "\n" == command("diagnose", *bags, "--json", *withheld)


@pytest.mark.parametrize("bag", BAGS, ids=name)
def test_report(bag):
    record = probecell.report(bag)
    assert record.json() + "\n" == command("report", bag, "--json")
    assert str(record) + "\n" == command("report", bag)
    sizes = record.to_dict()["sizes"]
    assert record.sizes["deviation"] == [one["deviation"] for one in sizes]
    assert record.sizes["conformity"] == [one["conformity"] for one in sizes]


@pytest.mark.parametrize("source", [SAMPLES / "ball_check.mcap", CELLS / "turn_mill.toml", CELLS / "ball_plate.toml"], ids=name)
def test_plan(source):
    plan = probecell.plan(source)
    assert plan.json() + "\n" == command("plan", source, "--json")
    told = plan.to_dict()
    assert plan.order == told["order"] and len(plan) == len(told["order"])
    assert plan.moves["axis." + told["axis_names"][0]] == [one["axis_positions"][0] for one in told["moves"]]
    assert plan.points["x"] == [one["position"]["x"] for one in told["plan"]["points"]]


def test_simulate():
    bag = SAMPLES / "ball_check.mcap"
    check = probecell.simulate(bag, draws=2000, seed=3)
    # Status 1 says that statistics contradict the model; there are none here.
    assert check.json() + "\n" == command("simulate", "--like", bag, "--draws", 2000, "--seed", 3, "--json")
    assert str(check) + "\n" == command("simulate", "--like", bag, "--draws", 2000, "--seed", 3)


def test_a_simulated_session_is_a_recording_for_the_command(tmp_path):
    bag = SAMPLES / "ball_check.mcap"
    again = probecell.simulate(bag, draws=2000).again(seed=5)
    again.save(tmp_path / "ours")
    command("simulate", "--like", bag, "--draws", 2000, "--seed", 5, "--out", tmp_path / "theirs")
    ours = command("diagnose", tmp_path / "ours", "--json").replace('"ours"', '"theirs"')
    assert ours == command("diagnose", tmp_path / "theirs", "--json")
    assert again.diagnose().to_dict()["effects"] == probecell.diagnose(tmp_path / "ours").to_dict()["effects"]


def test_info():
    import json

    bag = SAMPLES / "punch.mcap"
    told = json.loads(command("info", bag, "--verify", "--json"))
    assert told.items() >= probecell.Bag(bag).info(verify=True).items()


@pytest.mark.parametrize("bag", TOUCHED, ids=name)
def test_pages(bag, tmp_path):
    command("diagnose", bag, "--html", tmp_path / "diagnosis.html")
    command("report", bag, "--html", tmp_path / "report.html")
    found, record = probecell.diagnose(bag), probecell.report(bag)
    assert found.html() == (tmp_path / "diagnosis.html").read_text()
    assert record.html() == (tmp_path / "report.html").read_text()
    from html.parser import HTMLParser

    for shown in (found, record):
        frames = []
        parser = HTMLParser()
        parser.handle_starttag = lambda tag, attributes: frames.append((tag, dict(attributes)))
        parser.feed(shown._repr_html_())
        ((tag, attributes),) = frames
        assert tag == "iframe" and attributes["srcdoc"] == shown.html() and attributes["sandbox"] == ""


@pytest.mark.parametrize(
    "call, arguments",
    [
        (lambda path: probecell.diagnose(path / "nothing"), lambda path: ["diagnose", path / "nothing"]),
        (lambda path: probecell.plan(path / "broken.toml"), lambda path: ["plan", path / "broken.toml"]),
        (lambda path: probecell.plan(path / "lacking.toml"), lambda path: ["plan", path / "lacking.toml"]),
        (lambda path: probecell.report(path / "text.mcap"), lambda path: ["report", path / "text.mcap"]),
        (
            lambda path: probecell.diagnose(SAMPLES / "punch.mcap", plan="other"),
            lambda path: ["diagnose", SAMPLES / "punch.mcap", "--plan", "other"],
        ),
        (
            lambda path: probecell.diagnose(SAMPLES / "punch.mcap", without=["axis.Q.scale"]),
            lambda path: ["diagnose", SAMPLES / "punch.mcap", "--without", "axis.Q.scale"],
        ),
        (
            lambda path: probecell.simulate(SAMPLES / "ball_check.mcap", draws=3),
            lambda path: ["simulate", "--like", SAMPLES / "ball_check.mcap", "--draws", 3],
        ),
    ],
    ids=["no bag", "no TOML", "unknown key", "no MCAP", "no such plan", "no such effect", "too few draws"],
)
def test_errors_are_the_sentences_of_the_command(call, arguments, tmp_path):
    (tmp_path / "broken.toml").write_text("[cell\n")
    text = (CELLS / "turn_mill.toml").read_text()
    (tmp_path / "lacking.toml").write_text(text.replace("max_corrections", "max_corections"))
    (tmp_path / "text.mcap").write_text("no recording")
    with pytest.raises(probecell.InputError) as raised:
        call(tmp_path)
    assert str(raised.value) == command(*arguments(tmp_path), status=2)


def test_damage_is_a_warning_and_the_rest_is_used(tmp_path):
    bag = tmp_path / "cut.mcap"
    whole = (SAMPLES / "punch.mcap").read_bytes()
    bag.write_bytes(whole[: len(whole) * 9 // 10])
    with pytest.warns(probecell.RecordingWarning, match="only the complete part"):
        record = probecell.report(bag)
    import subprocess

    from conftest import PROGRAM

    told = subprocess.run([PROGRAM, "report", bag, "--json"], capture_output=True, text=True)
    assert told.returncode == 3 and record.json() + "\n" == told.stdout
