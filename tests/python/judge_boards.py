"""Boards and obstacles: overlaps and distances in balls of Arb, for `second_judge.py`."""

import math

from flint import arb

from judge_curves import Undecided, cross, dot, sub


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
    """Returns the pairs of a board of each of two dragons whose circumscribed circles are not further apart."""
    about, of_others = circles(boards), circles(others)
    return [(i, j) for i, a in enumerate(about) for j, b in enumerate(of_others) if are_near(a, b, distance)]


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
