"""The least turn radius of a link by a search of its own: the radius below which the link locks.

    least_turn.py PITCH LINK ARC_RATIO

A link locks where its rear handle is at a place p of the path whose tangent is perpendicular to the link, the front
handle being at the first place ahead at the distance of the link. So the least product of tangent and link over all p is
0 with the least radius. Prints that radius, and the metres from the beginning of the S to p. No contact and no stall is
looked for. It shares no code with the program.
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


def main():
    pitch, link, ratio = map(float, sys.argv[1:])
    low, high = 0.5 * link, 8.0 * link
    for _ in range(46):
        middle = 0.5 * (low + high)
        if least_product(Turn(middle, pitch, ratio), link)[0] < 0:
            low = middle
        else:
            high = middle
    print(f"{high:.12f} {least_product(Turn(high, pitch, ratio), link)[1]:.6f}")


main()
