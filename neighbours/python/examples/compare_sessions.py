"""Which effects changed between two recordings of one machine? compare_sessions.py BEFORE AFTER

Prints a line for each parameter: what it was, what it is, and whether the 95 % intervals are apart.
"""

import sys

import probecell


def parameters(path: str) -> dict[tuple[str, str], tuple[float, float, float, str]]:
    """Value, interval and unit of each named effect's parameters."""
    table = probecell.diagnose(path).effects
    rows = zip(table["effect"], table["parameter"], table["value"], table["low"], table["high"], table["unit"])
    return {(effect, name): (value, low, high, unit) for effect, name, value, low, high, unit in rows}


def main(before: str, after: str) -> None:
    """Compares two recordings."""
    old, new = parameters(before), parameters(after)
    for key in sorted(old.keys() | new.keys()):
        was, now = old.get(key), new.get(key)
        unit = (was or now or (0, 0, 0, ""))[3]
        apart = was is None or now is None or was[2] < now[1] or now[2] < was[1]
        show = [f"{one[0]:.3g} [{one[1]:.3g}, {one[2]:.3g}]" if one else "not named" for one in (was, now)]
        print(f"{' '.join(key)}: {show[0]} -> {show[1]} {unit}{', changed' if apart else ''}")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
