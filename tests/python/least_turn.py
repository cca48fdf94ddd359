"""The least turn radius of a link by a search of its own: the radius below which the link locks.

    least_turn.py PITCH LINK ARC_RATIO [BENCHES BODY_LINK INSET WIDTH [CLEARANCE]]

A link locks where its rear handle is at a place p of the path whose tangent is perpendicular to the link. The front
handle is then at the first place ahead at the distance of the link. So the least product of tangent and link over all p
is 0 with the least radius. Prints that radius, and the metres from the beginning of the S to p. No contact and no stall
is looked for. The script shares no code with the program.

With the team's size the script prints another line. The line has the radius at which the boards come free, or as far
apart as the clearance, and the two benches that do so last, counted from 0.
"""

import math
import sys


class Turn:
    """A turnaround by metres of path from the beginning of the S."""

    def __init__(self, radius, pitch, ratio):
        self.a, self.theta = pitch / math.tau, radius * math.tau / pitch
        both, turned = math.hypot(radius, self.a), 2 * math.atan(self.theta)
        self.radii = [both * ratio / (ratio + 1), both / (ratio + 1)]
        self.begins = [0.0, self.radii[0] * turned, both * turned]
        # The S begins at the origin, to the right.
        self.middle = self.on_arc(0, self.begins[1])
        # The centre of the spirals is half-way to the end of the S.
        (x, y), _ = self.on_arc(1, self.begins[2] - self.begins[1])
        self.centre = (x / 2, y / 2)
        self.phase = math.atan2(-self.centre[1], -self.centre[0]) - self.theta

    def on_arc(self, number, metres):
        """Returns a point and the direction of the path there."""
        radius, side = self.radii[number], (-1, 1)[number]
        (x, y), heading = ((0.0, 0.0), 0.0) if number == 0 else self.middle
        turned = heading + side * metres / radius
        centre = (x - side * radius * math.sin(heading), y + side * radius * math.cos(heading))
        return (centre[0] + side * radius * math.sin(turned), centre[1] - side * radius * math.cos(turned)), turned

    def length(self, theta):
        return 0.5 * self.a * (theta * math.hypot(1.0, theta) + math.asinh(theta))

    def on_spiral(self, outward, metres):
        """Returns a point and the direction some metres outside the S."""
        theta, whole = self.theta, self.length(self.theta) + metres
        for _ in range(50):
            step = (self.length(theta) - whole) / (self.a * math.hypot(1.0, theta))
            theta -= step
            if abs(step) <= 1e-16 * theta:
                break
        angle, sign = theta + self.phase, -1 if outward else 1
        x, y = (sign * self.a * theta * part for part in (math.cos(angle), math.sin(angle)))
        heading = angle + math.atan(theta) + math.pi
        return (self.centre[0] + x, self.centre[1] + y), heading

    def at(self, s):
        if s < 0:
            return self.on_spiral(False, -s)
        if s > self.begins[2]:
            return self.on_spiral(True, s - self.begins[2])
        return self.on_arc(0, s) if s < self.begins[1] else self.on_arc(1, s - self.begins[1])

    def product(self, s, link):
        """Returns the tangent at `s` times the link to the first place ahead at its distance."""
        (x, y), heading = self.at(s)

        def beyond(ahead):
            (u, v), _ = self.at(s + ahead)
            return math.hypot(u - x, v - y) - link

        low, step = link, link / 64
        while beyond(low + step) < 0:
            low += step
        high = low + step
        while True:
            middle = 0.5 * (low + high)
            if middle <= low or middle >= high:
                break
            low, high = (middle, high) if beyond(middle) < 0 else (low, middle)
        (u, v), _ = self.at(s + high)
        return (u - x) * math.cos(heading) + (v - y) * math.sin(heading)


def least(function, low, high):
    """Returns the least value of a function with one minimum, and its place."""
    share = 0.5 * (math.sqrt(5) - 1)
    for _ in range(70):
        first, last = high - share * (high - low), low + share * (high - low)
        if function(first) < function(last):
            high = last
        else:
            low = first
    at = 0.5 * (low + high)
    return function(at), at


def least_product(turn, link):
    count = 400
    low, high = -2.0 * link, turn.begins[2] + 1.0 * link
    places = [low + (high - low) * k / count for k in range(count + 1)]
    nearest = min(range(count + 1), key=lambda k: turn.product(places[k], link))
    around = [places[max(nearest - 1, 0)], places[min(nearest + 1, count)]]
    # A junction may be a corner of the product.
    ends = [around[0], *(begin for begin in turn.begins if around[0] < begin < around[1]), around[1]]
    return min(least(lambda s: turn.product(s, link), *part) for part in zip(ends, ends[1:]))


def root(function, low, high):
    """Returns the place where an increasing function becomes 0, by the Illinois method."""
    below, above, last = function(low), function(high), 0
    for _ in range(100):
        at = high - above * (high - low) / (above - below)
        value = function(at)
        if value == 0 or not low < at < high:
            break
        if value > 0:
            high, above, below = at, value, 0.5 * below if last > 0 else below
        else:
            low, below, above = at, value, 0.5 * above if last < 0 else above
        last = value
    return at


def distance(one, other):
    """Returns the distance of two rectangles that are apart, by their corners."""
    both = [(one, other), (other, one)]
    return min(to_segment(corner, *side) for mine, yours in both for corner in mine for side in sides(yours))


def sides(corners):
    front_left, front_right, rear_left, rear_right = corners
    around = [front_left, front_right, rear_right, rear_left]
    return zip(around, around[1:] + around[:1])


def to_segment(point, begin, end):
    (x, y), (u, v) = (point[0] - begin[0], point[1] - begin[1]), (end[0] - begin[0], end[1] - begin[1])
    share = min(max((x * u + y * v) / (u * u + v * v), 0.0), 1.0)
    return math.hypot(x - share * u, y - share * v)


class Boards:
    """The boards of a team, links and sizes in metres."""

    def __init__(self, benches, links, inset, width, clearance=0.0):
        self.links = [links[0]] + [links[1]] * (benches - 1)
        self.inset, self.half_width, self.clearance = inset, 0.5 * width, clearance

    def handles(self, turn, s, count):
        points = [turn.at(s)[0]]
        for link in self.links[:count]:
            x, y = points[-1]

            def beyond(back):
                u, v = turn.at(s - back)[0]
                return math.hypot(u - x, v - y) - link

            low, step = link, link / 16
            while beyond(low + step) < 0:
                low += step
            s -= root(beyond, low, low + step)
            points.append(turn.at(s)[0])
        return points

    def board(self, front, rear):
        """Returns the corners of a board and its two directions."""
        (x, y), (u, v) = front, rear
        link = math.hypot(x - u, y - v)
        c, n = ((x - u) / link, (y - v) / link), (-(y - v) / link, (x - u) / link)
        corners = [
            (x * p + u * (1 - p) + side * n[0] * self.half_width, y * p + v * (1 - p) + side * n[1] * self.half_width)
            for p in (1 + self.inset / link, -self.inset / link)
            for side in (1, -1)
        ]
        return corners, (c, n)

    def gap(self, boards, a, b):
        """Returns a number that is below 0 if and only if two boards are nearer than the clearance."""
        greatest = -math.inf
        for axis in (*boards[a][1], *boards[b][1]):
            one = [axis[0] * x + axis[1] * y for x, y in boards[a][0]]
            other = [axis[0] * x + axis[1] * y for x, y in boards[b][0]]
            greatest = max(greatest, min(other) - max(one), min(one) - max(other))
        if greatest <= 0 or self.clearance == 0:
            return greatest - self.clearance
        return distance(boards[a][0], boards[b][0]) - self.clearance

    def gap_at(self, turn, s, a, b):
        points = self.handles(turn, s, b + 1)
        boards = {bench: self.board(points[bench], points[bench + 1]) for bench in (a, b)}
        return self.gap(boards, a, b)

    def nearest(self, turn):
        """Returns the least gap of a coarse search, its two benches and the head's place."""
        benches, found = len(self.links), (math.inf, 0, 0, 0.0)
        steps = int((turn.begins[2] + sum(self.links)) / STEP)
        for s in (STEP * step for step in range(steps)):
            points = self.handles(turn, s, benches)
            boards = [self.board(*pair) for pair in zip(points, points[1:])]
            pairs = ((a, b) for a in range(benches) for b in range(a + 2, benches))
            found = min(found, min((self.gap(boards, a, b), a, b, s) for a, b in pairs))
        return found


# Metres of the head, and share of the radius, of a coarse search.
STEP, SHARE = 0.4, 4e-3


def contact(boards, turn_of, low):
    """Returns a radius at which the boards come free, and the two benches that overlap last."""
    high = 2 * low
    while high - low > SHARE * low:
        middle = 0.5 * (low + high)
        found = boards.nearest(turn_of(middle))
        if found[0] < 0:
            low, last = middle, found[1:]
        else:
            high = middle
    a, b, s = last
    # The coarse search may have missed a small overlap.
    low, high = low * (1 - SHARE), high * (1 + SHARE)
    for _ in range(36):
        middle = 0.5 * (low + high)
        turn = turn_of(middle)
        if least(lambda at: boards.gap_at(turn, at, a, b), s - 2 * STEP, s + 2 * STEP)[0] < 0:
            low = middle
        else:
            high = middle
    return high, a, b


def main():
    pitch, link, ratio, *team = map(float, sys.argv[1:])
    low, high = 0.5 * link, 8.0 * link
    for _ in range(46):
        middle = 0.5 * (low + high)
        if least_product(Turn(middle, pitch, ratio), link)[0] < 0:
            low = middle
        else:
            high = middle
    print(f"{high:.12f} {least_product(Turn(high, pitch, ratio), link)[1]:.6f}")
    if team:
        benches, body, inset, width, *clearance = team
        boards = Boards(int(benches), (link, body), inset, width, *clearance)
        radius, a, b = contact(boards, lambda radius: Turn(radius, pitch, ratio), 1.001 * high)
        print(f"{radius:.12f} {a} {b}")


main()
