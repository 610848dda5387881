"""The bill of materials against the schema of CycloneDX, as the reference library of its makers has it: sbom.py FILE"""

import json
import pathlib
import sys

from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator

text = pathlib.Path(sys.argv[1]).read_text()
wrong = JsonStrictValidator(SchemaVersion.V1_5).validate_str(text)
assert wrong is None, wrong
bill = json.loads(text)
known = {one["bom-ref"] for one in bill["components"]} | {bill["metadata"]["component"]["bom-ref"]}
for one in bill["dependencies"]:
    assert {one["ref"], *one["dependsOn"]} <= known, one
assert all("hashes" in one or "licenses" in one for one in bill["components"])
hashed = sum("hashes" in one for one in bill["components"])
print(f"{len(bill['components'])} components, {hashed} of them with the checksum of their source")
