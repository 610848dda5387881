"""Why a machine that measures its own parts differs from its model.

    import pandas, probecell

    table = pandas.read_csv("my.csv")
    roles = {"nominal_x": "X", "nominal_y": "Y", "nominal_z": "Z", "i": "NX", "j": "NY", "k": "NZ", "deviation": "Dev"}
    found = probecell.diagnose(table, columns=roles, units={"length": "mm", "deviation": "um"})
    print(found)

The same engine as the command `probecell`, with the same answers: what `json()` gives is what `--json` prints, byte for byte. Numbers
are in SI units (m, rad, s). What cannot be used raises `InputError` with the sentence that the command prints; a recording of which
only a part can be used is a `RecordingWarning`. Long computations release the interpreter's lock.
"""

from ._engine import (
    Bag,
    Diagnosis,
    Fit,
    InputError,
    PartRecord,
    Plan,
    PredictiveCheck,
    RecordingWarning,
    Session,
    Table,
    __version__,
    diagnose,
    fit,
    import_touches,
    plan,
    read_session,
    report,
    simulate,
)

__all__ = [
    "Bag",
    "Diagnosis",
    "Fit",
    "InputError",
    "PartRecord",
    "Plan",
    "PredictiveCheck",
    "RecordingWarning",
    "Session",
    "Table",
    "__version__",
    "diagnose",
    "fit",
    "import_touches",
    "plan",
    "read_session",
    "report",
    "simulate",
]
