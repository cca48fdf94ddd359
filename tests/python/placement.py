"""Compares the outputs of a scene with `[placement]` with those of the same scene without it, transformed by numpy.

    placement.py PROGRAM SCENE ORIGIN_X ORIGIN_Y ROTATION_TURNS MIRROR TIMES

SCENE has no `[placement]`; MIRROR is true or false; TIMES are the arguments of `solve --at`. Prints the largest
differences, and ends with an error if one is beyond rounding.
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np

program, scene, origin_x, origin_y, turns, mirror, times = sys.argv[1:]
origin, angle = np.array([float(origin_x), float(origin_y)]), 2 * np.pi * (float(turns) % 1.0)
side = -1.0 if mirror == "true" else 1.0
matrix = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ np.diag([1.0, side])

folder = pathlib.Path(tempfile.mkdtemp())
table = f"\n[placement]\norigin = [{origin_x}, {origin_y}]\nrotation_turns = {turns}\nmirror = {mirror}\n"
placed = folder / "placed.toml"
placed.write_text(pathlib.Path(scene).read_text() + table)


def output(file, *arguments):
    done = subprocess.run([program, "--scene", file, *arguments], capture_output=True, text=True, check=True)
    return done.stdout


def solved(file):
    rows = [line.split(",") for line in output(file, "solve", "--at", times).splitlines()[1:]]
    return np.array([[float(number) for number in row] for row in rows])


def near(what, one, other, most):
    apart = np.max(np.abs(one - other), initial=0.0)
    print(f"{what}: {apart:.1e} of {most:.1e}")
    assert apart <= most, what


home, away = solved(scene), solved(placed)
size = np.max(np.abs(home[:, 2:4])) + np.max(np.abs(origin))
rounding = 8 * np.finfo(float).eps * size
assert home.shape == away.shape and len(home) > 1
assert np.array_equal(home[:, [0, 1, 7]], away[:, [0, 1, 7]]), "times, handles and speeds along the path"
near("positions, m", home[:, 2:4] @ matrix.T + origin, away[:, 2:4], rounding)
near("velocities, m/s", home[:, 5:7] @ matrix.T, away[:, 5:7], 1e-14 * np.max(np.abs(home[:, 5:8])))
near("headings, rad", np.exp(1j * (side * home[:, 4] + angle)), np.exp(1j * away[:, 4]), 1e-14)
assert np.all(away[:, 4] > -np.pi) and np.all(away[:, 4] <= np.pi)

home, away = ([json.loads(line) for line in output(file, "--json", "events").splitlines()] for file in (scene, placed))
assert len(home) == len(away) > 0
for one, other in zip(home, away):
    same = [key for key in one if key not in ("x", "y")]
    assert [one[key] for key in same] == [other[key] for key in same], (one, other)
    if one["x"] is None:
        assert other["x"] is None and other["y"] is None
    else:
        place = matrix @ np.array([one["x"], one["y"]]) + origin
        near(f"{one['event']}, m", place, np.array([other["x"], other["y"]]), rounding)


def drawn(file, time):
    """Returns the middles of the boards of a picture, metres, and the data of its path."""
    svg = folder / "picture.svg"
    output(file, "draw", "--at", time, "-o", str(svg))
    text = svg.read_text()
    group = text[text.index('id="benches"') :]
    boards = re.findall(r'<polygon[^>]* points="([^"]+)"', group[: group.index("</g>")])
    path = re.search(r'<path d="([^"]*)"[^>]*id="path"', text).group(1)
    corners = [[[float(number) for number in corner.split(",")] for corner in board.split()] for board in boards]
    return np.mean(corners, axis=1), path


def beside(boards, path):
    """Returns the distance of each board from the path as drawn, with straight lines for its cubics and arcs."""
    parts = [part for part in re.split("[MLCA]", path) if part]
    points = np.array([[float(number) for number in re.findall(r"[-+.\de]+", part)[-2:]] for part in parts])
    drawn = np.array([letter != "M" for letter in re.findall("[MLCA]", path)])[1:]
    begin, along = points[:-1][drawn], (points[1:] - points[:-1])[drawn]
    share = np.sum((boards[:, None] - begin) * along, axis=2) / np.maximum(np.sum(along**2, axis=1), 1e-30)
    nearest = begin + np.clip(share, 0, 1)[..., None] * along
    return np.min(np.linalg.norm(nearest - boards[:, None], axis=2), axis=1)


time = times.split(",")[-1]
(home, path), (away, placed_path) = drawn(scene, time), drawn(placed, time)
near("drawn boards, m", home @ matrix.T + origin, away, 1e-5)
# A spiral's cubics begin elsewhere, each up to 0.2 m beside its chord.
near("drawn path, m", beside(home, path), beside(away, placed_path), 0.2)
