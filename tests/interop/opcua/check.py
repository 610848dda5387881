#!/usr/bin/env python3
"""A running cell and its recording as an OPC UA server, for two stacks that share no code with ours: asyncua and node-opcua.

    check.py PROBECELL FOLDER MODULES

FOLDER holds probecell-opcua, MODULES those of npm. A part is made while both clients are subscribed: every figure they got, by
event, by method and by reading, is the recording's; the types are those of the published nodesets. The check has a network
namespace of its own.
"""
import asyncio
import enum
import json
import math
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys

from asyncua import Client, ua
from asyncua.ua import uaerrors

ROOT = pathlib.Path(__file__).resolve().parents[3]
PROGRAM = pathlib.Path(sys.argv[1]).resolve()
FOLDER, MODULES = (pathlib.Path(one).resolve() for one in sys.argv[2:4])
HERE = pathlib.Path(__file__).resolve().parent
NODESETS = ROOT.parent / "shared" / "data" / "schemas" / "opcua"
sys.path[:0] = [str(ROOT / "tests"), str(HERE)]
import kit  # noqa: E402
from kit.recordings import messages  # noqa: E402
from nodesets import compare  # noqa: E402

PATHS = {"PATH": f"{FOLDER}:{os.environ['PATH']}"}
RESULT, MACHINERY, OWN = "http://opcfoundation.org/UA/Machinery/Result/", "http://opcfoundation.org/UA/Machinery/", "urn:probecell:opcua"
STATUS = {0: "PASS", 1: "REWORK", 5: "SYSERROR", 6: "INDETERMINATE", 7: "SYSERROR"}  # by the verdict of a size; else FAIL
EVALUATION = {"PASS": 1, "FAIL": 2, "REWORK": 2, "INDETERMINATE": 3, "SYSERROR": 0, "NOT_ANALYZED": 0}
GAPS = ("NO_GAP", "EXPLAINED", "PARTLY_EXPLAINED", "UNEXPLAINED")
DIAMETERS = (1, 2, 3)


def serve(*arguments):
    """The server and its address."""
    process = kit.Process(PROGRAM, "opcua", "--listen", "127.0.0.1:0", *arguments, folder=WORK, environment=os.environ | PATHS, apart=True)
    return process, re.fullmatch(r"OPC UA server of cell turn_mill: (opc\.tcp://127\.0\.0\.1:\d+/)\n", process.line()).group(1)


def end(process):
    assert process.end(signal.SIGINT) == 0, process.errors


# What the recording says

def expected(found):
    """Characteristics of each plan by the messages of the recording, by the names of the fields."""
    plans = {one.plan_id: one for one in found["inspection_plan"]}
    verdicts = {(one.plan_id, one.feature_id): one for one in found["verdicts"]}
    results = {}
    for one in found["feature_results"]:
        results.setdefault(one.plan_id, {})[one.feature_id] = one
    return {plan: {name: characteristic(one, verdicts.get((plan, name)), plans[plan]) for name, one in every.items()}
            for plan, every in results.items()}


def characteristic(result, verdict, plan):
    features = [one for one in plan.features if one.id == result.feature_id]
    planned = [features[0].lower_tolerance, features[0].upper_tolerance] if features else []
    limits = [-verdict.tolerance, verdict.tolerance] if verdict else planned
    assert limits and all(map(math.isfinite, limits)), result.feature_id
    status = STATUS.get(verdict.verdict, "FAIL") if verdict else ("PASS", "FAIL", "INDETERMINATE", "SYSERROR")[result.decision]
    outside = sum(math.erfc(sign * (limit - result.size_deviation) / result.standard_uncertainty / math.sqrt(2)) / 2
                  for sign, limit in ((-1, limits[0]), (1, limits[1])))
    return {
        "CharacteristicIdentifier": result.feature_id, "CharacteristicsClass": "diameter" if result.kind in DIAMETERS else "length",
        "IsValid": True, "ResultValue": result.size, "Nominal": result.nominal_size,
        "LowerToleranceLimit": result.nominal_size + limits[0], "UpperToleranceLimit": result.nominal_size + limits[1],
        "ResultEvaluation": EVALUATION[status], "Status": status, "StandardUncertainty": result.standard_uncertainty,
        "CoverageFactor": result.coverage_factor, "ExpandedUncertainty": result.coverage_factor * result.standard_uncertainty,
        "DecisionRule": verdict.text if verdict else "ISO 14253-1:2013", "NonconformityProbability": outside,
    }


def whole(characteristics):
    each = {one["ResultEvaluation"] for one in characteristics.values()}
    return next(one for one in (2, 0, 3, 1) if one in each)


def same(told, wanted):
    assert told.keys() == wanted.keys(), told.keys() ^ wanted.keys()
    for name, value in wanted.items():
        if name == "NonconformityProbability":
            assert abs(told[name] - value) <= 1e-9 * value + 1e-13, (name, told[name], value)
        else:
            assert told[name] == value, (wanted["CharacteristicIdentifier"], name, told[name], value)


def stamp(time):
    return time.sec * 10**9 + time.nanosec


# What clients got, as plain data

def plain(value):
    """A structure of asyncua as names and values; what is absent is left out."""
    if isinstance(value, ua.Variant):
        return plain(value.Value)
    if isinstance(value, list):
        return [plain(one) for one in value]
    if isinstance(value, ua.LocalizedText):
        return value.Text
    if hasattr(value, "__dataclass_fields__"):
        fields = {name: getattr(value, name) for name in value.__dataclass_fields__ if name != "Encoding"}
        return {"type": type(value).__name__, **{name: plain(one) for name, one in fields.items() if one is not None}}
    return value.value if isinstance(value, enum.Enum) else value


def pascal(value):
    """Names of node-opcua begin with a small letter."""
    if isinstance(value, list):
        return [pascal(one) for one in value]
    if isinstance(value, dict):
        return {name if name == "type" else name[0].upper() + name[1:]: pascal(one) for name, one in value.items()}
    return value


def content(result, kind):
    return [{name: one for name, one in each.items() if name != "type"} for each in result["ResultContent"] if each["type"] == kind]


def check_result(result, found, wanted, has_gap):
    """A result with all its figures. Gives the plan."""
    meta = result["ResultMetaData"]
    plan = meta["InternalRecipeId"]
    one = next(one for one in found["inspection_plan"] if one.plan_id == plan)
    assert re.fullmatch(rf"turn_mill/{re.escape(plan)}@\d{{4}}-\d\d-\d\dT[\d:.]+Z", meta["ResultId"]), meta
    (decision,) = [one for one in found["pass_decisions"] if one.plan_id == plan]
    assert (meta["ResultState"], meta["IsPartial"], meta["IsSimulated"]) == (1, False, True), meta
    assert meta["ResultEvaluation"] == whole(wanted[plan]), (plan, meta)
    assert meta["ResultEvaluationDetails"] == decision.text and meta["PartId"] == one.part_id == "hexagonal_punch"
    characteristics = content(result, "CharacteristicDataType")
    assert {one["CharacteristicIdentifier"] for one in characteristics} == wanted[plan].keys()
    for each in characteristics:
        same(each, wanted[plan][each["CharacteristicIdentifier"]])
    if has_gap:
        (report,) = [one for one in found["gap_report"] if one.plan_id == plan][-1:]
        (gap,) = content(result, "GapDataType")
        check_gap(gap, report)
    return plan


def check_gap(gap, report):
    assert (gap["PlanIdentifier"], gap["Verdict"], gap["Rms"], gap["NoiseFloor"]) == (
        report.plan_id, GAPS[report.verdict], report.rms, report.noise_floor)
    assert len(gap["Causes"]) == len(report.effects)
    for cause, effect in zip(gap["Causes"], report.effects):
        wanted = (effect.effect, effect.probability, list(effect.indistinguishable_from))
        assert (cause["Effect"], cause["Probability"], cause["Rivals"]) == wanted
        told = [(one["Name"], one["Unit"], one["Value"], one["Lower"], one["Upper"]) for one in cause["Parameters"]]
        assert told == list(zip(effect.parameter_names, effect.parameter_units, effect.parameter_values, effect.parameter_ci95_lower,
                                effect.parameter_ci95_upper))


class Heard:
    """What a subscription brought, in order."""

    def __init__(self):
        self.states, self.events, self.sizes = [], [], []

    def datachange_notification(self, node, value, _data):
        (self.states if "State" in str(node) else self.sizes).append(plain(value))
        kit.happened()

    def event_notification(self, event):
        self.events.append(event)
        kit.happened()

    @staticmethod
    async def until(holds):
        await asyncio.to_thread(kit.until, "what asyncua hears", holds)


class Node:
    """The client on node-opcua."""

    def __init__(self, url):
        environment = os.environ | {"NODE_PATH": str(MODULES)}
        self.process = kit.Process("node", HERE / "client.cjs", url, "turn_mill", environment=environment, stdin=subprocess.PIPE, apart=True)

    def of(self, kind):
        told = [json.loads(line) for line in self.process.lines if line.startswith("{")]
        return [pascal(one["value"]) for one in told if one["kind"] == kind]

    def wait(self, holds):
        kit.until("what node-opcua tells", lambda: holds(self))

    def end(self):
        self.process.process.stdin.close()
        code, _, errors = self.process.ended()
        assert code == 0, errors
        (last,) = self.of("end")
        return last


INT32 = ua.VariantType.Int32


class Reader:
    """The client on asyncua."""

    def __init__(self, client, addresses):
        self.client, self.addresses = client, addresses
        self.cell = addresses.index("urn:probecell:cell:turn_mill")

    def node(self, path):
        return self.client.get_node(ua.NodeId(path, self.cell))

    async def call(self, method, *arguments):
        return await self.node("ResultManagement").call_method(ua.NodeId(method, self.cell), *arguments)

    async def latest(self):
        return [plain(one) for one in await self.call("GetLatestResult", ua.Variant(0, INT32))]

    async def by_id(self, identifier):
        return [plain(one) for one in await self.call("GetResultById", ua.Variant(identifier, ua.VariantType.String), ua.Variant(0, INT32))]

    async def list(self, contents=None, most=0):
        empty = ua.Variant([], ua.VariantType.ExtensionObject, is_array=True)
        answer = await self.call("GetResultIdListFiltered", ua.Variant(contents or ua.ContentFilter()), empty,
                                 ua.Variant(most, ua.VariantType.UInt32), ua.Variant(0, INT32))
        assert (answer[0], answer[2]) == (0, 0)
        return answer[1]


async def refused(what, *statuses):
    try:
        await what
    except uaerrors.UaStatusCodeError as error:
        assert isinstance(error, statuses), error
        return
    raise AssertionError("it was not refused")


async def refusals(reader):
    """Nothing can be written, called or added."""
    probability = reader.node("Characteristics/D1/ResultValue")
    before = await probability.read_value()
    double = ua.DataValue(ua.Variant(1.0, ua.VariantType.Double))
    number = reader.client.get_node(ua.NodeId(6039, reader.addresses.index(MACHINERY)))
    for node in (probability, reader.node("MachineryItemState/CurrentState"), number):
        await refused(node.write_attribute(ua.AttributeIds.Value, double), uaerrors.BadNotWritable, uaerrors.BadUserAccessDenied)
    name = ua.DataValue(ua.Variant(ua.LocalizedText("other")))
    await refused(probability.write_attribute(ua.AttributeIds.DisplayName, name), uaerrors.BadNotWritable, uaerrors.BadUserAccessDenied)
    await refused(reader.call("Run", ua.Variant(0, INT32)), uaerrors.BadMethodInvalid, uaerrors.BadNodeIdUnknown)
    await refused(reader.call("GetLatestResult"), uaerrors.BadArgumentsMissing)
    await refused(reader.call("GetLatestResult", ua.Variant("x")), uaerrors.BadInvalidArgument)
    element = ua.ContentFilterElement(FilterOperator_=ua.FilterOperator.IsNull)
    await refused(reader.list(ua.ContentFilter(Elements=[element])), uaerrors.BadNotSupported)
    _, deleted = await reader.client.delete_nodes([probability])
    assert deleted and not any(one.is_good() for one in deleted), deleted
    added = reader.node("Machine").add_variable(ua.NodeId("new", reader.cell), "new", 1.0)
    await refused(added, uaerrors.BadServiceUnsupported, uaerrors.BadUserAccessDenied)
    assert await probability.read_value() == before


async def subscribe(reader):
    heard = Heard()
    subscription = await reader.client.create_subscription(100, heard)
    await subscription.subscribe_data_change(reader.node("MachineryItemState/CurrentState"), queuesize=100)
    ready = reader.client.get_node(ua.NodeId(1001, reader.addresses.index(OWN)))
    # asyncua filters by a list of types, in which the server's stack compares no node ids; node-opcua's filter is OfType.
    await subscription.subscribe_events(reader.node("ResultManagement"), ready, queuesize=100, where_clause_generation=False)
    return subscription, heard


async def live():
    """A part while both clients listen; gives the recording."""
    process, url = serve("--cell", "launch-scripts/turn_mill.toml")
    node = Node(url)
    async with Client(url) as client:
        await client.load_data_type_definitions()
        reader = Reader(client, await client.get_namespace_array())
        # Without a cell nothing is made up.
        assert (await reader.latest())[2] == -1 and not await reader.list()
        assert plain(await reader.node("MachineryItemState/CurrentState").read_value()) == "NotAvailable"
        subscription, heard = await subscribe(reader)
        await asyncio.to_thread(node.wait, lambda node: node.of("ready"))
        (ready,) = node.of("ready")
        assert ready["Namespaces"] == reader.addresses and ready["Early"][2] == -1, ready
        code, output, errors = await asyncio.to_thread(kit.run, PROGRAM, "up", "--once", "--no-dashboard", folder=WORK)
        print("  up:", code, output.strip().splitlines()[-1:], flush=True)
        await heard.until(lambda: len(heard.states) > 1 and heard.states[-1] == "NotAvailable")
        await asyncio.to_thread(node.wait, lambda node: node.of("state")[-1] == "NotAvailable")
        (recording,) = (WORK / "recordings").iterdir()
        found = messages(recording)
        wanted = expected(found)
        plans = [one.plan_id for one in found["pass_decisions"]]
        assert len(plans) == len(set(plans)) == len(wanted) >= 2
        # By events, each once, in the order of the decisions.
        mine = [plain(one.Result) for one in heard.events]
        theirs = [one["Whole"] for one in node.of("event")]
        for told in (mine, theirs):
            got = [check_result(one, found, wanted, False) for one in told]
            assert got == plans, (got, plans)
        for one in node.of("event"):
            assert one["Meta"] == one["Whole"]["ResultMetaData"] and one["EventType"] == f"ns={reader.addresses.index(OWN)};i=1001"
        # By methods.
        identifiers = await reader.list()
        assert await reader.list(most=1) == identifiers[:1]
        results = [await reader.by_id(one) for one in identifiers]
        last = node.end()
        assert last["Ids"] == identifiers and [(handle, error) for handle, _, error in results] == [(0, 0)] * len(results)
        for (_, mine, _), identifier in zip(results, identifiers):
            plan = check_result(mine, found, wanted, True)
            assert mine["ResultMetaData"]["ResultId"] == identifier and plan in identifier
            # The names of ids are values: they have kept their letters.
            theirs = next(one for name, one in last["Results"].items() if name.lower() == identifier.lower())
            check_result(theirs[1], found, wanted, True)
        assert (await reader.latest())[1] == results[0][1]
        assert last["Latest"][1]["ResultMetaData"]["ResultId"] == identifiers[0]
        assert (await reader.by_id("nobody"))[2] == last["Unknown"][2] == -1
        assert last["Machines"] == ["turn_mill"]
        assert last["Written"] in ("BadNotWritable", "BadUserAccessDenied"), last["Written"]
        assert last["Foreign"] in ("BadMethodInvalid", "BadNodeIdInvalid"), last["Foreign"]
        # By reading.
        newest = wanted[plans[-1]]
        names = {(await one.read_browse_name()).Name for one in await reader.node("Characteristics").get_children()}
        assert names == newest.keys()
        for name, each in newest.items():
            same({member: plain(await reader.node(f"Characteristics/{name}/{member}").read_value()) for member in each}, each)
        report = found["gap_report"][-1]
        top = report.effects[0] if report.effects else None
        members = ("PlanIdentifier", "Verdict", "Rms", "NoiseFloor", "Causes")
        gap = {member: plain(await reader.node(f"Gap/{member}").read_value()) for member in members}
        check_gap(gap, report)
        check_gap({**gap, "Causes": last["Gap"]["Causes"], "Verdict": last["Gap"]["Verdict"]}, report)
        if top:
            assert plain(await reader.node("Gap/Rivals").read_value()) == last["Gap"]["Rivals"] == list(top.indistinguishable_from)
            assert (last["Gap"]["Cause"], last["Gap"]["Probability"]) == (top.effect, top.probability)
        assert "Executing" in heard.states and "NotExecuting" in heard.states and heard.states[0] == "NotAvailable", heard.states
        assert node.of("state")[0] == "NotAvailable" and set(node.of("state")) == set(heard.states)
        # What could not be decided is told so.
        statuses = {one["Status"] for every in wanted.values() for one in every.values()}
        decided = {one.verdict for one in found["verdicts"]}
        assert 6 in decided and "INDETERMINATE" in statuses and whole(newest) == 3, (decided, statuses, whole(newest))
        units = await reader.node("Characteristics/D1/ResultValue/EngineeringUnits").read_value()
        assert (units.UnitId, units.DisplayName.Text) == (int.from_bytes(b"MTR", "big"), "m")
        await refusals(reader)
        await published(client)
        await subscription.delete()
        print(f"  {len(plans)} measurements, {sum(map(len, wanted.values()))} characteristics, {len(heard.states)} states, "
              f"gap {GAPS[report.verdict]} {top.effect if top else ''}", flush=True)
        results = [mine for _, mine, _ in results]
    end(process)
    return recording, identifiers, results


async def published(client):
    files = [NODESETS / f"Opc.Ua.{name}.NodeSet2.xml" for name in ("Di", "Machinery", "Machinery.Result")]
    if not all(file.exists() for file in files):
        print("  skipped: comparison with the published nodesets, which are not there", flush=True)
        return
    counts = await compare(client, files)
    assert len(counts) == 3
    print("  as published: " + ", ".join(f"{count} nodes of {address}" for address, count in counts.items()), flush=True)


async def recorded(recording, identifiers, results):
    """The recording served: what the live cell had told. And a sample whose last measurement conforms."""
    process, url = serve("--bag", recording)
    async with Client(url) as client:
        await client.load_data_type_definitions()
        reader = Reader(client, await client.get_namespace_array())
        assert await reader.list() == identifiers
        for identifier, result in zip(identifiers, results):
            assert (await reader.by_id(identifier))[1] == result
    end(process)
    process, url = serve("--bag", ROOT / "bags" / "samples" / "punch.mcap")
    async with Client(url) as client:
        await client.load_data_type_definitions()
        reader = Reader(client, await client.get_namespace_array())
        assert (await reader.latest())[1]["ResultMetaData"]["ResultEvaluation"] == 1
    end(process)


def bad_input(url):
    port = re.search(r":(\d+)/", url).group(1)
    for arguments, words in [
        (["--listen", "0.0.0.0:0"], "not encrypted"), (["--listen", "nowhere"], "nowhere"), (["--bag", "nothing.mcap"], "nothing.mcap"),
        (["--cell", "nothing.toml"], "nothing.toml"), (["--bag", "a", "--cell", "b"], "cannot be used with"),
        (["--listen", f"127.0.0.1:{port}", "--cell", "launch-scripts/turn_mill.toml"], "cannot listen on"),
    ]:
        code, _, errors = kit.run(PROGRAM, "opcua", *arguments, folder=WORK, environment=os.environ | PATHS)
        assert code == 2 and words in errors, (arguments, code, errors)
        assert errors.count("\n") == 1 or "Usage" in errors or "--help" in errors, errors
    nowhere, alone = os.environ | {"PATH": "/usr/bin"}, shutil.copy(PROGRAM, WORK)
    code, _, errors = kit.run(alone, "opcua", "--bag", ROOT / "bags/samples/punch.mcap", folder=WORK, environment=nowhere)
    assert code == 2 and "is neither in the folder of this program nor on PATH: `cargo build --release -p probecell_opcua`" in errors, errors
    # Beyond loopback only by the option that names the reason.
    assert "RUSTSEC-2023-0071" in kit.run(PROGRAM, "opcua", "--help")[1]


def main(folder):
    global WORK
    WORK = folder
    (WORK / "launch-scripts").mkdir()
    for name in ("turn_mill.toml", "turn_mill.urdf"):
        shutil.copy(ROOT / "launch-scripts" / name, WORK / "launch-scripts")
    cell = WORK / "launch-scripts" / "turn_mill.toml"
    text = cell.read_text(encoding="utf-8")
    # A tolerance within which U leaves nothing to be proved.
    old, new = '{ id = "D1", tolerance_mm = 0.010, tool_number = 2 }', '{ id = "D1", tolerance_mm = 0.004, tool_number = 2 }'
    assert old in text
    text = text.replace(old, new)
    cell.write_text(text, encoding="utf-8")
    asyncio.run(recorded(*asyncio.run(live())))
    process, url = serve("--cell", "launch-scripts/turn_mill.toml")
    bad_input(url)
    end(process)


kit.main({"OPC UA": main})
