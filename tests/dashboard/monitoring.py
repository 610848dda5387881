"""The shipped Grafana board and alert rules name nothing that /metrics does not have, and are valid PromQL."""

import json
import re

import promql_parser
import yaml
from pages import ROOT
from prometheus_client.parser import text_string_to_metric_families

FOLDER = ROOT / "launch-scripts" / "monitoring"


def check(text):
    """`text`: /metrics of a dashboard that knows a cell which has made a part."""
    known = {}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            known.setdefault(sample.name, set()).update(sample.labels)
    board = json.loads((FOLDER / "grafana.json").read_text())
    rules = yaml.safe_load((FOLDER / "alerts.yml").read_text())
    expressions = [target["expr"] for panel in board["panels"] for target in panel["targets"]]
    for group in rules["groups"]:
        for rule in group["rules"]:
            assert set(rule) <= {"alert", "expr", "for", "labels", "annotations"}, rule
            promql_parser.parse_duration(rule.get("for", "1m"))
            expressions.append(rule["expr"])
    variables = [one["query"] for one in board["templating"]["list"] if one["type"] == "query"]
    for expression in expressions:
        promql_parser.parse(expression.replace("$cell", "mill"))
    named = set()
    for expression in expressions + variables:
        for name, labels in re.findall(r"(probecell_\w+)(?:\{([^}]*)\})?", expression):
            named.add(name)
            assert name in known, f"{name} of {expression!r} is not on /metrics: {sorted(known)}"
            for label in re.findall(r"(\w+)\s*=", labels):
                assert label in known[name], f"{name} has no label {label}"
    assert len(named) >= 10, named
    print(f"monitoring: {len(expressions)} expressions are PromQL, and {len(named)} metrics are on /metrics")
