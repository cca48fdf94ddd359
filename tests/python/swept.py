"""Compares the ground of `check --swept` with the union of boards at many times, by shapely.

    swept.py PROGRAM SCENE FROM UNTIL FIRST LAST HEAD_LENGTH BODY_LENGTH WIDTH HOLE_INSET [DRAGON:FIRST_HANDLE]

FIRST and LAST are benches counted from 1, of a show of two within the dragon. With `all:HANDLE` in place of a dragon
they are numbered through, and HANDLE is the handle that leads no bench. The boards come from `solve`, every 2 mm of the
head. Prints the differences, and ends with an error where the outlines are more than 1 mm apart.
"""

import json
import math
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import shapely

program, scene = sys.argv[1:3]
begin, end, first, last = sys.argv[3:7]
head_length, body_length, width, inset = map(float, sys.argv[7:11])
# The widths of head and tail, if they differ.
own_widths = [float(own) for own in sys.argv[12:14]]
dragon, number = sys.argv[11].split(":") if len(sys.argv) > 11 and sys.argv[11] else (None, 0)
number = int(number)
TOLERANCE, STEP = 1e-3, 2e-3
# The head goes at most this far in a second.
FASTEST = 1.2

file = pathlib.Path(tempfile.mkdtemp()) / "swept.json"
command = [program, "--scene", scene, "--json", "check", "--swept", str(file)]
command += ["--from", begin, "--until", end]
if dragon != "all":
    command += ["--benches", f"{dragon}:{first}-{last}" if dragon else f"{first}-{last}"]
printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
feature = json.loads(file.read_text())
claimed = shapely.geometry.shape(feature["geometry"])
assert json.loads(printed)["area"] == feature["properties"]["area"], printed
offset = 0 if dragon in (None, "all") else number
numbers = [offset + int(first) - 1, offset + int(last) - 1]
assert feature["properties"]["benches"] == numbers, feature["properties"]
assert claimed.is_valid, shapely.is_valid_reason(claimed)
assert math.isclose(claimed.area, feature["properties"]["area"], rel_tol=1e-9), (claimed.area, feature["properties"])
for ring in (ring for polygon in claimed.geoms for ring in [polygon.exterior, *polygon.interiors]):
    assert ring.coords[0] == ring.coords[-1]

solve = [program, "--scene", scene, "solve", "--from", begin, "--every", str(STEP), "--until", end]
rows = subprocess.run(solve, capture_output=True, text=True, check=True).stdout.splitlines()[1:]
table = np.array([[float(number) for number in row.split(",")[:4]] for row in rows])
handles = int(table[:, 1].max()) + 1
places = table[:, 2:4].reshape(-1, handles, 2)
chosen = np.arange(numbers[0], numbers[1] + 1)
if dragon == "all":
    chosen = chosen[chosen != number]
front, rear = places[:, chosen], places[:, chosen + 1]
along = front - rear
along /= np.linalg.norm(along, axis=2, keepdims=True)
widths = np.full(len(chosen), width)
if own_widths:
    widths[[0, -1]] = own_widths
across = 0.5 * widths[:, None] * np.stack([-along[..., 1], along[..., 0]], axis=2)
front, rear = front + inset * along, rear - inset * along
corners = np.stack([front + across, rear + across, rear - across, front - across], axis=2)
found = shapely.union_all(shapely.polygons(corners.reshape(-1, 4, 2)))

outside = found.difference(claimed.buffer(TOLERANCE)).area
# A corner leaves notches between two samples, at most half as deep as the head has gone.
beyond = claimed.difference(found.buffer(TOLERANCE + 0.5 * FASTEST * STEP)).area
print(f"{claimed.area:.6f} m2, sampled {found.area:.6f} m2; outside {outside:.3e}, beyond {beyond:.3e}")
assert outside == 0.0 and beyond == 0.0, "the outlines are more than 1 mm apart"
assert abs(claimed.area - found.area) < (TOLERANCE + 0.5 * STEP) * claimed.length, (claimed.area, found.area)
