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

from ground_scenes import FAMILIES, random_scene

# Metres and seconds: of a clearance, and of a time.
CLEARANCE, TIME = 1e-9, 2e-9
# A touch of less depth may be none, and a clearance of less a touch.
GRAZE = 1e-11
# Parts into which an interval is divided.
PARTS = 8
# Number of boards whose depth in a shape with corners is measured at once.
MOST_DEPTHS = 200


class Path:
    """A path by metres of travel; the head starts at 0, and the team stands behind, on a path without a beginning."""

    def __init__(self, scene, turn):
        path = scene["path"]
        self.begins, self.curves, self.turn = [], [], turn
        if path["kind"] == "pieces":
            heading = math.tau * path.get("heading_turns", 0.0)
            self.route(path["pieces"], heading)
        else:
            self.coil(path, scene["team"])

    def add(self, begin, curve):
        self.begins.append(begin)
        self.curves.append(curve)

    def line(self, begin, point, heading):
        unit = np.array([math.cos(heading), math.sin(heading)])
        self.add(begin, lambda s: point + (s - begin)[..., None] * unit)

    def arc(self, begin, point, heading, radius, left):
        """Returns the centre."""
        side = 1 if left else -1
        centre = point + side * radius * np.array([-math.sin(heading), math.cos(heading)])
        first = heading - side * math.pi / 2

        def curve(s):
            angle = first + side * (s - begin) / radius
            return centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

        self.add(begin, curve)
        return centre

    def route(self, pieces, heading):
        point, travelled = np.zeros(2), 0.0
        self.line(0.0, point, heading)
        self.begins[0] = -math.inf
        for piece in pieces:
            if piece["kind"] == "line":
                length = piece["length"]
                self.line(travelled, point, heading)
            else:
                radius, left = piece["radius"], piece["side"] == "left"
                length = piece["length"] if "length" in piece else radius * math.tau * piece["turns"]
                self.arc(travelled, point, heading, radius, left)
                heading += (1 if left else -1) * length / radius
            point = self.curves[-1](np.array(travelled + length))
            travelled += length
        self.end = travelled

    def coil(self, path, team):
        """A spiral to its centre, or a turnaround."""
        a = path["pitch"] / math.tau
        length = lambda theta: 0.5 * a * (theta * np.hypot(1.0, theta) + np.arcsinh(theta))

        def angle(metres):
            theta = np.sqrt(2.0 * np.maximum(metres, 0.0) / a)
            for _ in range(20):
                step = (length(theta) - metres) / (a * np.hypot(1.0, theta))
                theta = np.maximum(theta - step, 0.0)
                if (np.abs(step) <= 1e-15 * theta + 1e-300).all():
                    break
            return theta

        def spiral(sign, theta):
            return sign * (a * theta)[..., None] * np.stack([np.cos(theta), np.sin(theta)], axis=-1)

        if path["kind"] == "spiral":
            whole = float(length(math.tau * path["start_turn"]))
            self.add(-math.inf, lambda s: spiral(1.0, angle(whole - s)))
            self.end = whole
            return
        radius, ratio = path["turn_radius"], path["arc_ratio"]
        inner = radius / a
        lead = path["lead_in"] if "lead_in" in path else float(length(math.tau * path["start_turn"]) - length(inner))
        whole = lead + float(length(inner))
        self.add(-math.inf, lambda s: spiral(1.0, angle(whole - s)))
        radii = np.array([ratio, 1.0]) * math.hypot(radius, a) / (ratio + 1.0)
        turned = 2.0 * math.atan(radius / a)
        point = spiral(1.0, np.array(inner))
        # The tangent of the inward spiral.
        heading = inner + math.atan(inner) + math.pi
        begin = lead
        for r, left in zip(radii, (False, True)):
            self.arc(begin, point, heading, r, left)
            heading += (1 if left else -1) * turned
            begin += r * turned
            point = self.curves[-1](np.array(begin))
        assert np.hypot(*(point + spiral(1.0, np.array(inner)))) < 1e-12 * (radius + 1)
        out = float(length(inner)) - begin
        self.add(begin, lambda s: spiral(-1.0, angle(out + s)))
        boards = team["head_length"] + (team["benches"] - 1) * team["body_length"]
        self.end = begin + path.get("lead_out", boards - team["benches"] * 2 * team["hole_inset"])

    def points(self, s):
        """Returns the points, turned as the placement turns them."""
        which = np.searchsorted(np.array(self.begins), s, side="right") - 1
        points = np.empty((*s.shape, 2))
        for number, curve in enumerate(self.curves):
            here = which == number
            if here.any():
                points[here] = curve(s[here])
        return points @ self.turn.T

    def follower(self, s, link):
        """Returns the first places behind `s` at the distance of a link."""
        front, step = self.points(s), link / 64

        def distance(back, at=slice(None)):
            return np.hypot(*np.moveaxis(self.points(s[at] - back) - front[at], -1, 0)) - link

        # A chord is no longer than its path.
        near = np.full(s.shape, link * (1 - 1e-13))
        far = near + step
        low, high = np.full(s.shape, -1e-13 * link), distance(far)
        before = low.copy()
        for _ in range(64 * 200):
            # Near a lock the distance exceeds the link on a short way only.
            peaks = np.flatnonzero((high < 0) & (low >= before) & (low >= high))
            if len(peaks):
                at, most = greatest(lambda back: distance(back, peaks), near[peaks] - step, far[peaks])
                above = most >= 0
                peaks = peaks[above]
                near[peaks], low[peaks] = near[peaks] - step, before[peaks]
                far[peaks], high[peaks] = at[above], most[above]
            open_ = np.flatnonzero(high < 0)
            if not len(open_):
                break
            before[open_], near[open_], low[open_] = low[open_], far[open_], high[open_]
            far[open_] += step
            high[open_] = distance(far[open_], open_)
        assert not len(open_), "a link has no follower"
        # Secants, and halves where they do not converge.
        last, at, ends = (near, low), (far, high), (near.copy(), far.copy())
        # The rounding of places, far from the start too.
        exact = 1e-14 * (link + np.abs(s) + np.abs(front).max(axis=-1))
        for turn in range(120):
            slope = at[1] - last[1]
            guess = at[0] - at[1] * (at[0] - last[0]) / np.where(slope == 0, np.inf, slope)
            inside = (guess >= ends[0]) & (guess <= ends[1])
            guess = np.where(inside & (turn < 12), guess, 0.5 * (ends[0] + ends[1]))
            value = distance(guess)
            below = value < 0
            ends = np.where(below, guess, ends[0]), np.where(below, ends[1], guess)
            last, at = at, (guess, value)
            if turn > 2 and (np.abs(value) <= exact).all() and turn < 12 or turn > 70:
                break
        return s - guess


def greatest(function, low, high):
    """Returns places between `low` and `high` where functions with one maximum are not negative, and the values; without
    such places, negative values. A function grows by at most 1 per unit of its argument."""
    share = 0.5 * (math.sqrt(5) - 1)
    inner = [high - share * (high - low), low + share * (high - low)]
    values = [function(place) for place in inner]
    # Near a maximum a function is flat: the last brackets are 1e-8 of the first.
    for _ in range(38):
        most = np.maximum(*values)
        if ((most >= 0) | (most + high - low < 0)).all():
            break
        right = values[0] < values[1]
        low, high = np.where(right, inner[0], low), np.where(right, high, inner[1])
        kept = np.where(right, inner[1], inner[0]), np.where(right, values[1], values[0])
        place = np.where(right, low + share * (high - low), high - share * (high - low))
        value = function(place)
        inner = [np.where(right, kept[0], place), np.where(right, place, kept[0])]
        values = [np.where(right, kept[1], value), np.where(right, value, kept[1])]
    return np.where(values[0] > values[1], *inner), np.maximum(*values)


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
