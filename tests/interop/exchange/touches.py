"""Tables of touches, written by plain Python that shares no code with the program: a block in a bore plate, clamped off its
place by a known shift, with noise of a fixed seed."""

import csv
import math
import random

SHIFT_UM = (8.0, 0.0, 0.0)  # of the part, part frame
NOISE_UM = 0.5  # standard deviation of one touch
HEADER = ["Punkt", "Merkmal", "X soll", "Y soll", "Z soll", "NX", "NY", "NZ", "Abw", "Zeit"]


def points(count=500):
    """Feature, nominal point (mm) and outward normal: five faces of a block of 120 x 80 x 40 mm, and a bore of 30 mm in its top."""
    chance = random.Random(20261122)
    faces = [
        ("left", (0, None, None), (-1, 0, 0)),
        ("right", (120, None, None), (1, 0, 0)),
        ("front", (None, 0, None), (0, -1, 0)),
        ("back", (None, 80, None), (0, 1, 0)),
        ("top", (None, None, 40), (0, 0, 1)),
        ("bore", None, None),
    ]
    sizes = (120, 80, 40)
    for number in range(count):
        name, place, normal = faces[number % len(faces)]
        if place is None:
            angle = chance.uniform(0, 2 * math.pi)
            radial = (math.cos(angle), math.sin(angle))
            position = (60 + 15 * radial[0], 40 + 15 * radial[1], chance.uniform(10, 38))
            normal = (-radial[0], -radial[1], 0.0)
        else:
            position = tuple(
                chance.uniform(5, size - 5) if fixed is None else fixed for fixed, size in zip(place, sizes)
            )
        yield name, position, normal


def rows(count=500, shift=SHIFT_UM, noise=NOISE_UM):
    """Rows of the table: a part that is shifted deviates by the component of the shift along each normal."""
    chance = random.Random(8)
    for number, (name, position, normal) in enumerate(points(count)):
        deviation = sum(a * b for a, b in zip(shift, normal)) + chance.gauss(0, noise)
        yield [number, name, *position, *normal, deviation, 12.5 * number]


def write(path, count=500, shift=SHIFT_UM, delimiter=","):
    """Writes the table, mm and µm, every number so that it is read back to the bit; gives its rows."""
    all_rows = list(rows(count, shift))
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, delimiter=delimiter)
        writer.writerow(HEADER)
        writer.writerows(all_rows)
    return all_rows


FEATURES = """id,kind,x,y,z,i,j,k,diameter,lower,upper
left,plane,0,0,0,-1,0,0,,-20,20
right,plane,120,0,0,1,0,0,,-5,5
front,plane,0,0,0,0,-1,0,,-20,20
back,plane,0,80,0,0,1,0,,-20,20
top,plane,0,0,40,0,0,1,,-20,20
bore,bore,60,40,0,0,0,1,30,-10,10
"""

COLUMNS = (
    "nominal_x=X soll,nominal_y=Y soll,nominal_z=Z soll,i=NX,j=NY,k=NZ,deviation=Abw,feature=Merkmal,time=Zeit"
)
UNITS = "length=mm,deviation=um,time=s"
