"""The colours of the boards, by the page's own module in the same browser and with the same arguments as
stage_picture.py:

    stage_colours.py SCENARIO PROGRAM NAME
"""

import json
import re
import subprocess

import numpy

from stage_picture import PROGRAM, browser, play, server

SCENE = "config/turnaround.toml"
# The shade of each bench at each frame, and the colours of all shades.
SHADES = """async (frames) => {
    const { SpeedScale, paletteOf } = await import("/palette.js"), scale = new SpeedScale();
    const shades = frames.map(({ time, handles }) => {
        scale.take({ run: "1", epoch: 0, time, handles: Float64Array.from(handles) });
        return Array.from({ length: handles.length / 5 - 1 }, (_, bench) => scale.shade(bench));
    });
    return [shades, paletteOf(document.documentElement).shades];
}"""


def frames(first, last, step):
    """Returns the frames of the scene, with x, y, heading, vx, vy of each handle."""
    command = [PROGRAM, "solve", "--scene", SCENE, "--every", str(step), "--from", str(first), "--until", str(last), "--json"]
    rows = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    return [{"time": row["t"], "handles": [number for handle in row["handles"] for number in handle[:5]]} for row in map(json.loads, rows)]


def reversals(shades, least=4):
    """Returns the number of times that a series turns back by at least some shades."""
    turns, way, extreme = 0, 0, shades[0]
    for shade in shades:
        if way >= 0 and shade <= extreme - least or way <= 0 and shade >= extreme + least:
            turns += way != 0
            way, extreme = (1 if shade > extreme else -1), shade
        elif way > 0 and shade > extreme or way < 0 and shade < extreme:
            extreme = shade
    return turns


def turns_keep_the_colours_of_boards():
    """Through the turnaround's turn no board changes its colour to and fro; `draw` has the page's colours."""
    assert reversals([0, 9, 0, 9, 8, 9]) == 2 and reversals([5, 4, 5, 6, 5]) == 0 and reversals([0, 3, 6, 9]) == 0
    taken = frames(120, 145, 0.1)
    with server() as url, browser(color_scheme="light") as (page, complaints):
        page.goto(url)
        shades, colours = page.evaluate(SHADES, taken)
        later = numpy.array(shades)[[frame["time"] >= 125 for frame in taken]]
        turns = [reversals(series) for series in later.T.tolist()]
        print(f"reversals of 4 of 32 shades: at most {max(turns)}, {sum(turn > 0 for turn in turns)} of {len(turns)} benches")
        assert later.max() - later.min() >= 8, "all boards have one colour"
        assert max(turns) <= 1, f"bench {turns.index(max(turns)) + 1} changes its colour to and fro {max(turns)} times"
        drawn_alike(shades[100], colours, taken[100]["time"])
        assert not complaints, complaints


def drawn_alike(shades, colours, moment):
    """The colours of `draw` are those of the page, to a rounding of the mean."""
    svg = subprocess.run([PROGRAM, "draw", "--scene", SCENE, "--at", repr(moment)], capture_output=True, text=True, check=True).stdout
    boards = {int(bench): colour for colour, bench in re.findall(r'<polygon[^>]*?fill="(#\w{6})"[^>]*?id="bench-(\d+)"', svg)}
    hexes = ["#" + "".join(f"{int(part):02x}" for part in re.findall(r"\d+", colour)) for colour in colours]
    assert len(boards) == len(shades), f"{len(boards)} boards of {len(shades)}"
    differences = [abs(hexes.index(boards[bench]) - shade) for bench, shade in enumerate(shades)]
    assert max(differences) <= 1 and numpy.mean(differences) < 0.2, f"draw and page differ by up to {max(differences)} shades, {numpy.mean(differences)} on average"


if __name__ == "__main__":
    play(turns_keep_the_colours_of_boards)
