"""First touches and least clearances of obstacles by a brute force of its own.

    ground.py PROGRAM SCENE.toml
    ground.py PROGRAM --random SEED COUNT [FAMILY]

The paths, the followers and the search are written here again; shapely measures the distances of the boards. Prints
what it compared, and ends with an error if there was a difference. Only the end of the motion and the first contact of
two boards are the program's: `tests/compute/oracle` has a brute force of these.
"""

import collections
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import tomllib

import numpy as np
import shapely

from ground_path import Path
from ground_scenes import FAMILIES, random_scene

# Metres and seconds: of a clearance, and of a time.
CLEARANCE, TIME = 1e-9, 2e-9
# A touch of less depth may be none, and a clearance of less a touch.
GRAZE = 1e-11
# Parts into which an interval is divided.
PARTS = 8
# Number of boards whose depth in a shape with corners is measured at once.
MOST_DEPTHS = 200


class Show:
    """A scene: boards by time, about the start of the path, so that no digit is lost far from the origin."""

    def __init__(self, scene):
        self.scene, self.team = scene, scene["team"]
        placement = scene.get("placement", {})
        angle = math.tau * math.fmod(placement.get("rotation_turns", 0.0), 1.0)
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        if placement.get("mirror", False):
            turn = turn @ np.diag([1.0, -1.0])
        self.path = Path(scene, turn)
        start = np.array(scene["path"].get("start", [0.0, 0.0]), np.longdouble)
        self.origin = np.array(placement.get("origin", [0.0, 0.0]), np.longdouble) + turn.astype(np.longdouble) @ start
        self.speed = scene["motion"]["head_speed"]
        self.links = [
            self.size(bench, "length", self.team["body_length"]) - 2 * self.team["hole_inset"]
            for bench in range(self.team["benches"])
        ]

    def size(self, bench, what, of_body):
        """Returns the length or the width of the board of a bench."""
        end = "head" if bench == 0 else "tail" if bench + 1 == self.team["benches"] else None
        return self.team.get(f"{end}_{what}", of_body)

    def local(self, corners):
        return (np.array(corners, np.longdouble) - self.origin).astype(float)

    def corners(self, times, benches=slice(None)):
        """Returns the corners of boards by bench and time."""
        numbers = np.arange(len(self.links))[benches]
        places = [self.speed * times]
        for link in self.links[: numbers.max() + 1]:
            places.append(self.path.follower(places[-1], link))
        front, rear = (self.path.points(np.array(places)[numbers + end]) for end in (0, 1))
        along = (front - rear) / np.hypot(*np.moveaxis(front - rear, -1, 0))[..., None]
        across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
        widths = np.array([self.size(bench, "width", self.team["width"]) for bench in numbers])
        inset, half = self.team["hole_inset"] * along, 0.5 * widths[:, None, None] * across
        return np.stack([front + inset + half, front + inset - half, rear - inset - half, rear - inset + half], axis=2)


class Obstacle:
    """A shape of the stage, about the start of the path."""

    def __init__(self, show, given, is_boundary=False):
        self.keep_out, self.is_boundary = given.get("keep_out", 0.0), is_boundary
        self.radius, self.inside = 0.0, None
        if "circle" in given:
            points = show.local([given["circle"]["center"]])
            self.body, self.radius = shapely.points(points[0]), given["circle"]["radius"]
        elif "line" in given:
            points = show.local(given["line"])
            self.body = shapely.linestrings(points)
        else:
            points = show.local(given["polygon"] + given["polygon"][:1])
            self.inside = shapely.polygons(points)
            self.body = shapely.linearrings(points) if is_boundary else self.inside
        self.points = points
        for shape in (self.body, self.inside):
            shapely.prepare(shape)

    def distances(self, corners, limit=math.inf):
        """Returns the distances of boards, 0 where they overlap. Beyond `limit` a lower bound of them may do."""
        centres = shapely.points(corners.mean(axis=-2))
        half = np.hypot(*np.moveaxis(corners[..., 0, :] - corners[..., 2, :], -1, 0)) / 2 * (1 + 1e-12)
        found = np.maximum(shapely.distance(centres, self.body) - self.radius - half, 0.0)
        if self.is_boundary:
            found = np.where(shapely.contains(self.inside, centres), found, 0.0)
        near = (found <= 0) | (found < limit)
        boards = shapely.polygons(corners[near])
        exact = np.maximum(shapely.distance(boards, self.body) - self.radius, 0.0)
        if self.is_boundary:
            exact = np.where(shapely.contains_properly(self.inside, boards), exact, 0.0)
        found[near] = exact
        return found

    def depth(self, corners):
        """Returns the least translation that frees boards which overlap, by Minkowski sums; infinity if none."""
        centres = corners.mean(axis=-2)
        if self.radius:
            along, across = corners[..., 0, :] - corners[..., 3, :], corners[..., 0, :] - corners[..., 1, :]
            beyond = []
            for side in (along, across):
                length = np.hypot(*np.moveaxis(side, -1, 0))
                offset = np.abs(((self.points[0] - centres) * side).sum(axis=-1)) / length
                beyond.append(offset - 0.5 * length)
            beyond = np.array(beyond)
            outside = np.hypot(*np.maximum(beyond, 0.0))
            return self.radius - np.where((beyond <= 0).all(axis=0), beyond.max(axis=0), outside)
        board = corners - centres[..., None, :]
        sides = np.stack([self.points[:-1], self.points[1:]], axis=1)
        sums = sides[:, :, None, :] - centres[..., None, None, None, :] + board[..., None, None, :, :]
        hexagons = shapely.convex_hull(shapely.multipoints(sums.reshape(*sums.shape[:-3], 8, 2)))
        avoided = shapely.union_all(hexagons, axis=-1)
        moved = None if self.inside is None else self.inside_about(centres)
        here = shapely.points(0.0, 0.0)
        if self.is_boundary:
            free = shapely.difference(moved, avoided)
            found = shapely.distance(free, here)
            return np.where(shapely.is_empty(free), np.inf, found)
        if moved is not None:
            avoided = shapely.union(avoided, moved)
        return shapely.distance(shapely.boundary(avoided), here)

    def inside_about(self, centres):
        return shapely.polygons(self.points - centres[..., None, :])


def signed(obstacle, corners, limit=math.inf):
    """Returns signed distances minus the keep-out. Only some of many boards that overlap are measured, by chance; the
    others have no number."""
    found = obstacle.distances(corners, limit + obstacle.keep_out)
    deep = np.argwhere(found <= 0)
    most = 10**6 if obstacle.radius else MOST_DEPTHS
    found[found <= 0] = math.nan
    if len(deep) > most:
        deep = np.random.default_rng(1).permutation(deep)[:most]
    if len(deep):
        deep = tuple(deep.T)
        found[deep] = -obstacle.depth(corners[deep])
    return found - obstacle.keep_out


def ways(corners):
    """Returns bounds of the metres of any point of a board between one time and the next."""
    return 1.5 * np.hypot(*np.moveaxis(np.diff(corners, axis=1), -1, 0)).max(axis=-1) + 1e-13


def selected(benches, possible):
    """Returns the benches with a possible interval, the possible intervals by bench, and the possible intervals of any
    bench."""
    some = possible.any(axis=(1, 2))
    return benches[some], possible[some], possible.any(axis=0)


def of_possible(measured, corners, possible, shape):
    """Returns measures of boards by bench, interval and time: at the times of possible intervals, else infinity."""
    values = np.full((len(possible), *shape), math.inf)
    values[possible] = measured(corners.reshape(*values.shape, 4, 2)[possible])
    return values


def first_touch(show, obstacle, times, corners):
    """Returns the time of the first touch and the least clearance that was met, metres."""
    moved = ways(corners)[:, None, :]
    limit = moved.max(initial=0) + obstacle.keep_out
    clearance = obstacle.distances(corners, limit) - obstacle.keep_out
    if (clearance[:, 0] <= 0).any():
        return 0.0, 0.0
    rows, values = times[None, :], clearance[:, None, :]
    touch, least, benches = math.inf, clearance.min(), np.arange(len(show.links))
    while True:
        hits = rows[(values <= 0).any(axis=0)]
        touch = min(touch, hits.min(initial=math.inf))
        possible = (values[..., :-1] + values[..., 1:] <= moved) & (rows[:, :-1] < touch)
        benches, possible, near = selected(benches, possible)
        if not near.any() or (rows[:, 1] - rows[:, 0]).max() * show.speed < 1e-11:
            return touch, least
        shares = np.linspace(0.0, 1.0, PARTS + 1)
        first, last = rows[:, :-1][near][:, None], rows[:, 1:][near][:, None]
        order = np.argsort(first[:, 0])[:4000]
        rows = (first * (1 - shares) + last * shares)[order]
        rows[:, -1] = last[order, 0]
        corners = show.corners(rows.ravel(), benches)
        moved = ways(corners)
        limit = moved.max() + obstacle.keep_out
        measured = lambda boards: obstacle.distances(boards, limit) - obstacle.keep_out
        values = of_possible(measured, corners, possible[:, near][:, order], rows.shape)
        moved = np.concatenate([moved, moved[:, -1:]], axis=1).reshape(-1, *rows.shape)[..., :-1]
        least = min(least, values.min())


def least_below(show, obstacle, times, corners, than):
    """Returns the least clearance that the search meets, if it is less than `than`; what cannot be less is left out."""
    moved = ways(corners)[:, None, :]
    limit = than + moved.max(initial=0)
    rows, values = times[None, :], signed(obstacle, corners, limit)[:, None, :]
    least, benches = np.nanmin(values), np.arange(len(show.links))
    while len(times) > 1:
        least = min(least, np.nanmin(values))
        width = (rows[:, 1] - rows[:, 0]).max() * show.speed
        ends = np.fmin(values[..., :-1], values[..., 1:])
        both = values[..., :-1] + values[..., 1:]
        possible = both - moved < 2 * than
        if width < 1e-3:
            # Between two near times a clearance falls as a parabola does at most.
            apart = max(than + obstacle.keep_out, 1e-4)
            possible &= ends < than + (30.0 + 4.0 / apart) * width**2
        # A board that was not measured is possible where another is.
        possible |= np.isnan(both) & possible.any(axis=0)
        benches, possible, near = selected(benches, possible)
        if not near.any() or width < 1e-6:
            return least
        shares = np.linspace(0.0, 1.0, PARTS + 1)
        first, last = rows[:, :-1][near][:, None], rows[:, 1:][near][:, None]
        order = np.argsort(np.fmin.reduce(ends, axis=0)[near])[:2000]
        rows = (first * (1 - shares) + last * shares)[order]
        corners = show.corners(rows.ravel(), benches)
        moved = ways(corners)
        measured = lambda boards: signed(obstacle, boards, than + moved.max())
        values = of_possible(measured, corners, possible[:, near][:, order], rows.shape)
        moved = np.concatenate([moved, moved[:, -1:]], axis=1).reshape(-1, *rows.shape)[..., :-1]
    return least


def run(program, scene, *arguments):
    command = [program, "--scene", str(scene), "--quiet", "--json", *arguments]
    output = subprocess.run(command, capture_output=True, text=True, timeout=1800)
    assert output.returncode == 0, f"{command}: {output.stderr}"
    return [json.loads(line) for line in output.stdout.splitlines()]


def judge(program, file, counts, is_quiet=False):
    scene = tomllib.loads(file.read_text())
    show = Show(scene)
    events = run(program, file, "events")
    least = {line["obstacle"]: line for line in run(program, file, "check") if line["check"] == "obstacle"}
    met = {event["obstacle"]: event for event in events if event["event"] == "obstacle"}
    last = next(event for event in events if event["event"] in ("lock", "path_end"))
    end = last["time"]
    # At a lock a handle moves as the root of the time that is left.
    if last["event"] == "lock":
        end = end * (1 - 1e-9) - 1e-9
    else:
        ends = show.path.end / show.speed
        assert abs(end - ends) < TIME, f"the path ends at {ends} s, not {last}"
    step = 0.1 * min(show.links) / show.speed
    times = np.linspace(0.0, end, max(math.ceil(end / step), 1) + 1)
    corners = show.corners(times)
    given = scene["stage"].get("obstacles", [])
    obstacles = [(entry["name"], Obstacle(show, entry)) for entry in given]
    if boundary := scene["stage"].get("boundary"):
        obstacles.append(("boundary", Obstacle(show, boundary, True)))
    size = float(np.abs(show.origin).max())
    room = CLEARANCE + 8 * 2.3e-16 * size
    for number, (name, obstacle) in enumerate(obstacles):
        touch, event = met.get(name), first_touch(show, obstacle, times, corners)
        at = lambda time: obstacle.distances(show.corners(np.array([time])))[:, 0] - obstacle.keep_out
        if touch:
            assert touch["bench_b"] == scene["team"]["benches"] + 1 + number, touch
            there = at(touch["time"])
            if touch["time"] > 0:
                assert abs(there[touch["bench_a"]]) < room, f"{name}: {there} m at {touch}, by brute force {event}"
            grazes = abs(there[touch["bench_a"]]) < GRAZE and there.min() > -GRAZE
            if abs(event[0] - touch["time"]) > TIME * (1 + size / 1e4):
                # Before the program's time, nothing; at it, no more than a graze.
                assert event[0] > touch["time"] and grazes, f"{name}: by brute force {event}, not {touch}"
                counts["graze"] += 1
            counts["touch"] += 1
        else:
            assert event[0] == math.inf or event[0] > end - 1e-8, f"{name}: by brute force {event}, not none"
            counts["none"] += 1
        line = least[name]
        value, time, bench = line["clearance"], line["time"], line["bench"]
        if last["event"] == "lock" and time > end:
            counts["least at a lock"] += 1
            continue
        there = signed(obstacle, show.corners(np.array([time])))[:, 0]
        if value is None:
            assert there.min() == -math.inf, f"{name}: {there} m, not {line}"
            counts["not to be freed"] += 1
            continue
        # The least of the whole route, also where the show stops earlier.
        assert time <= end + TIME, f"{name}: {line} after {end} s"
        assert abs(there[bench] - value) < room, f"{name}: {there[bench]} m, not {line}"
        below = least_below(show, obstacle, times, corners, value - room)
        assert below >= value - room, f"{name}: {below} m by brute force, not {line}, until {end} s"
        counts["least below an overlap" if value < -obstacle.keep_out else "least"] += 1
        if not is_quiet:
            print(f"{name}: least {value:.9f} m of bench {bench}, met {touch and touch['time']}")


def main():
    program, what, *rest = sys.argv[1:]
    counts = collections.Counter()
    if what != "--random":
        judge(program, pathlib.Path(what), counts)
        return
    seed, count = map(int, rest[:2])
    families = rest[2:] or list(FAMILIES)
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(seed, seed + count):
            file = pathlib.Path(folder) / "scene.toml"
            family = families[number % len(families)]
            file.write_text(random_scene(family, number))
            try:
                judge(program, file, counts, True)
            except AssertionError as error:
                failed += 1
                print(f"{family} {number}: {error}", flush=True)
                if failed == 1:
                    print(file.read_text())
    print(f"{count} scenes: {dict(counts)}")
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
