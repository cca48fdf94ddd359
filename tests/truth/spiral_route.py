#!/usr/bin/env python3
"""Writes tests/truth/spiral_route.csv: the handles of a team on a route with spirals of all four kinds, with 50 digits.

    pip install mpmath
    python3 tests/truth/spiral_route.py > tests/truth/spiral_route.csv

Points are complex numbers. A piece is a function of the metres from its beginning; a follower is found by small steps
back and bisection. All numbers of the route are the doubles that the program reads.
"""

from mpmath import asinh, atan, exp, findroot, mp, mpc, mpf, pi, sqrt

mp.dps = 50

HEAD, BODY, BENCHES = mpf(3.41) - 2 * mpf(0.275), mpf(2.2) - 2 * mpf(0.275), 25
PIECES = [
    ("line", 15.0),
    ("spiral", 1.7, 12.0, -1, 1, 4.0),  # in, to the left
    ("arc", 2.6, -1, 0.45),
    ("spiral", 1.3, 5.0, 1, 1, 1.5),  # out, to the left
    ("spiral", 0.9, 4.5, -1, -1, 2.0),  # in, to the right
    ("line", 6.0),
    ("spiral", 2.1, 3.0, 1, -1, 1.25),  # out, to the right
    ("line", 20.0),
]
TIMES = [0.0, 16.0, 60.0, 120.5, 231.0, 240.0, 262.5, 290.0, 310.0, 340.0]


def length_of(a, theta):
    """Metres of the spiral r = a theta from its centre."""
    return a / 2 * (theta * sqrt(1 + theta**2) + asinh(theta))


def line(metres):
    return mpf(metres), lambda s, z, d: (z + s * d, d)


def arc(radius, side, turns):
    radius = mpf(radius)

    def at(s, z, d):
        turned = exp(mpc(0, side * s / radius))
        return z + mpc(0, side) * d * radius * (1 - turned), d * turned

    return 2 * pi * radius * mpf(turns), at


def spiral(pitch, radius, way, side, turns):
    """`way` is 1 outward, -1 inward; `side` 1 with the centre on the left."""
    a = mpf(pitch) / (2 * pi)
    first = mpf(radius) / a
    last = first + way * 2 * pi * mpf(turns)

    def at(s, z, d):
        target = length_of(a, first) + way * s
        theta = findroot(lambda t: length_of(a, t) - target, sqrt(2 * target / a)) if s else first
        # Of the place theta on the spiral p = a theta e^(i side way theta), and its direction of travel.
        place = lambda t: a * t * exp(mpc(0, side * way * t))
        along = lambda t: way * exp(mpc(0, side * way * t)) * mpc(1, side * way * t) / sqrt(1 + t**2)
        turn = d / along(first)
        return z + turn * (place(theta) - place(first)), turn * along(theta)

    return abs(length_of(a, last) - length_of(a, first)), at


class Path:
    def __init__(self):
        self.pieces, s, z, d = [], mpf(0), mpc(0), mpc(1)
        for kind, *numbers in PIECES:
            length, at = {"line": line, "arc": arc, "spiral": spiral}[kind](*numbers)
            self.pieces.append((s, at, z, d))
            s, (z, d) = s + length, at(length, z, d)

    def at(self, s):
        """Returns the point and the direction of travel after `s` metres."""
        begin, at, z, d = [piece for piece in self.pieces if piece[0] <= s or piece[0] == 0][-1]
        return (z + s * d, d) if s < 0 else at(s - begin, z, d)

    def follower(self, front, link):
        """Returns the metres of the first place behind `front` that is `link` away."""
        point = self.at(front)[0]
        lacks = lambda s: link - abs(self.at(s)[0] - point)
        near, step = front, link / 200
        while lacks(near - step) > 0:
            near -= step
        return findroot(lacks, (near - step, near), solver="anderson", tol=mpf(10) ** -90)


def main():
    path = Path()
    print("t_s,handle,x_m,y_m,speed_m_s")
    for time in TIMES:
        s, speed = mpf(time), mpf(1)
        for handle in range(BENCHES + 1):
            point, along = path.at(s)
            print(f"{time},{handle},{mp.nstr(point.real, 24)},{mp.nstr(point.imag, 24)},{mp.nstr(speed, 24)}")
            if handle < BENCHES:
                rear = path.follower(s, HEAD if handle == 0 else BODY)
                behind, direction = path.at(rear)
                link = point - behind
                product = lambda t: (t * link.conjugate()).real
                s, speed = rear, speed * product(along) / product(direction)


main()
