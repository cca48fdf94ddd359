"""The paths of `ground.py`, written again: a scene's path by metres of travel, without code of the program."""

import math

import numpy as np


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
