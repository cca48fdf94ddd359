"""Villages for `plan fit`: ten scenes from a bad start, how many it solves, and how long it takes.

    cargo build --release
    .venv/bin/python benches/fit.py                 # the figures of docs/paths-and-plans.md
    .venv/bin/python benches/fit.py 2               # with another seed
    .venv/bin/python benches/fit.py known           # the margins of the numbers that each village was designed with
    .venv/bin/python benches/fit.py write DIRECTORY # the scenes with their bad starts, and a list of them

Every village was designed with numbers that keep everything that is required. They were then changed, so that boards
overlap, come into keep-outs or lock. The search knows neither the numbers of the design nor that they exist: it is
given ranges as an organiser would give them. `check` judges the answer. In two villages four numbers have to be right
at once within few decimetres: the courtyard, and the coil between two trees. Uses the release build alone.
"""

import json
import os
import pathlib
import resource
import string
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[1]
PROGRAM = os.environ.get("BENCH_DRAGON", ROOT / "target" / "release" / "bench-dragon")

# By name, the numbers $a to $d and the scene. Of each number the field, the design's, that of the bad start, the range.
VILLAGES = {}


def village(name, team, clearance, path, ground, *numbers, boundary="", rest=""):
    obstacles = "".join(f'    {{ name = "{what}", {shape}, keep_out = {away} }},\n' for what, shape, away in ground)
    VILLAGES[name] = numbers, string.Template(
        f'name = "{name}"\nteam = {{ {team} }}\nrequire = {{ clearance = {clearance} }}\n'
        f"motion.head_speed = 1.0\n{rest}\n[path]\n{path}\n[stage]\n{boundary}\nobstacles = [\n{obstacles}]\n")


def route(*pieces, start="[0.0, 0.0]", heading=0.0):
    pieces = [piece for some in pieces for piece in (some if isinstance(some, list) else [some])]
    lines = "".join(f"    {{ {piece} }},\n" for piece in pieces)
    return f'kind = "pieces"\nstart = {start}\nheading_turns = {heading}\npieces = [\n{lines}]'


def line(length):
    return f'kind = "line", length = {length}'


def arc(side, radius, turns):
    return f'kind = "arc", side = "{side}", radius = {radius}, turns = {turns}'


def coil(side, pitch, radius, to_radius, out, arc_ratio=1.0):
    """A coil, the turn in its middle, and the way out, whose end is `out` metres from the middle."""
    rounds = f'direction = "in", side = "{side}", pitch = {pitch}, radius = {radius}, to_radius = {to_radius}'
    return [f'kind = "spiral", {rounds}', f'kind = "turn", arc_ratio = {arc_ratio}',
            f'kind = "spiral", to_radius = {out}']


def circle(x, y, radius):
    return f"circle = {{ center = [{x}, {y}], radius = {radius} }}"


def row(*corners):
    return f"line = {[list(corner) for corner in corners]}"


def block(x, y, to_x, to_y):
    return f"polygon = {[[x, y], [to_x, y], [to_x, to_y], [x, to_y]]}"


village(
    "market", "benches = 64, head_length = 3.0, body_length = 2.3, width = 0.35", 0.20,
    route(line(18.0), coil("right", "$a", "$b", "$c", out=6.5), line(150.0), start="[-3.0, 14.55]"),
    [("northern spectators", row((4, 16), (26, 16)), 1.0), ("southern spectators", row((4, 0), (26, 0)), 1.0)],
    ("path.pieces[1].pitch", 1.8, 1.4, (1.3, 2.4)),
    ("path.pieces[1].radius", 6.5, 7.2, (5.5, 7.5)),
    ("path.pieces[1].to_radius", 3.1, 2.7, (2.0, 4.5)),
    boundary="""boundary = { polygon = [[0, 0], [30, 0], [30, 0.3], [200, 0.3], [200, 3.6], [30, 3.6], [30, 16],
    [0, 16], [0, 15.6], [-140, 15.6], [-140, 13.4], [0, 13.4]] }""")

village(
    "lime tree", "benches = 48", 0.15,
    route(line(12.0), coil("left", "$b", "$c", 3.1, out=6.0), line(90.0), start="[$a, -2.0]", heading=0.25),
    [("lime tree", circle(14.0, 18.2, 0.8), 1.0), ("eastern spectators", row((22, 0), (22, 20)), 1.5),
     ("western spectators", row((5.6, 0), (5.6, 20)), 1.5)],
    ("path.start[0]", 20.0, 20.9, (17.0, 23.0)),
    ("path.pieces[1].pitch", 1.75, 1.3, (1.2, 2.2)),
    ("path.pieces[1].radius", 6.0, 7.2, (4.5, 7.5)))

village(
    "carp",
    "benches = 40, head_length = 3.6, head_width = 1.0, tail_length = 3.2, tail_width = 0.7, width = 0.35", 0.25,
    route(line(14.0), coil("right", "$a", 8.0, "$b", out=8.0, arc_ratio="$c"), line(90.0), start="[-14.0, 8.0]"),
    [("lamp", circle(0.0, 10.8, 0.1), 1.0)],
    ("path.pieces[1].pitch", 2.8, 1.6, (1.5, 3.2)),
    ("path.pieces[1].to_radius", 4.4, 2.9, (2.5, 5.5)),
    ("path.pieces[2].arc_ratio", 1.0, 1.9, (0.7, 2.2)),
    boundary="""boundary = { polygon = [[-11, -6], [-6, -11], [6, -11], [8, -9.5], [130, -9.5], [130, -6.5], [11, -6.5],
    [11, 6], [6, 11], [-6, 11], [-8, 9.5], [-120, 9.5], [-120, 6.5], [-11, 6.5]], keep_out = 0.3 }""")

village(
    "well and lanes", "benches = 30", 0.20,
    route(line("$a"), arc("right", 5.0, 0.25), line("$b"), arc("right", "$c", 0.5), line(4.0), arc("left", 4.0, 0.5),
          line(40.0), start="[0.0, -10.0]", heading=0.25),
    [("well", circle(15.0, 4.0, 2.5), 1.5), ("young tree", circle(4.2, 4.8, 0.4), 2.4),
     ("lamp", circle(11.0, -5.0, 0.3), 2.5), ("northern spectators", row((2, 11.5), (20, 11.5)), 1.5),
     ("eastern spectators", row((22.5, -6), (22.5, 11.5)), 1.5),
     ("southern spectators", row((2, -11.5), (20, -11.5)), 1.5)],
    ("path.pieces[0].length", 14.0, 16.0, (10.0, 20.0)),
    ("path.pieces[2].length", 10.0, 12.0, (6.0, 14.0)),
    ("path.pieces[3].radius", 5.0, 6.2, (3.0, 7.0)))

village(
    "pond", "benches = 120", 0.20,
    'kind = "turnaround"\npitch = $a\nturn_radius = $b\narc_ratio = $c\nlead_in = 60.0',
    [("pond", circle(19.0, 0.0, 2.0), 1.0), ("house", block(-22, -3, -17.5, 4), 1.0)],
    ("path.pitch", 1.8, 1.2, (1.1, 2.8)),
    ("path.turn_radius", 4.6, 2.4, (2.0, 6.0)),
    ("path.arc_ratio", 1.5, 2.3, (1.0, 2.5)))

village(
    "flower beds", "benches = 60", 0.30,
    route(line("$a"), arc("left", "$b", 0.5), line(20.0), arc("right", "$c", 0.5), line(20.0), arc("left", 4.0, 0.5),
          line(110.0), start="[-20.0, 0.0]"),
    [("first bed", block(-6, 3, 6, 5), 2.0), ("second bed", block(-6, 11, 6, 13), 2.0),
     ("third bed", block(-6, 19, 6, 21), 2.0)],
    ("path.pieces[0].length", 30.0, 33.0, (24.0, 38.0)),
    ("path.pieces[1].radius", 4.0, 4.8, (2.5, 6.0)),
    ("path.pieces[3].radius", 4.0, 3.2, (2.5, 6.0)),
    boundary="""boundary = { polygon = [[-16, -3], [15.6, -3], [15.6, 26], [-16, 26], [-16, 25.9], [-120, 25.9],
    [-120, 22], [-16, 22], [-16, 2], [-130, 2], [-130, -2], [-16, -2]], keep_out = 0.8 }""")

village(
    "phoenix", "benches = 75, head_length = 3.8, head_width = 0.8, tail_length = 4.5, tail_width = 0.9", 0.20,
    route(line("$a"), arc("left", 6.0, 0.25), line("$b"), arc("left", "$c", 0.5), line(2.0), arc("right", "$d", 0.5),
          line(150.0)),
    [("tent", block(16, 4, 20, 11), 2.5), ("wall", block(27, -5, 28, 21), 1.5),
     ("northern spectators", row((9, 20), (27, 20)), 1.5), ("plane tree", circle(8.0, 9.0, 0.6), 2.2)],
    ("path.pieces[0].length", 15.0, 16.8, (10.0, 20.0)),
    ("path.pieces[2].length", 6.0, 7.5, (2.0, 10.0)),
    ("path.pieces[3].radius", 6.0, 7.4, (4.0, 8.0)),
    ("path.pieces[5].radius", 4.0, 2.9, (2.5, 6.0)),
    rest="placement = { origin = [3.0, -1.0] }")

village(
    "courtyard", "benches = 44", 0.20,
    route(line("$a"), arc("left", 5.0, 0.25), line("$b"), arc("left", 5.0, 0.25), line("$c"), arc("left", 5.0, 0.25),
          line(8.0), arc("left", 4.5, 0.25), line(3.0), arc("left", "$d", 0.5), start="[14.0, -34.0]", heading=0.25),
    [("well", circle(3.5, -2.5, 2.0), 1.5), ("statue", circle(-4.0, 0.0, 0.5), 2.4),
     ("northern spectators", row((-8, 9.2), (12, 9.2)), 1.8), ("western wall", row((-12.2, -9), (-12.2, 8)), 1.8),
     ("southern spectators", row((-8, -12.2), (9, -12.2)), 1.8), ("lantern", circle(10.8, -8.0, 0.2), 2.6)],
    ("path.pieces[0].length", 36.0, 37.2, (32.0, 40.0)),
    ("path.pieces[2].length", 14.0, 15.6, (10.0, 18.0)),
    ("path.pieces[4].length", 7.0, 8.4, (4.0, 11.0)),
    ("path.pieces[9].radius", 4.0, 5.2, (3.0, 5.5)))

village(
    "two trees", "benches = 100", 0.20,
    route(line("$b"), coil("right", 1.85, "$c", "$d", out=6.0), line(200.0), start="[-30.0, $a]"),
    [("northern spectators", row((-12, 7.5), (12, 7.5)), 1.2),
     ("southern spectators", row((-12, -7.5), (12, -7.5)), 1.2),
     ("western tree", circle(-7.6, 0.0, 0.4), 0.8), ("eastern tree", circle(7.6, 0.0, 0.4), 0.8)],
    ("path.start[1]", 6.0, 6.5, (4.0, 8.0)),
    ("path.pieces[0].length", 30.0, 31.0, (26.0, 34.0)),
    ("path.pieces[1].radius", 6.0, 5.4, (4.5, 7.5)),
    ("path.pieces[1].to_radius", 3.1, 2.5, (2.0, 4.5)))

village(
    "two squares", "benches = 50", 0.20,
    route(line(10.0), coil("left", "$a", 7.0, 3.2, out=7.0), line(14.0), arc("left", "$b", 0.5), line(40.0)),
    [("fountain", circle(70.4, 13.5, 2.0), 1.5), ("spectators", row((72.2, 22.4), (79.2, 15.3)), 1.2)],
    ("path.pieces[1].pitch", 1.8, 1.3, (1.2, 2.6)),
    ("path.pieces[5].radius", 5.0, 7.0, (3.5, 8.0)),
    rest="placement = { origin = [40.0, 10.0], rotation_turns = 0.125, mirror = true }")


def filled(name, number):
    """Returns the scene with the numbers of the design (1) or of the bad start (2)."""
    numbers, scene = VILLAGES[name]
    return scene.substitute({letter: one[number] for letter, one in zip("abcd", numbers)})


def ranges(name):
    return [f"{field}={low}..{high}" for field, _, _, (low, high) in VILLAGES[name][0]]


def lines(command, file):
    done = subprocess.run([PROGRAM, command, file, "--json"], capture_output=True, text=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


def margin(file):
    """Returns the least margin of all that is required, by `check`; minus infinity for a show that locks on its way."""
    required = [line for line in lines("check", file) if line["check"] == "require"]
    locks = any(line["event"] == "lock" for line in lines("events", file))
    if locks or not required or any(line["verdict"] == "undecided" for line in required):
        return float("-inf")
    return min(line["clearance"] - line["required"] for line in required)


def shown(margin):
    return f"{margin:.3f} m" if margin > float("-inf") else "it locks"


def processor():
    """Returns the processor time of the programs that have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def fitted(name, seed, directory):
    """Returns the margins of the start and of the answer, and the processor time of the search, s."""
    start, answer = (pathlib.Path(directory) / f"{kind}.toml" for kind in ("start", "answer"))
    start.write_text(filled(name, 2))
    # A search that finds nothing writes nothing.
    answer.unlink(missing_ok=True)
    begin = processor()
    subprocess.run([PROGRAM, "plan", "fit", start, "--json", "--seed", seed, "-o", answer]
                   + [word for one in ranges(name) for word in ("--vary", one)], stdout=subprocess.DEVNULL)
    seconds = processor() - begin
    return margin(start), margin(answer) if answer.exists() else float("-inf"), seconds


def table(seed="1"):
    print("| village | benches | numbers free | margin of the start | of the answer | solved | processor time |")
    print("|---|---|---|---|---|---|---|")
    solved, times = 0, []
    with tempfile.TemporaryDirectory() as directory:
        for name, (numbers, scene) in VILLAGES.items():
            benches = scene.template.split("benches = ")[1].split()[0].strip(",")
            before, after, seconds = fitted(name, seed, directory)
            solved += after >= 0
            times.append(seconds)
            print(f"| {name} | {benches} | {len(numbers)} | {shown(before)} | {shown(after)} "
                  f"| {'yes' if after >= 0 else 'no'} | {seconds:.1f} s |", flush=True)
    each = f"{min(times):.1f} to {max(times):.1f} s each"
    print(f"\n{solved} of {len(VILLAGES)} solved, {each}, {sum(times):.0f} s together.")


def known():
    with tempfile.TemporaryDirectory() as directory:
        file = pathlib.Path(directory) / "known.toml"
        for name in VILLAGES:
            file.write_text(filled(name, 1))
            print(f"{name}: {shown(margin(file))}", flush=True)


def write(directory):
    directory = pathlib.Path(directory)
    for name in VILLAGES:
        file = directory / f"{name.replace(' ', '-')}.toml"
        file.write_text(filled(name, 2))
        print(name, file, " ".join(ranges(name)), sep="\t")


if __name__ == "__main__":
    if sys.argv[1:2] == ["known"]:
        known()
    elif sys.argv[1:2] == ["write"]:
        write(sys.argv[2])
    else:
        table(*sys.argv[1:2])
