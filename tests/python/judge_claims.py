"""The claims of a certificate, each judged at places of its own, for `second_judge.py`."""

import copy
import random

from flint import arb

from judge_boards import Obstacle, clearance, gap_of_sides, overlap, pairs, pairs_of_two
from judge_curves import PI, Undecided, dot, hull, require, sub

EVENTS = ("contact", "stall", "lock", "path_end")


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
        # A team may have stalled at its start.
        self.check_links(lo, self.at(lo), moving=lo > 0)
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
        around = self.times_around(near, until, number)
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
            boards = scene.boards(scene.chain(self.place_near(near, claim, [i, j]), j + 2))
            nearest = clearance(boards[i], boards[j])
            # The steps have come there.
            require(lo is None or nearest >= lo, f"benches {i} and {j} are nearer than {lo} m")
            require(nearest <= claim["hi"], f"benches {i} and {j} are {float(nearest)} m apart, not {claim['hi']} m")
        self.counts["clearances"] += 1

    def times_around(self, near, until, number):
        """Returns random times around that of a witness, or else around the end."""
        time = float(self.scene.time_at(head_of(near)).mid()) if near else until
        return [min(max(time + self.random.uniform(-1, 1) * until / 100, 0.0), until) for _ in range(number)]

    def place_near(self, near, claim, benches):
        """Returns the head's place in the witness of a result. It is not after the time up to which that holds."""
        require(near is not None and near["benches"] == benches, f"no distance of benches {benches} is shown")
        head = head_of(near)
        if claim["until"] == "time":
            require(not self.scene.time_at(head) > claim["time_until"], "the near place is after time_until")
        return head

    def obstacle_clearance(self, claim, near, until, number):
        """Checks that no board is nearer to an obstacle than claimed, and that one is as near."""
        scene, lo, hi = self.scene, claim["lo"], claim["hi"]
        shape = scene.obstacles[claim["obstacle"]]
        around = self.times_around(near, until, number)
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
            board = scene.boards(scene.chain(self.place_near(near, claim, [bench]), bench + 2))[bench]
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
                    where = f"while the head is at {float(head[1])}"
                    require(is_apart, f"benches {i} and {j} are not {apart} m apart {where}")


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
            require(meeting is not None and meeting["benches"] == benches, f"no contact of benches {benches} is shown")
            until = meeting["time"]
            require(overlap(*self.two(benches, until)), f"benches {benches} of two dragons do not overlap")
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


def head_of(near):
    """Returns the place of the first head in a witness of a distance."""
    return read_place(near["at"][0][0])
