"""The curves of a path in balls of Arb, and the walk of a link along them, for `second_judge.py`."""

import bisect
import math

from flint import acb, arb, ctx

ctx.prec = 192
PI = arb.pi()
# The most points of the path that are looked at for one follower.
MOST_POINTS = 3000
# Points of the path in the length of a link, for the walk of a link, and the most of them that a follower may pass
# while its front passes one. A follower that passes more has vanished.
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
    """A spiral about any centre from a point in a direction, its centre on one side.

    Complex numbers in place of vectors: along it, the tangent is the unit vector from the centre times
    (sense + i side theta) / sqrt(1 + theta^2).
    """

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


class Walk:
    """A link that moves along the path by small steps, in doubles.

    The follower of each point of the path is between two neighbouring points, and moves on from there.
    """

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
