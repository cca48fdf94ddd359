"""Prints 40 digits of the first touch of the only obstacle of a scene, in the ball arithmetic of Arb.

    ground_digits.py SCENE.toml TIME

TIME, seconds, is a guess, correct to a microsecond. The clearance of each board is enclosed half a unit of the last
digit before and after the time printed. All are positive before, and one is negative after. `ground.py` tests that
nothing is met earlier. `judge_scene.py` reads the scene, in coordinates of its path. The script shares no code with
the program.
"""

import sys
import tomllib

from flint import arb, ctx
from judge_curves import PI, cross, dot, sub
from judge_scene import Scene

ctx.prec = 224
# Decimal places of a time.
PLACES = 38


class Ground:
    """The obstacle in coordinates of the path: an open or closed polyline, or a point with a radius."""

    def __init__(self, file):
        stage, placement = file["stage"], file.get("placement", {})
        given = stage["boundary"] if "boundary" in stage else stage["obstacles"][0]
        self.least = arb(float(given.get("keep_out", 0.0)))
        turns = 2 * PI * arb(float(placement.get("rotation_turns", 0.0)))
        sin, cos = turns.sin_cos()
        origin = [arb(float(c)) for c in placement.get("origin", [0.0, 0.0])]
        sign = -1 if placement.get("mirror", False) else 1

        def own(corner):
            x, y = sub([arb(float(c)) for c in corner], origin)
            return cos * x + sin * y, sign * (cos * y - sin * x)

        if "circle" in given:
            corners = [given["circle"]["center"]]
            self.least += arb(float(given["circle"]["radius"]))
        else:
            corners = given["polygon"] + given["polygon"][:1] if "polygon" in given else given["line"]
        corners = [own(corner) for corner in corners]
        self.sides = list(zip(corners, corners[1:])) or [(corners[0], corners[0])]

    def clearance(self, board):
        """Returns the distance of a board from the outline minus the keep-out; the two do not meet."""
        edges = list(zip(board, board[1:] + board[:1]))
        ends = [point for side in self.sides for point in side]
        squares = [square(point, edge) for point in ends for edge in edges]
        squares += [square(corner, side) for corner in board for side in self.sides]
        least = squares[0]
        for other in squares[1:]:
            least = least.min(other)
        return least.sqrt() - self.least


def square(point, side):
    """Returns the square of the distance of a point from a segment."""
    along, offset = sub(side[1], side[0]), sub(point, side[0])
    length = dot(along, along)
    if length == 0:
        return dot(offset, offset)
    share = dot(along, offset) / length
    if share < 0 or share > 1:
        rest = offset if share < 0 else sub(point, side[1])
        return dot(rest, rest)
    assert share > 0 and share < 1, "a corner that is neither beside a side nor beyond it"
    return cross(along, offset) ** 2 / length


def clearances(scene, ground, time, benches):
    return [ground.clearance(board) for board in scene.boards(scene.chain(scene.place(time), benches + 1))]


def main():
    file = tomllib.loads(open(sys.argv[1]).read())
    scene, ground, guess = Scene(file), Ground(file), arb(float(sys.argv[2]))
    before, after = guess - arb(1) / 10**6, guess + arb(1) / 10**6
    gaps = clearances(scene, ground, after, scene.benches)
    bench = min(range(scene.benches), key=lambda bench: float(gaps[bench]))
    gap = lambda time: clearances(scene, ground, time, bench + 1)[bench]
    low, high = gap(before), gaps[bench]
    assert low > 0 and high < 0, "no touch within a microsecond"
    # Secants: the clearance is smooth beside the touch.
    for _ in range(8):
        at = (after - high * (after - before) / (high - low)).mid()
        (before, low), (after, high) = (after, high), (at, gap(at).mid())
        if abs(float(high)) < 1e-55 or high == low:
            break
    unit = arb(10) ** -PLACES
    digits = (after / unit + arb(0.5)).mid().floor().unique_fmpz()
    printed = arb(digits) * unit
    first, last = (clearances(scene, ground, printed + by * unit / 2, scene.benches) for by in (-1, 1))
    assert all(gap > 0 for gap in first) and last[bench] < 0, "not decided"
    whole = str(digits).rjust(PLACES + 1, "0")
    print(f"{whole[:-PLACES]}.{whole[-PLACES:]} bench {bench}")


main()
