"""Checks the claims of certificates with the ball arithmetic of Arb. The script shares no code with the program.

    second_judge.py [--places N] [--seed S] CERTIFICATE...

The checks are by question:

- Events: each event at both ends of its enclosure, first touches of obstacles among them. At N random times of the
  stretches that are claimed to be clear, or to move forward: all boards, links and obstacles.
- The least clearance: all boards at N random times and at N times near the least, and the two nearest.
- The greatest speed: the speeds of all handles at N random times, and the fastest.
- The least pitch: N random pitches that are claimed to end with an overlap or a lock. Also N places of the head with
  the pitch that is free.

In N random steps of each certificate, the spans contain the handles, and boards are as far apart as claimed. For
several dragons the script checks each alone, and each two on the stage at times of the show. Path and chain are built
as docs/proofs.md defines them. A follower is enclosed in numbers of 192 bits. It is the first point backward along the
path at the distance of the link, or the one that continues it. The script moves each link along the path in small steps
of its own (`Walk`), and takes no branch of a certificate on trust.

Prints a JSON object for each file. Its `refused` and `undecided` are a sentence or null. The numbers of what was
checked follow, with the random places that were undecided.
"""

import argparse
import bisect
import copy
import json
import math
import random
import sys
import tomllib
from itertools import combinations
from pathlib import Path

from flint import acb, arb, ctx

ctx.prec = 192
PI = arb.pi()
EVENTS = ("contact", "stall", "lock", "path_end")
# Lines of the certificates of each question, beside the first: any other line is refused.
LINES = {
    "events": ("branch", "step", "result", "reached", *EVENTS),
    "least_clearance": (
        "branch", "step", "near", "near_obstacle", "contact", "path_end", "least_clearance", "obstacle_clearance"
    ),
    "greatest_speed": ("branch", "speeds", "fast", "greatest_speed"),
    "least_pitch": ("reach", "overlap", "head_locks", "far", "step", "least_pitch"),
}
# The same lines for two of several dragons.
LINES_OF_TWO = {
    "events": ("both", "meeting", "result"),
    "least_clearance": ("both", "near_both", "meeting", "least_clearance"),
}
# The most points of the path that are looked at for one follower.
MOST_POINTS = 3000
# Points of the path in the length of a link, for the walk of a link, and the most of them that a follower may pass while
# its front passes one. A follower that passes more has vanished.
POINTS_IN_LINK = 400
MOST_PASSED = 60


class Refused(Exception):
    """A claim is false, or the file is no certificate."""


class Undecided(Exception):
    """The arithmetic did not decide."""


def require(condition, sentence):
    if not condition:
        raise Refused(sentence)


def hull(a, b):
    return a.union(b)


def sub(p, q):
    return p[0] - q[0], p[1] - q[1]


def dot(p, q):
    return p[0] * q[0] + p[1] * q[1]


def cross(p, q):
    return p[0] * q[1] - p[1] * q[0]


class Segment:
    """A curve of the path: its coordinate runs from `begin` to `end`, which are None where it has no end. `sense` is 1
    if the coordinate grows along the path, else -1."""

    begin = end = None
    sense = 1

    def back(self, c, metres):
        """Returns a coordinate at most some metres further back."""
        return (c - self.sense * (metres / self.scale(c)) * (1 - arb(2) ** -40)).mid()


class Line(Segment):
    def __init__(self, origin, direction, begin, end):
        self.origin, self.direction, self.begin, self.end = origin, direction, begin, end

    def point(self, c):
        return self.origin[0] + c * self.direction[0], self.origin[1] + c * self.direction[1]

    def tangent(self, _):
        return self.direction

    def scale(self, _):
        return arb(1)

    def metres(self, c):
        return c


class Arc(Segment):
    def __init__(self, origin, direction, radius, left, angle):
        self.origin, self.direction, self.radius, self.begin, self.end = origin, direction, radius, arb(0), angle
        side = 1 if left else -1
        self.normal = (-direction[1] * side, direction[0] * side)

    def point(self, c):
        sin, cos = c.sin_cos()
        d, n, r = self.direction, self.normal, self.radius
        return tuple(self.origin[i] + r * (sin * d[i] + (1 - cos) * n[i]) for i in (0, 1))

    def tangent(self, c):
        sin, cos = c.sin_cos()
        return tuple(cos * self.direction[i] + sin * self.normal[i] for i in (0, 1))

    def scale(self, _):
        return self.radius

    def metres(self, c):
        return self.radius * c


class Spiral(Segment):
    """r = a theta; inward with the angle falling, or outward with the angle growing, turned by half a turn."""

    def __init__(self, a, inward, begin, end):
        self.a, self.begin, self.end = a, begin, end
        self.sense = -1 if inward else 1

    def point(self, c):
        sin, cos = c.sin_cos()
        r = -self.sense * self.a * c
        return r * cos, r * sin

    def tangent(self, c):
        sin, cos = c.sin_cos()
        w = (1 + c * c).sqrt()
        return -(cos - c * sin) / w, -(sin + c * cos) / w

    def scale(self, c):
        return self.a * (1 + c * c).sqrt()

    def metres(self, c):
        """Metres along the path from the centre, negative where the path comes in."""
        return self.sense * self.a * (c * (1 + c * c).sqrt() + c.asinh()) / 2

    def back(self, c, metres):
        if self.sense > 0:
            return super().back(c, metres)
        # Further out a radian is longer.
        return super().back(c, metres * self.scale(c) / self.scale(c + metres / self.scale(c)))


class PlacedSpiral(Spiral):
    """A spiral about any centre from a point in a direction, its centre on one side. Complex numbers in place of
    vectors: along it, the tangent is the unit vector from the centre times (sense + i side theta) / sqrt(1 + theta^2)."""

    def __init__(self, a, inward, begin, end, point, direction, left):
        super().__init__(a, inward, begin, end)
        self.side = 1 if left else -1
        self.outward = acb(*direction) / self.along(begin)
        self.centre = acb(*point) - a * begin * self.outward

    def along(self, c):
        return acb(self.sense, self.side * c) / (1 + c * c).sqrt()

    def spoke(self, c):
        sin, cos = (self.side * self.sense * (c - self.begin)).sin_cos()
        return self.outward * acb(cos, sin)

    def point(self, c):
        point = self.centre + self.a * c * self.spoke(c)
        return point.real, point.imag

    def tangent(self, c):
        tangent = self.spoke(c) * self.along(c)
        return tangent.real, tangent.imag


# Sizes that a scene may leave out, metres.
SIZES = {"head_length": 3.41, "body_length": 2.2, "width": 0.3, "hole_inset": 0.275}


class Walk:
    """A link that moves along the path by small steps, in doubles: the follower of each point of the path is between two
    neighbouring points, and moves on from there."""

    def __init__(self, scene, link):
        self.link, self.places, self.points, self.travels = link, [], [], []
        length = float(scene.length.mid())
        # A follower is pushed back by no more than its front has gone.
        start, travelled = scene.segments[0].end, 0.0
        while travelled > -length - 4 * link:
            start = scene.segments[0].back(start, arb(link))
            travelled = float((scene.segments[0].metres(start) - scene.segments[0].metres(scene.segments[0].end)).mid())
        for number, curve in enumerate(scene.segments):
            c = begin = start if number == 0 else curve.begin
            while True:
                is_last = curve.end is not None and not (curve.end - c) * curve.sense > 0
                c = curve.end if is_last else c
                metres = float((curve.metres(c) - curve.metres(begin)).mid())
                self.places.append((number, c))
                self.points.append(tuple(float(part.mid()) for part in curve.point(c)))
                self.travels.append(travelled + metres)
                if is_last or self.travels[-1] > length + link:
                    break
                c = (c + curve.sense * link / POINTS_IN_LINK / curve.scale(c)).mid()
            travelled = self.travels[-1]
        self.begin = next(k for k, place in enumerate(self.places) if place[0] == 1)
        self.rears = self.walk()

    def far(self, k, m):
        (x, y), (u, v) = self.points[k], self.points[m]
        return math.hypot(x - u, y - v) >= self.link

    def walk(self):
        """Returns for each point from the second segment on the last point behind the follower; None once it has
        vanished."""
        rear, rears = self.begin, []
        while not self.far(self.begin, rear):
            rear -= 1
        for k in range(self.begin, len(self.points)):
            passed = 0
            while passed < MOST_PASSED and rear > 0 and not self.far(k, rear):
                rear, passed = rear - 1, passed + 1
            while passed < MOST_PASSED and rear + 1 < k and self.far(k, rear + 1):
                rear, passed = rear + 1, passed + 1
            if passed >= MOST_PASSED or rear <= 0:
                break
            rears.append(rear)
        return rears

    def ahead(self, scene, place):
        """Returns a place ahead of the follower from which it is the first one back: `place` itself unless a nearer
        place is at the distance."""
        number, c = place
        if number == 0:
            return place
        curve = scene.segments[number]
        first = next(k for k in range(self.begin, len(self.places)) if self.places[k][0] == number)
        at = self.travels[first] + float((curve.metres(c) - curve.metres(self.places[first][1])).mid())
        k = max(bisect.bisect_right(self.travels, at) - 1, self.begin)
        if k - self.begin > len(self.rears) + 1:
            raise Undecided("a follower past its lock")
        rear = self.rears[min(k - self.begin, len(self.rears) - 1)]
        # From the place itself: between two points of the walk a nearer place may come, and the follower vanish.
        x, y = (float(part.mid()) for part in scene.point(place))
        if not any(math.hypot(x - u, y - v) >= self.link for u, v in self.points[rear + 1 : k]):
            return place
        # Points that the follower has passed since the point of the walk are no nearer places: then there is no valley.
        valley = self.valley(scene, place, rear)
        gap = sub(scene.point(place), scene.point(valley))
        return valley if dot(gap, gap) < arb(self.link) ** 2 else place

    def valley(self, scene, place, rear):
        """Returns the place of least distance from the front handle that comes next ahead of a point."""
        point = scene.point(place)

        def distance(place):
            gap = sub(point, scene.point(place))
            return dot(gap, gap).mid()

        while rear + 2 < len(self.places) and distance(self.places[rear + 1]) < distance(self.places[rear]):
            rear += 1
        # Between the neighbours of the nearest point, on its segment.
        number, c = self.places[rear]
        ends = [end[1] for end in self.places[rear - 1 : rear + 2] if end[0] == number]
        low, high = ends[0].mid(), ends[-1].mid()
        for _ in range(120):
            left, right = ((2 * low + high) / 3).mid(), ((low + 2 * high) / 3).mid()
            if distance((number, left)) < distance((number, right)):
                high = right
            else:
                low = left
        return number, low


class Scene:
    def __init__(self, file):
        team, path, motion = SIZES | file["team"], file["path"], file["motion"]
        number = lambda table, key: arb(float(table[key]))
        self.benches = team["benches"]
        team = {"head_width": team["width"], "tail_width": team["width"], "tail_length": team["body_length"]} | team
        self.inset = number(team, "hole_inset")
        by_bench = lambda key: [number(team, key.format(part)) for part in ("head_", "", "tail_")]
        of_each = lambda head, body, tail: ([head] + [body] * (self.benches - 2) + [tail])[: self.benches]
        lengths = [number(team, key) - 2 * self.inset for key in ("head_length", "body_length", "tail_length")]
        self.links, self.widths = of_each(*lengths), of_each(*by_bench("{}width"))
        self.walks = {}
        self.speed = number(motion, "head_speed")
        self.delay, self.placement = arb(float(file.get("delay", 0.0))), Placement(file.get("placement", {}))
        self.obstacles = obstacles(file.get("stage", {}), self.placement)
        # Sets the segments, the head's place at the start, and the metres from there to the path's end.
        getattr(self, path["kind"])(path, number)

    def on_spiral(self, pitch):
        """Returns the team on the inward spiral of a pitch, with no end but the centre."""
        other = copy.copy(self)
        other.segments, other.start = [Spiral(pitch / (2 * PI), True, None, arb(0))], None
        other.walks = {}
        return other

    def spiral(self, path, number):
        spiral = Spiral(number(path, "pitch") / (2 * PI), True, None, arb(0))
        self.segments, self.start = [spiral], (0, 2 * PI * number(path, "start_turn"))
        self.length = -spiral.metres(self.start[1])

    def turnaround(self, path, number):
        a = number(path, "pitch") / (2 * PI)
        theta = number(path, "turn_radius") / a
        inward, outward = Spiral(a, True, None, theta), Spiral(a, False, theta, None)
        radii = (a * a + number(path, "turn_radius") ** 2).sqrt()
        ratio = number(path, "arc_ratio")
        turn = 2 * theta.atan()
        first = Arc(inward.point(theta), inward.tangent(theta), radii * ratio / (ratio + 1), False, turn)
        second = Arc(first.point(turn), first.tangent(turn), radii / (ratio + 1), True, turn)
        self.segments = [inward, first, second, outward]
        if "lead_in" in path:
            lead_in = number(path, "lead_in")
            self.start = (0, self.inverse(inward, inward.metres(theta) - lead_in))
        else:
            self.start = (0, 2 * PI * number(path, "start_turn"))
            lead_in = inward.metres(theta) - inward.metres(self.start[1])
        lead_out = number(path, "lead_out") if "lead_out" in path else sum(self.links, arb(0))
        self.length = lead_in + (first.radius + second.radius) * turn + lead_out

    def pieces(self, path, number):
        point = tuple(arb(float(c)) for c in path.get("start", [0.0, 0.0]))
        turns = 2 * PI * arb(float(path.get("heading_turns", 0.0)))
        direction = (turns.cos(), turns.sin())
        self.segments, self.start, self.length = [Line(point, direction, None, arb(0))], (0, arb(0)), arb(0)
        turned = None
        for piece in path["pieces"]:
            before = self.segments[-1]
            if piece["kind"] == "line":
                added = [Line(point, direction, arb(0), number(piece, "length"))]
            elif piece["kind"] == "spiral":
                added = [self.piece_of_spiral(piece, number, point, direction, turned)]
            elif piece["kind"] == "turn":
                added = self.turn(before, arb(float(piece.get("arc_ratio", 2.0))), point, direction)
            else:
                radius = number(piece, "radius")
                angle = 2 * PI * number(piece, "turns") if "turns" in piece else number(piece, "length") / radius
                added = [Arc(point, direction, radius, piece["side"] == "left", angle)]
            turned = before if piece["kind"] == "turn" else None
            for segment in added:
                self.length += segment.metres(segment.end) - segment.metres(segment.begin)
            point, direction = added[-1].point(added[-1].end), added[-1].tangent(added[-1].end)
            self.segments += added

    def piece_of_spiral(self, piece, number, point, direction, turned):
        """Returns the spiral of a piece, or after a turn the outward spiral about the centre of the spiral `turned`."""
        if turned is None:
            a, inward, left = number(piece, "pitch") / (2 * PI), piece["direction"] == "in", piece["side"] == "left"
            begin = number(piece, "radius") / a
        else:
            a, inward, left, begin = turned.a, False, turned.side < 0, turned.end
        spiral = PlacedSpiral(a, inward, begin, None, point, direction, left)
        if "turns" in piece:
            spiral.end = begin + spiral.sense * 2 * PI * number(piece, "turns")
        elif "to_radius" in piece:
            spiral.end = number(piece, "to_radius") / a
        else:
            spiral.end = self.inverse(spiral, spiral.metres(begin) + number(piece, "length"))
        return spiral

    @staticmethod
    def turn(spiral, ratio, point, direction):
        """Returns the two arcs from the end of an inward spiral to the point opposite its centre: their angles are
        alike, and their chords lie on the line through the centre."""
        angle = 2 * spiral.end.atan()
        both = spiral.a * (1 + spiral.end**2).sqrt()
        left = spiral.side > 0
        first = Arc(point, direction, both * ratio / (ratio + 1), left, angle)
        middle = first.point(angle), first.tangent(angle)
        return [first, Arc(*middle, both / (ratio + 1), not left, angle)]

    @staticmethod
    def inverse(curve, metres):
        """Returns the coordinate at these metres of a spiral."""
        c = arb(math.sqrt(abs(2 * float(metres.mid()) / float(curve.a.mid()))))
        for _ in range(60):
            c = (c - (curve.metres(c) - metres) / (curve.sense * curve.scale(c))).mid()
        around = c + arb(0, 1e-30) * (1 + c)
        found = c - (curve.metres(c) - metres) / (curve.sense * curve.scale(around))
        if not around.contains(found):
            raise Undecided("metres of a spiral")
        return found

    def end(self):
        """Returns the time at which the head is at the path's end, seconds."""
        return self.length / self.speed + self.delay

    def time_at(self, place):
        """Returns the time at which the head is at a place, seconds."""
        return self.travelled(place) / self.speed + self.delay

    def place(self, time, stands=False):
        """Returns the place of the head at a time, seconds. If it `stands`, it does so at the path's end afterwards."""
        left = (arb(time) - self.delay) * self.speed
        if not left > 0:
            return self.start
        if stands and not left < self.length:
            left = self.length
        for number, curve in enumerate(self.segments):
            begin = self.start[1] if number == 0 else curve.begin
            last = number == len(self.segments) - 1
            length = None if last or curve.end is None else curve.metres(curve.end) - curve.metres(begin)
            if length is None or left < length:
                at = curve.metres(begin) + left
                if isinstance(curve, Spiral):
                    return number, self.inverse(curve, at)
                return number, at / curve.scale(begin)
            if not left > length:
                raise Undecided("a place beside a junction")
            left -= length
        raise Refused("the place is beyond the path")

    def travelled(self, place):
        """Returns the metres of path from the start to a place."""
        so_far, begin = arb(0), self.start[1]
        for number in range(place[0]):
            curve = self.segments[number]
            so_far += curve.metres(curve.end) - curve.metres(begin)
            begin = self.segments[number + 1].begin
        curve = self.segments[place[0]]
        return so_far + curve.metres(place[1]) - curve.metres(begin)

    def point(self, place):
        return self.segments[place[0]].point(place[1])

    def tangent(self, place):
        return self.segments[place[0]].tangent(place[1])

    def not_after(self, a, b):
        """Returns true if place a is certainly not further along the path than b."""
        if a[0] != b[0]:
            return a[0] < b[0]
        return bool(a[1] <= b[1] if self.segments[a[0]].sense > 0 else a[1] >= b[1])

    def products(self, front, rear):
        """Returns the products of the tangents at the front and the rear handle with the link."""
        link = sub(self.point(front), self.point(rear))
        return dot(self.tangent(front), link), dot(self.tangent(rear), link)

    def follower(self, front, link):
        """Returns the follower of a link, enclosed."""
        point, square = self.point(front), link * link
        number, c = front
        if len(self.segments) > 1:
            length = float(link)
            if length not in self.walks:
                self.walks[length] = Walk(self, length)
            number, c = self.walks[length].ahead(self, front)
        step = link
        for _ in range(MOST_POINTS):
            curve = self.segments[number]
            if curve.begin is not None and not c * curve.sense > curve.begin * curve.sense:
                number, c = number - 1, self.segments[number - 1].end
                continue
            gap = sub(point, curve.point(c))
            room = arb((link - dot(gap, gap).nonnegative_part().sqrt()).lower())
            if not room > 0:
                raise Undecided("a follower")
            # From a distance of less than the link one can go back the rest without reaching it.
            step = max(room, step, key=lambda metres: float(metres)) if float(room) < 0.2 * float(link) else room
            if float(room) < 0.2 * float(link):
                found = self.enclosed(number, c, point, link, square, room)
                if found is not None:
                    return number, found
            while True:
                to = curve.back(c, step)
                if curve.begin is not None and to * curve.sense < curve.begin * curve.sense:
                    to = curve.begin
                if not step > room or self.is_nearer(curve, c, to, point, square):
                    break
                step = max(step / 2, room, key=lambda metres: float(metres))
            c, step = to, 2 * step
        raise Undecided("a follower")

    def is_nearer(self, curve, c, to, point, square, sign=1):
        """Returns true if a stretch is certainly nearer than the link (further, with sign -1), by the mean value
        theorem."""
        both, middle = hull(c, to), ((c + to) / 2).mid()
        gap, wide = sub(point, curve.point(middle)), sub(point, curve.point(both))
        slope = 2 * dot(wide, curve.tangent(both)) * curve.scale(both)
        return bool(sign * (dot(gap, gap) + slope * (both - middle) - square) < 0)

    def enclosed(self, number, c, point, link, square, room):
        """Returns the follower if it is close behind, where the distance grows from less than the link to more."""
        curve = self.segments[number]
        gap = sub(point, curve.point(c))
        lean = dot(gap, curve.tangent(c)) / link
        if not lean > 0:
            return None
        behind = curve.back(c, arb((room / lean * arb(1.5)).upper()))
        if curve.begin is not None and behind * curve.sense < curve.begin * curve.sense:
            behind = curve.begin
        gap = sub(point, curve.point(behind))
        if not dot(gap, gap) > square:
            return None
        around = hull(c, behind)
        for _ in range(12):
            middle = around.mid()
            gap, wide = sub(point, curve.point(middle)), sub(point, curve.point(around))
            slope = -2 * curve.sense * dot(wide, curve.tangent(around)) * curve.scale(around)
            if not slope * curve.sense < 0:
                return None
            newton = middle - (dot(gap, gap) - square) / slope
            if not newton.overlaps(around):
                raise Undecided("a follower that is none")
            narrower = newton.intersection(around)
            if narrower.rad() * 2 > around.rad():
                return narrower
            around = narrower
        return around

    def chain(self, head, handles):
        """Returns the places of the first handles."""
        places = [head]
        for link in self.links[: handles - 1]:
            places.append(self.follower(places[-1], link))
        return places

    def corners(self, front, rear, bench):
        """Returns the corners of a board, counter-clockwise."""
        along = tuple(part / self.links[bench] for part in sub(front, rear))
        across = (-along[1], along[0])
        half = self.widths[bench] / 2
        corner = lambda p, i, j: tuple(p[k] + i * self.inset * along[k] + j * half * across[k] for k in (0, 1))
        return [corner(front, 1, -1), corner(front, 1, 1), corner(rear, -1, 1), corner(rear, -1, -1)]

    def boards(self, places):
        points = [self.point(place) for place in places]
        return [self.corners(points[i], points[i + 1], i) for i in range(len(points) - 1)]

    def boards_on_stage(self, places):
        """Returns the boards on the stage, their corners counter-clockwise there."""
        placed = [[self.placement.placed(corner) for corner in board] for board in self.boards(places)]
        return [board[::-1] for board in placed] if self.placement.mirror < 0 else placed


class Placement:
    """The place of the path's own coordinates on the stage: mirrored, then turned, then moved."""

    def __init__(self, table):
        self.origin = [arb(float(c)) for c in table.get("origin", [0.0, 0.0])]
        turn = 2 * PI * arb(float(table.get("rotation_turns", 0.0)))
        self.sin, self.cos = turn.sin(), turn.cos()
        self.mirror = -1 if table.get("mirror", False) else 1

    def placed(self, point):
        x, y = point[0], self.mirror * point[1]
        return x * self.cos - y * self.sin + self.origin[0], x * self.sin + y * self.cos + self.origin[1]

    def own(self, point):
        x, y = (arb(float(point[k])) - self.origin[k] for k in (0, 1))
        return x * self.cos + y * self.sin, (y * self.cos - x * self.sin) * self.mirror


def gap_of_sides(a, b):
    """Returns the greatest gap between two boards along the normals of their sides, enclosed."""
    best = None
    for board, other in ((a, b), (b, a)):
        for i in range(4):
            side = sub(board[(i + 1) % 4], board[i])
            normal = (side[1], -side[0])
            reach = dot(normal, board[i])
            gap = least([dot(normal, corner) - reach for corner in other]) / dot(side, side).sqrt()
            best = gap if best is None else best.max(gap)
    return best


def least(numbers):
    smallest = numbers[0]
    for number in numbers[1:]:
        smallest = smallest.min(number)
    return smallest


def clearance(a, b):
    """Returns the distance of two boards, or minus the least translation that separates them, enclosed."""
    gap = gap_of_sides(a, b)
    if not gap > 0:
        return gap
    distances = []
    for one, other in ((a, b), (b, a)):
        for corner in one:
            for i in range(4):
                side, to = sub(other[(i + 1) % 4], other[i]), sub(corner, other[i])
                share = (dot(to, side) / dot(side, side)).max(arb(0)).min(arb(1))
                rest = tuple(to[k] - share * side[k] for k in (0, 1))
                distances.append(dot(rest, rest).nonnegative_part().sqrt())
    return least(distances)


def is_inside(point, board):
    return all(cross(sub(board[(i + 1) % 4], board[i]), sub(point, board[i])) > 0 for i in range(4))


def overlap(a, b):
    """Returns true if a point is certainly in both boards: the middle of the overlap of their middles."""
    polygon = [tuple(part.mid() for part in corner) for corner in a]
    for i in range(4):
        start = tuple(part.mid() for part in b[i])
        side = sub(tuple(part.mid() for part in b[(i + 1) % 4]), start)
        cut = []
        for at, point in enumerate(polygon):
            before = polygon[at - 1]
            here, there = cross(side, sub(point, start)), cross(side, sub(before, start))
            if (here > 0) != (there > 0):
                share = there / (there - here)
                cut.append(tuple((before[k] + share * (point[k] - before[k])).mid() for k in (0, 1)))
            if here > 0:
                cut.append(point)
        polygon = cut
    if not polygon:
        return False
    middle = tuple(sum((point[k] for point in polygon), arb(0)) / len(polygon) for k in (0, 1))
    return is_inside(middle, a) and is_inside(middle, b)


def circles(boards):
    """Returns the middles and the radii of the circumscribed circles."""
    middles = [tuple(float(sum((corner[k] for corner in board), arb(0)).mid()) / 4 for k in (0, 1)) for board in boards]
    radii = [float(sum((part * part for part in sub(board[0], board[2])), arb(0)).sqrt().mid()) / 2 for board in boards]
    return list(zip(middles, radii))


def are_near(one, other, distance):
    return math.dist(one[0], other[0]) <= (one[1] + other[1]) * (1 + 1e-9) + 1e-9 + distance


def pairs(boards, distance=0.0):
    """Returns the pairs that share no handle, but for those whose circumscribed circles are further apart."""
    about = circles(boards)
    for i in range(len(boards)):
        for j in range(i + 2, len(boards)):
            if are_near(about[i], about[j], distance):
                yield i, j


def pairs_of_two(boards, others, distance=0.0):
    """Returns the pairs of a board of each of two dragons, but for those whose circumscribed circles are further apart."""
    about, of_others = circles(boards), circles(others)
    return [(i, j) for i, one in enumerate(about) for j, other in enumerate(of_others) if are_near(one, other, distance)]


class Obstacle:
    """A shape in the path's coordinates: its points, its sides, and the distance that boards keep."""

    def __init__(self, kind, points, distance):
        self.kind, self.points, self.distance = kind, points, distance
        closed = kind in ("polygon", "boundary")
        self.sides = [] if kind == "circle" else list(zip(points, points[1:] + points[:1] if closed else points[1:]))

    def is_inside(self, point):
        """Returns true if a point is inside the polygon: its crossings with a ray along x, counted."""
        inside = False
        for one, other in self.sides:
            heights = (one[1] - point[1], other[1] - point[1])
            require_decided(all(height > 0 or height < 0 for height in heights))
            if (heights[0] > 0) != (heights[1] > 0):
                left = cross(sub(other, one), sub(point, one)) * (1 if heights[1] > 0 else -1)
                require_decided(left > 0 or left < 0)
                inside ^= bool(left > 0)
        return inside

    def is_avoided(self, board):
        """Returns true if a board is certainly further away than the distance, and on the right side."""
        if self.kind == "circle":
            return is_far(board, [self.points[0]], self.distance)
        if not all(is_far(board, list(side), self.distance) for side in self.sides):
            return False
        return self.kind == "line" or self.is_inside(board[0]) == (self.kind == "boundary")

    def is_reached(self, board):
        """Returns true if a board is certainly no further away than the distance, or on the wrong side."""
        for shape in [[self.points[0]]] if self.kind == "circle" else map(list, self.sides):
            if distance_of_corners(board, shape) <= self.distance or is_crossed(board, shape):
                return True
        if self.kind in ("polygon", "boundary"):
            return any(self.is_inside(corner) == (self.kind == "polygon") for corner in board)
        return is_inside(self.points[0], board)


def obstacles(stage, placement):
    """Returns the obstacles of a stage in the path's coordinates, the boundary last."""
    own, found = placement.own, []
    for shape in stage.get("obstacles", []):
        keep_out = arb(float(shape.get("keep_out", 0.0)))
        if "circle" in shape:
            circle = shape["circle"]
            found.append(Obstacle("circle", [own(circle["center"])], keep_out + arb(float(circle["radius"]))))
        else:
            kind = "polygon" if "polygon" in shape else "line"
            found.append(Obstacle(kind, [own(point) for point in shape[kind]], keep_out))
    if "boundary" in stage:
        keep_out = arb(float(stage["boundary"].get("keep_out", 0.0)))
        found.append(Obstacle("boundary", [own(point) for point in stage["boundary"]["polygon"]], keep_out))
    return found


def require_decided(condition):
    if not condition:
        raise Undecided("the side of a point")


def distance_to(point, one, other):
    """Returns the distance of a point from a side, enclosed."""
    side, to = sub(other, one), sub(point, one)
    square = dot(side, side)
    share = (dot(to, side) / square).max(arb(0)).min(arb(1)) if square > 0 else arb(0)
    rest = tuple(to[k] - share * side[k] for k in (0, 1))
    return dot(rest, rest).nonnegative_part().sqrt()


def distance_of_corners(board, shape):
    """Returns the least distance of the corners of each from the sides of the other: a point, or a side."""
    sides = list(zip(board, board[1:] + board[:1]))
    distances = [distance_to(point, *side) for point in shape for side in sides]
    return least(distances + [distance_to(corner, shape[0], shape[-1]) for corner in board])


def is_far(board, shape, distance):
    """Returns true if a point or a side is certainly further from a board than a distance."""
    normals = [sub(board[1], board[0]), sub(board[2], board[1])]
    if len(shape) == 2:
        side = sub(shape[1], shape[0])
        normals.append((side[1], -side[0]))
    for normal in normals:
        ours, theirs = ([dot(normal, point) for point in points] for points in (board, shape))
        if all(a < b for a in ours for b in theirs) or all(a > b for a in ours for b in theirs):
            return bool(distance_of_corners(board, shape) > distance)
    return False


def is_crossed(board, shape):
    """Returns true if a side certainly crosses a side of a board."""
    if len(shape) == 1:
        return False
    sides = zip(board, board[1:] + board[:1])
    apart = lambda a, b, p, q: cross(sub(b, a), sub(p, a)) * cross(sub(b, a), sub(q, a)) < 0
    return any(apart(*shape, one, other) and apart(one, other, *shape) for one, other in sides)


class Judge:
    def __init__(self, scene, seed):
        self.scene, self.random = scene, random.Random(seed)
        names = ("places", "undecided", "spans", "events", "pairs", "clearances", "speeds", "pitches", "obstacles")
        self.counts = dict.fromkeys(names, 0)

    def check_apart(self, time, boards):
        for i, j in pairs(boards):
            self.counts["pairs"] += 1
            require(gap_of_sides(boards[i], boards[j]) > 0, f"benches {i} and {j} are not apart at t = {time} s")

    def at(self, time):
        """Returns the places of all handles at a time."""
        return self.scene.chain(self.scene.place(time), self.scene.benches + 1)

    def check_links(self, time, places, moving):
        for link, (front, rear) in enumerate(zip(places, places[1:])):
            forward, behind = self.scene.products(front, rear)
            require(behind > 0, f"link {link} does not hold at t = {time} s")
            require(not moving or forward > 0, f"bench {link} does not move forward at t = {time} s")

    def contact(self, result):
        lo, hi, a, b = (result[key] for key in ("time_lo", "time_hi", "bench_a", "bench_b"))
        require(b > a + 1, f"benches {a} and {b} share a handle")
        if lo > 0:
            self.check_apart(lo, self.scene.boards(self.at(lo)))
        boards = self.scene.boards(self.scene.chain(self.scene.place(hi), b + 2))
        require(overlap(boards[a], boards[b]), f"benches {a} and {b} do not overlap at t = {hi} s")

    def stall(self, result):
        lo, hi, link = result["time_lo"], result["time_hi"], result["bench_a"]
        self.check_links(lo, self.at(lo), moving=True)
        front, rear = self.scene.chain(self.scene.place(hi), link + 2)[link:]
        require(self.scene.products(front, rear)[0] < 0, f"bench {link} has not stalled at t = {hi} s")

    def lock(self, result):
        scene, lo, hi, link = self.scene, result["time_lo"], result["time_hi"], result["bench_a"]
        before = self.at(lo)
        self.check_links(lo, before, moving=False)
        front, rear = before[link], before[link + 1]
        after = scene.chain(scene.place(hi), link + 1)[link]
        if front[0] != after[0]:
            raise Undecided("a lock beside a junction")
        # These are distances from the front handle, at every place of [front, after], to places around the rear handle.
        # If all are less than the link on both sides, or all are more, a follower cannot leave unnoticed.
        square = scene.links[link] ** 2
        meanwhile = scene.point((front[0], hull(front[1], after[1])))

        def is_beside(place, is_less):
            gap = sub(meanwhile, scene.point(place))
            return bool(dot(gap, gap) < square) if is_less else bool(dot(gap, gap) > square)

        for is_less in (True, False):
            window = None
            for exponent in range(4, 60):
                metres = scene.links[link] * arb(2) ** -exponent
                ends = self.around(rear, metres)
                if ends is not None and all(is_beside((rear[0], end), is_less) for end in ends):
                    window = ends
            curve = scene.segments[rear[0]]
            if window is not None and self.is_all(curve, *window, scene.point(after), square, is_less, 60):
                return
        require(False, f"bench {link} has not locked at t = {hi} s")

    def around(self, place, metres):
        """Returns the coordinates some metres before and after a place, if both are on its segment."""
        curve, c = self.scene.segments[place[0]], place[1].mid()
        by = curve.sense * metres / curve.scale(c)
        ends = ((c - by).mid(), (c + by).mid())
        for end in ends:
            if curve.begin is not None and not (end - curve.begin) * curve.sense > 0:
                return None
            if curve.end is not None and not (curve.end - end) * curve.sense > 0:
                return None
        return ends

    def is_all(self, curve, c, to, point, square, is_less, depth):
        """Returns true if a stretch is certainly nearer than the link, or further away."""
        sign = 1 if is_less else -1
        if self.scene.is_nearer(curve, c, to, point, square, sign):
            return True
        middle = ((c + to) / 2).mid()
        return depth > 0 and all(
            self.is_all(curve, one, other, point, square, is_less, depth - 1)
            for one, other in ((c, middle), (middle, to))
        )

    def path_end(self, result):
        end = self.scene.end()
        is_there = end > result["time_lo"] and end < result["time_hi"] or end.overlaps(arb(result["time_lo"]))
        require(is_there, f"the path ends at {float(end.mid())} s")

    def obstacle(self, result):
        lo, hi, bench = result["time_lo"], result["time_hi"], result["bench_a"]
        require(bench < self.scene.benches, f"there is no bench {bench}")
        shape = self.scene.obstacles[result["obstacle"]]
        if lo > 0:
            self.check_avoided(lo, self.scene.boards(self.at(lo)), result["obstacle"])
        board = self.scene.boards(self.scene.chain(self.scene.place(hi), bench + 2))[bench]
        require(shape.is_reached(board), f"bench {bench} is not at obstacle {result['obstacle']} at t = {hi} s")

    def check_avoided(self, time, boards, obstacle):
        for bench, board in enumerate(boards):
            self.counts["obstacles"] += 1
            avoided = self.scene.obstacles[obstacle].is_avoided(board)
            require(avoided, f"bench {bench} is not clear of obstacle {obstacle} at t = {time} s")

    def least_clearance(self, claim, near, until, number):
        """Checks that no two boards are nearer than claimed, and that two are as near."""
        scene, lo = self.scene, claim["lo"]
        time = float(scene.time_at(read_place(near["at"][0])).mid()) if near else until
        around = [min(max(time + self.random.uniform(-1, 1) * until / 100, 0.0), until) for _ in range(number)]
        for at in around + [self.random.uniform(0, until) for _ in range(number)] if lo is not None else []:
            try:
                boards = scene.boards(self.at(at))
            except Undecided:
                self.counts["undecided"] += 1
                continue
            self.counts["places"] += 1
            for i, j in pairs(boards, max(lo, 0.0)):
                self.counts["pairs"] += 1
                nearest = clearance(boards[i], boards[j])
                require(nearest >= lo, f"benches {i} and {j} are nearer than {lo} m at t = {at} s")
        if claim["until"] != "contact" and claim["hi"] is not None:
            i, j = claim["bench_a"], claim["bench_b"]
            self.check_is_by(near, claim)
            boards = scene.boards(scene.chain(read_place(near["at"][0]), j + 2))
            nearest = clearance(boards[i], boards[j])
            # The steps have come there.
            require(lo is None or nearest >= lo, f"benches {i} and {j} are nearer than {lo} m")
            require(nearest <= claim["hi"], f"benches {i} and {j} are {float(nearest)} m apart, not {claim['hi']} m")
        self.counts["clearances"] += 1

    def check_is_by(self, near, claim):
        """Checks that a near place is not after the time up to which the result holds."""
        if claim["until"] == "time":
            time = self.scene.time_at(read_place(near["at"][0]))
            require(not time > claim["time_until"], "the near place is after time_until")

    def obstacle_clearance(self, claim, near, until, number):
        """Checks that no board is nearer to an obstacle than claimed, and that one is as near."""
        scene, lo, hi = self.scene, claim["lo"], claim["hi"]
        shape = scene.obstacles[claim["obstacle"]]
        time = float(scene.time_at(read_place(near["at"][0])).mid()) if near else until
        around = [min(max(time + self.random.uniform(-1, 1) * until / 100, 0.0), until) for _ in range(number)]
        # A board that overlaps the shape has no distance here.
        times = around if lo is not None and shape.distance + lo > 0 else []
        for at in times:
            wider = Obstacle(shape.kind, shape.points, shape.distance + arb(lo))
            try:
                avoided = [wider.is_avoided(board) for board in scene.boards(self.at(at))]
            except Undecided:
                self.counts["undecided"] += 1
                continue
            self.counts["places"] += 1
            self.counts["obstacles"] += len(avoided)
            require(all(avoided), f"a board is nearer to obstacle {claim['obstacle']} than {lo} m at t = {at} s")
        if hi is not None:
            bench = claim["bench"]
            self.check_is_by(near, claim)
            board = scene.boards(scene.chain(read_place(near["at"][0]), bench + 2))[bench]
            wider = Obstacle(shape.kind, shape.points, shape.distance + arb(hi))
            require(wider.is_reached(board), f"bench {bench} is not within {hi} m of obstacle {claim['obstacle']}")

    def ratios(self, places):
        """Returns the speeds of all handles, with the head's as 1."""
        ratios = [arb(1)]
        for front, rear in zip(places, places[1:]):
            forward, behind = self.scene.products(front, rear)
            ratios.append(ratios[-1] * forward / behind)
        return ratios

    def greatest_speed(self, claim, fast, number):
        """Checks that no handle is faster than claimed, and that one is as fast."""
        limit, value_lo, value_hi, ratio_lo, ratio_hi = (
            arb(claim[key]) for key in ("limit", "value_lo", "value_hi", "ratio_lo", "ratio_hi")
        )
        require(value_lo * ratio_hi <= limit and limit <= value_hi * ratio_lo, "the speeds are not those of the ratios")
        for _ in range(2 * number):
            time = self.random.uniform(0, claim["time_until"])
            try:
                ratios = self.ratios(self.at(time))
            except Undecided:
                self.counts["undecided"] += 1
                continue
            self.counts["places"] += 1
            for handle, ratio in enumerate(ratios):
                self.counts["speeds"] += 1
                require(abs(ratio) <= ratio_hi, f"handle {handle} is faster than {claim['ratio_hi']} at t = {time} s")
        if claim["handle"] > 0:
            head = read_place(fast["at"][0])
            travelled = self.scene.travelled(head)
            require(travelled >= 0 and travelled <= self.scene.length, "the fastest place is not in the motion")
            ratio = self.ratios(self.scene.chain(head, claim["handle"] + 1))[claim["handle"]]
            require(abs(ratio) >= ratio_lo, f"handle {claim['handle']} is slower than {claim['ratio_lo']}")

    def least_pitch(self, claim, lines, number):
        """Checks random pitches that do not reach the radius, and the one that does."""
        reach, far = (next((line for line in lines if line["type"] == kind), None) for kind in ("reach", "far"))
        intervals = [line for line in lines if line["type"] in ("overlap", "head_locks")]
        require((claim["radius"], claim["from"]) == (reach["radius"], reach["from"]), "the question is another")
        ends = [claim["from"], *(line["to"] for line in intervals)]
        require(ends[:-1] == [line["from"] for line in intervals], "a gap between the pitches")
        require(claim["value_lo"] is None or claim["value_lo"] <= ends[-1], "value_lo is beyond the last pitch")
        for line in self.random.sample(intervals, min(2 * number, len(intervals))):
            pitch = line["from"] + self.random.random() * (line["to"] - line["from"])
            scene = self.scene.on_spiral(arb(pitch))
            a = scene.segments[0].a
            self.counts["pitches"] += 1
            if line["type"] == "overlap":
                i, j = line["benches"]
                require(j > i + 1 and a * line["theta"] >= claim["radius"], f"no overlap before with pitch {pitch} m")
                boards = scene.boards(scene.chain((0, arb(line["theta"])), j + 2))
                require(overlap(boards[i], boards[j]), f"benches {i} and {j} do not overlap with pitch {pitch} m")
            else:
                # The follower has come from half a turn or less behind.
                head = arb(claim["radius"]) / a
                _, behind = scene.follower((0, head), scene.links[0])
                require(behind - head > 1.5 * PI, f"the head does not lock with pitch {pitch} m")
        if claim["value_hi"] is None:
            return
        require(far is not None and far["pitch"] == claim["value_hi"], "the free pitch is another")
        judge = copy.copy(self)
        judge.scene = scene = self.scene.on_spiral(arb(claim["value_hi"]))
        for share in [self.random.uniform(0, 1.2) for _ in range(number)] + [0.0]:
            radius = claim["radius"] + share * max(far["radius"] - claim["radius"], 0.0)
            places = scene.chain((0, arb(radius) / scene.segments[0].a), scene.benches + 1)
            what = f"with pitch {claim['value_hi']} m and the head at {radius} m"
            self.counts["places"] += 1
            judge.check_links(what, places, moving=False)
            judge.check_apart(what, scene.boards(places))
        steps = [line for line in lines if line["type"] == "step"]
        for line in self.random.sample(steps, min(number, len(steps))):
            judge.span(line)

    def random_places(self, number, until, ends):
        """Checks at random times, up to the end of each claim, boards, links and obstacles."""
        for _ in range(number):
            for claim, end in ends.items():
                # Boards may overlap from the start.
                if end == 0:
                    continue
                time = self.random.uniform(0, min(end, until))
                try:
                    places = self.at(time)
                except Undecided:
                    self.counts["undecided"] += 1
                    continue
                self.counts["places"] += 1
                self.check_links(time, places, moving=time < ends["stall"])
                if claim == "contact":
                    self.check_apart(time, self.scene.boards(places))
                elif claim != "stall":
                    self.check_avoided(time, self.scene.boards(places), claim)

    def span(self, line):
        """Checks that the spans of a step contain the chain at a random place of the head."""
        scene = self.scene
        begin, end = read_place(line["from"]), read_place(line["to"])
        if begin[0] != end[0]:
            head = begin
        else:
            share = arb(self.random.random())
            head = (begin[0], (begin[1] + share * (end[1] - begin[1])).mid())
        try:
            places = scene.chain(head, len(line["spans"]) + 1)[1:]
        except Undecided:
            self.counts["undecided"] += 1
            return
        for handle, (place, (lo, hi)) in enumerate(zip(places, line["spans"]), 1):
            lo, hi = read_place(lo), read_place(hi)
            contained = scene.not_after(lo, place) and scene.not_after(place, hi)
            require(contained, f"handle {handle} is not in its span while the head is at {head[0]}, {float(head[1])}")
        self.counts["spans"] += len(places)
        apart = line.get("apart")
        if apart is not None:
            boards = scene.boards([head, *places])
            for i, j in pairs(boards, max(apart, 0.0)):
                if line["links"] == "all" or i < 2:
                    self.counts["pairs"] += 1
                    is_apart = clearance(boards[i], boards[j]) > apart
                    require(is_apart, f"benches {i} and {j} are not {apart} m apart while the head is at {float(head[1])}")


class PairJudge:
    """Checks the claims about two dragons, at times of the show."""

    def __init__(self, scenes, random, counts):
        self.scenes, self.random, self.counts = scenes, random, counts

    @staticmethod
    def places(scene, time, handles):
        """Returns the places of the first handles at a time."""
        return scene.chain(scene.place(time, stands=True), handles)

    def two(self, benches, time):
        """Returns a board of each on the stage."""
        require(all(b < scene.benches for b, scene in zip(benches, self.scenes)), f"there are no benches {benches}")
        return [s.boards_on_stage(self.places(s, time, b + 2))[b] for b, s in zip(benches, self.scenes)]

    def check_apart(self, time, metres=None):
        """Checks that no boards of the two touch, or that all are some metres apart."""
        boards, others = (s.boards_on_stage(self.places(s, time, s.benches + 1)) for s in self.scenes)
        self.counts["places"] += 1
        for i, j in pairs_of_two(boards, others, max(metres or 0.0, 0.0)):
            self.counts["pairs"] += 1
            if metres is None:
                is_apart = gap_of_sides(boards[i], others[j]) > 0
            else:
                is_apart = clearance(boards[i], others[j]) >= metres
            require(is_apart, f"benches {i} and {j} of two dragons are not {metres or 0} m apart at t = {time} s")

    def at_random(self, number, until, metres=None, around=None):
        """Checks it at random times, some of them around a time."""
        times = [self.random.uniform(0, until) for _ in range(number)]
        if around is not None:
            times += [min(max(around + self.random.uniform(-1, 1) * until / 100, 0.0), until) for _ in range(number)]
        for time in times:
            try:
                self.check_apart(time, metres)
            except Undecided:
                self.counts["undecided"] += 1

    def end(self):
        return max(float(scene.end().mid()) for scene in self.scenes)

    def contact(self, result, number):
        if result["status"] == "proved":
            lo, hi, benches = result["time_lo"], result["time_hi"], [result["bench_a"], result["bench_b"]]
            require(lo <= hi, "the times are not in order")
            if lo > 0:
                self.check_apart(lo)
            require(overlap(*self.two(benches, hi)), f"benches {benches} of two dragons do not overlap at t = {hi} s")
            self.counts["events"] += 1
        until = self.end() if result["status"] == "none" and "time_lo" not in result else result.get("time_lo") or 0.0
        if until > 0:
            self.at_random(number, until)

    def least_clearance(self, claim, near, meeting, number):
        """Checks that no boards of the two are nearer than claimed, and that two are as near."""
        lo, hi, benches = claim["lo"], claim["hi"], [claim["bench_a"], claim["bench_b"]]
        until = claim["time_until"] if claim["until"] == "time" else self.end()
        if claim["until"] == "contact":
            until = meeting["time"]
            require(meeting["benches"] == benches and overlap(*self.two(benches, until)), "no contact of two dragons")
        elif hi is not None:
            require(near is not None and near["benches"] == benches, "the benches of the near time are others")
            require(near["time"] <= until, "the near time is after time_until")
            nearest = clearance(*self.two(benches, near["time"]))
            require(nearest <= min(hi, near["most"]), f"benches {benches} of two dragons are {float(nearest)} m apart")
            require(lo is None or nearest >= lo, f"benches {benches} of two dragons are nearer than {lo} m")
        if lo is not None:
            self.at_random(number, until * (1 - 1e-9), lo, near and near["time"])
        self.counts["clearances"] += 1

    def span(self, line):
        """Checks that the spans of a line `both` contain the chains at a random time, and how far boards are apart."""
        time = self.random.uniform(line["from"], line["to"])
        try:
            for scene, head, spans in zip(self.scenes, line["heads"], line["spans"]):
                places = self.places(scene, time, len(spans) + 1)
                for handle, (place, (lo, hi)) in enumerate(zip(places, [head, *spans])):
                    contained = scene.not_after(read_place(lo), place) and scene.not_after(place, read_place(hi))
                    require(contained, f"handle {handle} of one of two dragons is not in its span at t = {time} s")
                self.counts["spans"] += len(places)
            self.check_apart(time, line.get("apart"))
        except Undecided:
            self.counts["undecided"] += 1


def read_place(place):
    """Returns the segment, and the coordinate: the sum of one or two numbers."""
    return place[0], sum(map(arb, place[1:]), arb(0))


def judged(lines, places, seed):
    first = json.loads(lines[0])
    require(first.get("type") == "certificate" and first.get("format") == 2, "no certificate of format 2")
    about = first.get("about", "events")
    file = tomllib.loads(first["scene"])
    lines = [json.loads(text) for text in lines[1:]]
    if "dragons" in file:
        return judged_several(file, about, lines, places, seed)
    judge = Judge(Scene(file), seed)
    judged_one(judge, about, lines, places)
    return judge.counts


def judged_several(file, about, lines, places, seed):
    """Judges the section of each dragon and of each two."""
    scenes = [Scene({"stage": file.get("stage", {}), **dragon}) for dragon in file["dragons"]]
    require(about in LINES_OF_TWO, f"nothing is known of the {about} of several dragons")
    sections = []
    for line in lines:
        if line["type"] in ("dragon", "pair"):
            sections.append((line.get("dragons", [line.get("dragon")]), []))
        else:
            require(sections, f"a {line['type']} before the first section")
            sections[-1][1].append(line)
    alone, two = [[k] for k in range(len(scenes))], [list(of) for of in combinations(range(len(scenes)), 2)]
    require([of for of, _ in sections] == alone + two, "the sections are not of each dragon and each two")
    judge = Judge(scenes[0], seed)
    for of, section in sections:
        results = [line for line in section if line["type"] not in ("pair", "meeting") and "dragons" in line]
        require(results and all(line["dragons"] == of for line in results), f"a result of {of} is of others")
        if len(of) == 1:
            judge.scene = scenes[of[0]]
            judged_one(judge, about, section, places)
            continue
        require(all(line["type"] in LINES_OF_TWO[about] for line in section), f"an unknown line about {of}")
        require(len(results) == 1 and section[-1] is results[0], f"the result of {of} is not the last line")
        pair = PairJudge([scenes[k] for k in of], judge.random, judge.counts)
        found = {line["type"]: line for line in section}
        if about == "events":
            require(results[0]["event"] == "contact", f"a {results[0]['event']} of two dragons")
            pair.contact(results[0], places)
        else:
            pair.least_clearance(results[0], found.get("near_both"), found.get("meeting"), places)
        both = [line for line in section if line["type"] == "both"]
        for line in judge.random.sample(both, min(places, len(both))):
            pair.span(line)
    return judge.counts


def judged_one(judge, about, lines, places):
    for number, line in enumerate(lines, 2):
        require(line["type"] in LINES[about], f"line {number} is a {line['type']}, of which nothing is known here")
    if about == "events":
        judged_events(judge, lines, places)
        return
    beside = [line for line in lines if line["type"] == "obstacle_clearance"]
    require(len(beside) == (len(judge.scene.obstacles) if about == "least_clearance" else 0), "a result is missing")
    claim = lines[-1 - len(beside)]
    require(claim["type"] == about, f"the last line is a {claim['type']}")
    if about == "least_pitch":
        judge.least_pitch(claim, lines, places)
        return
    found = {line["type"]: line for line in lines}
    if about == "greatest_speed":
        judge.greatest_speed(claim, found.get("fast"), places)
    else:
        scene = judge.scene
        until = claim["time_until"] if claim["until"] == "time" else float(scene.end().mid())
        if claim["until"] == "contact":
            until, (i, j) = found["contact"]["to"], found["contact"]["benches"]
            boards = scene.boards(scene.chain(read_place(until), j + 2))
            require((i, j) == (claim["bench_a"], claim["bench_b"]) and overlap(boards[i], boards[j]), "no contact")
            until = float(scene.time_at(read_place(until)).mid())
        judge.least_clearance(claim, found.get("near"), until * (1 - 1e-9), places)
        near = {line["obstacle"]: line for line in lines if line["type"] == "near_obstacle"}
        for result in beside:
            until = result["time_until"] if result["until"] == "time" else float(scene.end().mid())
            judge.obstacle_clearance(result, near.get(result["obstacle"]), until * (1 - 1e-9), places)
    steps = [line for line in lines if line["type"] in ("step", "speeds")]
    for line in judge.random.sample(steps, min(places, len(steps))):
        judge.span(line)


def judged_events(judge, lines, places):
    results = [line for line in lines if line["type"] == "result"]
    steps = [line for line in lines if line["type"] == "step"]
    kinds = [result.get("obstacle", result["event"]) for result in results]
    expected = [*EVENTS, *range(len(judge.scene.obstacles))]
    require(kinds == expected, f"results about {kinds}, expected {expected}")
    of = dict(zip(kinds, results))
    scene = judge.scene
    until = float(scene.end().mid()) * (1 - 1e-12)
    if of["lock"]["status"] == "proved":
        until = min(until, of["lock"]["time_lo"])
    ends = {}
    for kind, result in of.items():
        status = result["status"]
        if status == "proved":
            require(result["time_lo"] <= result["time_hi"], f"{kind}: the times are not in order")
            getattr(judge, result["event"])(result)
            judge.counts["events"] += 1
        ends[kind] = until if status == "none" and "time_lo" not in result else result.get("time_lo") or 0.0
    if of["lock"]["status"] == "undecided":
        until = min(until, ends["lock"])
    judge.random_places(places, until, {kind: end for kind, end in ends.items() if kind not in ("lock", "path_end")})
    for line in judge.random.sample(steps, min(places, len(steps))):
        judge.span(line)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--places", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("certificates", nargs="+")
    arguments = parser.parse_args()
    for file in arguments.certificates:
        counts, refused, undecided = None, None, None
        try:
            counts = judged(Path(file).read_text().splitlines(), arguments.places, arguments.seed)
        except Refused as error:
            refused = str(error)
        except Undecided as error:
            undecided = str(error)
        print(json.dumps({"file": file, "refused": refused, "undecided": undecided, "counts": counts}), flush=True)


if __name__ == "__main__":
    main()
