"""The scene of a certificate, read by itself: path, team and followers, for `second_judge.py`."""

import copy
import math

from flint import arb

from judge_boards import obstacles
from judge_curves import MOST_POINTS, PI, Arc, Line, PlacedSpiral, Refused, Spiral, Undecided, Walk, dot, hull, sub

# Sizes that a scene may leave out, metres.
SIZES = {"head_length": 3.41, "body_length": 2.2, "width": 0.3, "hole_inset": 0.275}


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
