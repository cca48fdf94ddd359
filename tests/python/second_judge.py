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
import json
import tomllib
from itertools import combinations
from pathlib import Path

from judge_boards import overlap
from judge_claims import EVENTS, Judge, PairJudge, read_place
from judge_curves import Refused, Undecided, require
from judge_scene import Scene

# Kinds of lines in the certificates of each question, beside the first: any other line is refused.
KINDS = {
    "events": (
        "branch", "step", "witness point", "witness obstacle point", "stall", "lock", "path_end", "result event"
    ),
    "least_clearance": (
        "branch", "step", "witness point", "witness at most", "witness obstacle at most", "path_end",
        "result least_clearance", "result obstacle_clearance"
    ),
    "greatest_speed": ("branch", "speeds", "fast", "result greatest_speed"),
    "least_pitch": ("reach", "overlap", "head_locks", "far", "step", "result least_pitch"),
}
# The same kinds for two of several dragons.
KINDS_OF_TWO = {
    "events": ("both", "witness time point", "result event"),
    "least_clearance": ("both", "witness time point", "witness time at most", "result least_clearance"),
}


def kind_of(line):
    """Returns the type of a line, with what a result is of, or with the keys by which witnesses differ."""
    if line["type"] == "result":
        return f"result {line.get('of')}"
    keys = ("obstacle", "time", "point", "at", "most") if line["type"] == "witness" else ()
    return " ".join([str(line["type"]), *(key for key in keys if line.get(key) is not None)])


def check_kinds(lines, known, dragons):
    """Checks that all lines are of known kinds, and that each witness is about a number of dragons."""
    for number, line in enumerate(lines, 2):
        kind = kind_of(line)
        is_known = kind in known and kind.split()[0] == line["type"]
        require(is_known, f"line {number} is a {kind}, of which nothing is known here")
        if line["type"] == "witness":
            lists = [line[key] for key in ("heads", "spans", "at") if line.get(key) is not None]
            require(all(len(each) == dragons for each in lists), f"line {number} is not about {dragons} dragons")
            benches = 1 if "obstacle" in kind else 2
            require(len(line["benches"]) == benches, f"line {number} does not name {benches} benches")


def witness(lines, shows, obstacle=None):
    """Returns the witness with a `point` or with `most`, of an obstacle or else of two boards, or `None`."""
    of = [line for line in lines if line["type"] == "witness" and line.get("obstacle") == obstacle]
    of = [line for line in of if line.get(shows) is not None]
    require(len(of) <= 1, "two witnesses of the same")
    return of[0] if of else None


def judged(lines, places, seed):
    first = json.loads(lines[0])
    require(first.get("type") == "certificate" and first.get("format") == 4, "no certificate of format 4")
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
    require(about in KINDS_OF_TWO, f"nothing is known of the {about} of several dragons")
    sections = []
    for line in lines:
        if line["type"] == "section":
            sections.append((line.get("dragons"), []))
        else:
            require(sections, f"a {line['type']} before the first section")
            sections[-1][1].append(line)
    alone, two = [[k] for k in range(len(scenes))], [list(of) for of in combinations(range(len(scenes)), 2)]
    require([of for of, _ in sections] == alone + two, "the sections are not of each dragon and each two")
    judge = Judge(scenes[0], seed)
    for of, section in sections:
        results = [line for line in section if line["type"] == "result"]
        require(results and all(line.get("dragons") == of for line in results), f"a result of {of} is of others")
        if len(of) == 1:
            judge.scene = scenes[of[0]]
            judged_one(judge, about, section, places)
            continue
        check_kinds(section, KINDS_OF_TWO[about], 2)
        require(len(results) == 1 and section[-1] is results[0], f"the result of {of} is not the last line")
        pair = PairJudge([scenes[k] for k in of], judge.random, judge.counts)
        if about == "events":
            require(results[0]["event"] == "contact", f"a {results[0]['event']} of two dragons")
            pair.contact(results[0], places)
        else:
            pair.least_clearance(results[0], witness(section, "most"), witness(section, "point"), places)
        both = [line for line in section if line["type"] == "both"]
        for line in judge.random.sample(both, min(places, len(both))):
            pair.span(line)
    return judge.counts


def judged_one(judge, about, lines, places):
    check_kinds(lines, KINDS[about], 1)
    if about == "events":
        judged_events(judge, lines, places)
        return
    beside = [line for line in lines if kind_of(line) == "result obstacle_clearance"]
    require(len(beside) == (len(judge.scene.obstacles) if about == "least_clearance" else 0), "a result is missing")
    claim = lines[-1 - len(beside)]
    require(kind_of(claim) == f"result {about}", f"the last line is a {kind_of(claim)}")
    if about == "least_pitch":
        judge.least_pitch(claim, lines, places)
        return
    if about == "greatest_speed":
        fast = next((line for line in reversed(lines) if line["type"] == "fast"), None)
        judge.greatest_speed(claim, fast, places)
    else:
        scene = judge.scene
        until = claim["time_until"] if claim["until"] == "time" else float(scene.end().mid())
        if claim["until"] == "contact":
            contact, benches = witness(lines, "point"), [claim["bench_a"], claim["bench_b"]]
            require(contact is not None and contact["benches"] == benches, f"no contact of benches {benches} is shown")
            (i, j), place = benches, read_place(contact["heads"][0][1])
            boards = scene.boards(scene.chain(place, j + 2))
            require(overlap(boards[i], boards[j]), f"benches {i} and {j} do not overlap")
            until = float(scene.time_at(place).mid())
        judge.least_clearance(claim, witness(lines, "most"), until * (1 - 1e-9), places)
        for result in beside:
            until = result["time_until"] if result["until"] == "time" else float(scene.end().mid())
            near = witness(lines, "most", result["obstacle"])
            judge.obstacle_clearance(result, near, until * (1 - 1e-9), places)
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
