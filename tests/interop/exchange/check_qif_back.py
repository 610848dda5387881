"""The published QIF samples through `import plan`, `import reference` and `export`, and back: both documents as lxml reads them.

What is compared are features, nominal points and normals, diameters, limits, and of points that were measured the deviation along
the normal, its conformity and, of the sample, the value that its author calculated. What a recording has no place for is
asserted as well: characteristics other than of one diameter or one point, and circles that were measured without their points.
"""

import math

from check import SCHEMAS, check, close, probecell
from check_exports import schema

SAMPLES = SCHEMAS / "qif3" / "samples"
SPACE = "{http://qifstandards.org/xsd/qif3}"
# Figures of a sample are rounded decimals of mm: of a place of metres, and of a normal with 15 digits, the deviation has ten.
MM = 1e-9


class Document:
    """A QIF document: elements by identifier."""

    def __init__(self, path):
        from lxml import etree

        self.tree = etree.parse(str(path))
        self.by_id = {one.get("id"): one for one in self.tree.iter() if isinstance(one.tag, str) and one.get("id")}

    def below(self, name):
        return [one for found in self.tree.iter(SPACE + name) for one in found if isinstance(one.tag, str)]

    def to(self, of, path):
        """The element to which the identifier at the path refers."""
        return self.by_id[text(of, path)]

    def item_feature(self, item):
        """Name of the one feature of a characteristic; none of several."""
        ids = [one.text for one in item.find(SPACE + "FeatureItemIds")]
        return text(self.by_id[ids[0]], "FeatureName") if len(ids) == 1 else None

    def drawn(self, item):
        """Item, nominal and definition of a characteristic."""
        nominal = self.to(item, "CharacteristicNominalId")
        return item, nominal, self.to(nominal, "CharacteristicDefinitionId")


def text(of, path):
    return of.findtext("/".join(SPACE + name for name in path.split("/"))).strip()


def optional(of, path, otherwise):
    found = of.find("/".join(SPACE + name for name in path.split("/")))
    return otherwise if found is None else float(found.text)


def vector(of, path):
    return tuple(map(float, text(of, path).split()))


def unit(values):
    return tuple(value / math.hypot(*values) for value in values)


def kind(element, ending):
    return element.tag.removeprefix(SPACE).removesuffix(ending)


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def published(document):
    """Features, limits and characteristics without a place in a plan, as a sample states them."""
    features, limits, lost = {}, {}, set()
    for item in document.below("FeatureItems"):
        nominal = document.to(item, "FeatureNominalId")
        definition = document.to(nominal, "FeatureDefinitionId")
        features[text(item, "FeatureName")] = (
            vector(nominal, "Location"), unit(vector(nominal, "Normal")), optional(definition, "Diameter", None),
            definition.findtext(SPACE + "InternalExternal") == "INTERNAL",
        )
    for item in document.below("CharacteristicItems"):
        item, nominal, definition = document.drawn(item)
        what, feature = kind(item, "CharacteristicItem"), document.item_feature(item)
        if definition.find(SPACE + "NonTolerance") is not None and what in ("PointProfile", "Diameter"):
            continue
        if what == "PointProfile":
            zone = optional(definition, "ToleranceValue", None)
            outer = optional(definition, "OuterDisposition", zone / 2)
            limits[feature] = (outer - zone, outer)
        elif what == "Diameter":
            base = features[feature][2] if text(definition, "Tolerance/DefinedAsLimit") == "true" else 0
            limits[feature] = tuple(optional(definition, f"Tolerance/{side}Value", None) - base for side in ("Min", "Max"))
        elif definition.find(SPACE + "NonTolerance") is None:
            lost.add(text(item, "Name"))
    return features, limits, lost


def measured_by_others(document):
    """Of a sample: points by feature; values and status of their profiles; features that are no points."""
    points, profiles, others = {}, {}, set()
    for one in document.below("MeasuredFeatures"):
        name = text(document.to(one, "FeatureItemId"), "FeatureName")
        if "Point" in one.tag:
            points[name] = vector(one, "Location")
        else:
            others.add(name)
    for one in document.below("CharacteristicMeasurements"):
        item = document.to(one, "CharacteristicItemId")
        if kind(item, "CharacteristicItem") == "PointProfile":
            values, statuses = profiles.setdefault(document.item_feature(item), ([], set()))
            values.append(float(text(one, "Value")))
            statuses.add(text(one, "Status/CharacteristicStatusEnum"))
    return points, profiles, others


def exported(document):
    """Features and limits as a document of ours states them."""
    features, limits = {}, {}
    for item in document.below("FeatureItems"):
        nominal = document.to(item, "FeatureNominalId")
        definition = document.to(nominal, "FeatureDefinitionId")
        if kind(nominal, "FeatureNominal") == "PointDefinedSurface":
            (point,) = nominal.find(SPACE + "DefiningPoints")
            at, normal = vector(point, "Point"), vector(point, "Normal")
        else:
            at, normal = vector(nominal, "Axis/AxisPoint"), vector(nominal, "Axis/Direction")
        features[text(item, "FeatureName")] = (
            at, normal, optional(definition, "Diameter", None), definition.findtext(SPACE + "InternalExternal") == "INTERNAL",
        )
    for item in document.below("CharacteristicItems"):
        item, nominal, definition = document.drawn(item)
        if definition.find(SPACE + "Tolerance") is None:
            continue
        assert text(definition, "Tolerance/DefinedAsLimit") == "false"
        name = document.item_feature(item)
        assert name == text(item, "Name") and name not in limits
        limits[name] = tuple(float(text(definition, f"Tolerance/{side}Value")) for side in ("Min", "Max"))
        close(float(text(nominal, "TargetValue")), features[name][2] or 0, MM)
    return features, limits


def same_plan(theirs, ours):
    """Every feature and limit of a sample stands in our document, and nothing else."""
    (features, limits, _), (own, own_limits) = published(theirs), exported(ours)
    assert list(own) == list(features), (list(own), list(features))
    for name, (at, normal, diameter, inner) in features.items():
        own_at, own_normal, own_diameter, own_inner = own[name]
        for one, other in zip((*at, *normal), (*own_at, *own_normal)):
            close(one, other, MM)
        assert (diameter is None) == (own_diameter is None) and inner == own_inner, name
        close(diameter or 0, own_diameter or 0, MM)
    assert set(own_limits) == set(limits), set(own_limits) ^ set(limits)
    for name, (low, high) in limits.items():
        close(own_limits[name][0], low, MM)
        close(own_limits[name][1], high, MM)
    return features, limits


def left_out(said, beginning):
    """Names that follow the beginning in the notes of what was left out."""
    notes = [line.removeprefix(f"note: left out: {beginning} ") for line in said.splitlines() if f"left out: {beginning} " in line]
    return {note.split(",")[0] for note in notes}


@check
def published_qif_samples_come_back_with_their_figures(folder):
    if not SAMPLES.is_dir():
        return "the published samples are not there"
    valid = schema(SCHEMAS / "qif3" / "QIFApplications" / "QIFDocument.xsd")
    # Features, limits, points that were measured, and of these with a profile: counted in the documents by hand.
    samples = {"simplePlan": (6, 4, 0, 0), "QIF_Results_Sample": (6, 4, 3, 2), "SheetMetal_QIF_Results_sample_1": (21, 17, 17, 17)}
    for name, counts in samples.items():
        path, plan, back = SAMPLES / f"{name}.QIF", folder / f"plan_{name}", folder / f"{name}.qif"
        theirs = Document(path)
        _, said = probecell("import", "plan", path, "--format", "qif", "--out", plan)
        assert left_out(said, "characteristic") == published(theirs)[2], said
        probecell("export", plan, "--format", "qif", "--out", back)
        ours = Document(back)
        valid.assertValid(ours.tree)
        features, limits = same_plan(theirs, ours)
        assert not ours.below("CharacteristicMeasurements") and not ours.below("MeasuredPointSets")
        points, profiles, others = measured_by_others(theirs)
        assert (len(features), len(limits), len(points), len(profiles)) == counts, name
        reference = ["import", "reference", path, "--format", "qif", "--to", plan, "--instrument", "Umess", "--uncertainty-um", 2]
        if not points:
            _, said = probecell(*reference, "--out", folder / "never", status=2)
            assert "no measured point" in said, said
            continue
        bag = folder / name
        _, said = probecell(*reference, "--out", bag)
        assert left_out(said, "measured feature") == others, said
        probecell("export", bag, "--format", "qif", "--out", back)
        ours = Document(back)
        valid.assertValid(ours.tree)
        same_plan(theirs, ours)
        same_points(ours, features, points)
        same_profiles(ours, features, points, profiles)
    # The fourth sample states by its serial number that a part has passed, and nothing that could be planned, measured or given back.
    path = SAMPLES / "mitutoyo_results_serialized_pass_fail_sample.QIF"
    bare = Document(path)
    assert not bare.below("FeatureItems") and not bare.below("CharacteristicItems") and not bare.below("MeasuredFeatures")
    (part,) = bare.below("ActualComponentSet")
    stated = f"it states {text(part, 'Status/InspectionStatusEnum')} for the part {text(part, 'SerialNumber')}"
    reference = ["import", "reference", path, "--format", "qif", "--to", folder / "plan_simplePlan", "--instrument", "Umess", "--uncertainty-um", 2]
    for command in (["import", "plan", path, "--format", "qif"], reference):
        _, said = probecell(*command, "--out", folder / "none", status=2)
        assert said.rstrip().endswith(stated) and not (folder / "none").exists(), said


def same_points(ours, features, points):
    """The points that were measured, as far along the normal from their nominal as in the sample."""
    (measured,) = ours.below("MeasuredPointSets")
    columns = {one: list(map(float, text(measured, one).split())) for one in ("Points", "Normals", "Deviations")}
    assert len(columns["Deviations"]) == len(points) == int(measured.get("count"))
    for index, name in enumerate(points):
        at, normal = (columns[one][3 * index : 3 * index + 3] for one in ("Points", "Normals"))
        nominal, direction, _, _ = features[name]
        deviation = dot(direction, points[name]) - dot(direction, nominal)
        close(columns["Deviations"][index], deviation, MM)
        for one, other in zip(normal, direction):
            close(one, other, MM)
        for one, from_nominal, along in zip(at, nominal, direction):
            close(one, from_nominal + deviation * along, MM)


def same_profiles(ours, features, points, profiles):
    """Of every point its deviation, and where the sample has a profile the value and the status that its author found."""
    seen = set()
    for one in ours.below("CharacteristicMeasurements"):
        name = ours.item_feature(ours.to(one, "CharacteristicItemId"))
        value, status = float(text(one, "Value")), text(one, "Status/CharacteristicStatusEnum")
        assert text(one, "Description") == "by Umess"
        nominal, direction, _, _ = features[name]
        close(value, dot(direction, points[name]) - dot(direction, nominal), MM)
        if name in profiles:
            values, statuses = profiles[name]
            close(value, max(values, key=abs), MM)
            assert statuses == {status}, (name, status, statuses)
        else:
            assert status == "NOT_ANALYZED", (name, status)
        seen.add(name)
    assert seen == set(points), seen ^ set(points)
