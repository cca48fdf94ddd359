"""First touches and least clearances of obstacles, judged by shapely on the handles that `solve` prints.

    ground.py PROGRAM SCENE.toml
    ground.py PROGRAM --random SEED COUNT

Prints a line for each obstacle, and ends with an error at the first difference.
"""

import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile
import tomllib

from shapely import LinearRing, LineString, Point, Polygon

STEP = 0.02
MOST = 1e-9


def run(program, scene, *arguments):
    command = [program, "--scene", str(scene), "--quiet", "--json", *arguments]
    output = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert output.returncode == 0, f"{command}: {output.stderr}"
    return [json.loads(line) for line in output.stdout.splitlines()]


def shapes(scene):
    """Returns for each obstacle its name, its keep-out and a function of a board: the distance, not positive where they meet."""
    found = []
    for obstacle in scene["stage"].get("obstacles", []):
        if "circle" in obstacle:
            centre, radius = Point(obstacle["circle"]["center"]), obstacle["circle"]["radius"]
            distance = lambda board, centre=centre, radius=radius: board.distance(centre) - radius
        else:
            body = Polygon(obstacle["polygon"]) if "polygon" in obstacle else LineString(obstacle["line"])
            distance = lambda board, body=body: board.distance(body)
        found.append((obstacle["name"], obstacle.get("keep_out", 0.0), distance))
    boundary = scene["stage"].get("boundary")
    if boundary:
        inside, ring = Polygon(boundary["polygon"]), LinearRing(boundary["polygon"])
        within = lambda board: board.distance(ring) if inside.contains(board) else 0.0
        found.append(("boundary", boundary.get("keep_out", 0.0), within))
    return found


def boards(handles, team):
    inset, half = team["hole_inset"], 0.5 * team["width"]
    for front, rear in zip(handles, handles[1:]):
        (x, y), (u, v) = front[:2], rear[:2]
        link = math.hypot(x - u, y - v)
        along, across = ((x - u) / link, (y - v) / link), (-(y - v) / link, (x - u) / link)
        ends = (x + inset * along[0], y + inset * along[1]), (u - inset * along[0], v - inset * along[1])
        sides = [(p[0] + s * half * across[0], p[1] + s * half * across[1]) for p, s in zip(ends + ends[::-1], (1, 1, -1, -1))]
        yield Polygon(sides)


def judge(program, file):
    text = file.read_text()
    scene = tomllib.loads(text)
    events = run(program, file, "events")
    least = {line["obstacle"]: line for line in run(program, file, "check") if line["check"] == "obstacle"}
    met = {event["obstacle"]: event for event in events if event["event"] == "obstacle"}
    end = next(event["time"] for event in events if event["event"] in ("lock", "path_end"))
    stops = scene["motion"].get("on_contact", "stop") == "stop"
    touches = [event["time"] for event in events if event["event"] in ("contact", "obstacle")]
    freeze = min(touches + [end]) if stops else end
    near = [event["time"] + by for event in met.values() for by in (-1e-8, 0.0, 1e-8) if 0 <= event["time"] + by <= end]
    samples = [k * STEP for k in range(int(end / STEP))]
    times = sorted({*samples, *near, *(line["time"] for line in least.values())})
    solved = {}
    for first in range(0, len(times), 500):
        part = times[first:first + 500]
        lines = run(program, file, "solve", "--at", ",".join(map(repr, part)))
        solved |= {time: list(boards(line["handles"], scene["team"])) for time, line in zip(part, lines, strict=True)}
    for number, (name, keep_out, distance) in enumerate(shapes(scene)):
        clearance = {time: [distance(board) - keep_out for board in row] for time, row in solved.items()}
        touch = met.get(name)
        for time, row in clearance.items():
            # A board that overlaps the shape itself has no depth here.
            if touch is None or time <= touch["time"] - 1e-8:
                assert min(row) > 0, f"{name}: within the keep-out at {time} s, before {touch}"
        if touch:
            bench, time = touch["bench_a"], touch["time"]
            assert touch["bench_b"] == scene["team"]["benches"] + 1 + number, touch
            if time > 0:
                assert abs(clearance[time][bench]) < MOST, f"{name}: {clearance[time][bench]} m at {touch}"
                after = clearance.get(time + 1e-8)
                assert after is None or min(after) < MOST, f"{name}: nothing is met at {touch}"
            else:
                assert min(clearance[0.0]) <= 0, f"{name}: not met at the start"
        line = least[name]
        value, time, bench = line["clearance"], line["time"], line["bench"]
        within = {at: row for at, row in clearance.items() if at <= freeze}
        if value > -keep_out:
            assert abs(clearance[time][bench] - value) < MOST, f"{name}: {clearance[time][bench]} m, not {line}"
            assert all(min(row) > value - MOST for row in within.values()), f"{name}: less than {line}"
        else:
            assert clearance[time][bench] <= -keep_out + MOST, f"{name}: {clearance[time][bench]} m, not {line}"
        print(f"{name}: least {value:.9f} m of bench {bench}, met {touch and touch['time']}")


def random_scene(random):
    team = {"benches": random.randint(2, 14), "head_length": 3.41, "body_length": 2.2, "width": 0.3, "hole_inset": 0.275}
    lines = ["[team]", *(f"{key} = {value}" for key, value in team.items()), "[path]"]
    if random.random() < 0.3:
        lines += ['kind = "spiral"', f"pitch = {random.uniform(1.0, 2.0)!r}", f"start_turn = {random.uniform(5, 8)!r}"]
    else:
        pieces = []
        for _ in range(random.randint(1, 5)):
            if random.random() < 0.4:
                pieces.append(f'{{ kind = "line", length = {random.uniform(1, 8)!r} }}')
            else:
                side = random.choice(["left", "right"])
                radius, turns = random.uniform(2, 6), random.uniform(0.1, 0.6)
                pieces.append(f'{{ kind = "arc", radius = {radius!r}, side = "{side}", turns = {turns!r} }}')
        start = [random.uniform(-5, 5), random.uniform(-5, 5)]
        lines += ['kind = "pieces"', f"start = {start}", f"pieces = [{', '.join(pieces)}]"]
    if random.random() < 0.5:
        mirror = "true" if random.random() < 0.5 else "false"
        lines += ["[placement]", f"origin = [{random.uniform(-20, 20)!r}, 3.0]", f"rotation_turns = {random.uniform(-1, 1)!r}"]
        lines += [f"mirror = {mirror}"]
    lines += ["[motion]", f"head_speed = {random.uniform(0.5, 2.0)!r}"]
    lines += [f'on_contact = "{random.choice(["stop", "continue"])}"', "[alerts]", "[stage]"]
    if random.random() < 0.5:
        size = random.uniform(10, 40)
        lines += [f"boundary = {{ polygon = [[-{size}, -{size}], [{size}, -{size}], [0, 0.4], [{size}, {size}], [-{size}, {size}]] }}"]
    for number in range(random.randint(1, 5)):
        x, y = random.uniform(-12, 12), random.uniform(-12, 12)
        lines += ["[[stage.obstacles]]", f'name = "obstacle {number}"', f"keep_out = {random.choice([0.0, random.uniform(0, 1)])!r}"]
        kind = random.choice(["circle", "polygon", "line"])
        if kind == "circle":
            lines += [f"circle = {{ center = [{x!r}, {y!r}], radius = {random.uniform(0.2, 2)!r} }}"]
        else:
            count = random.randint(3, 8)
            turns = [math.tau * k / count for k in range(count)]
            corners = [[x + (r := random.uniform(0.3, 3)) * math.cos(turn), y + r * math.sin(turn)] for turn in turns]
            lines += [f"{kind} = {corners[::random.choice([1, -1])]}"]
    return "\n".join(lines)


def main():
    program, what, *rest = sys.argv[1:]
    if what != "--random":
        return judge(program, pathlib.Path(what))
    seed, count = map(int, rest)
    with tempfile.TemporaryDirectory() as folder:
        for number in range(count):
            file = pathlib.Path(folder) / "scene.toml"
            file.write_text(random_scene(random.Random(seed + number)))
            try:
                judge(program, file)
            except Exception:
                print(f"seed {seed + number}\n{file.read_text()}")
                raise


main()
