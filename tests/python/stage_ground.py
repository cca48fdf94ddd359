"""Obstacles, their keep-outs and the boundary on the page, in the same browser and with the same arguments as
stage_picture.py:

    stage_ground.py SCENARIO PROGRAM NAME
"""

import pathlib
import tempfile

import numpy
import shapely

from stage_dragons import board
from stage_labels import SIZES
from stage_picture import browser, canvas_pixels, drawn, play, server, started, until, words
from stage_show import luminance
from stage_transport import command

SQUARE = "config/square.toml"
# The obstacles and the boundary of that scene, in metres.
WELL, KERB, WELL_KEEP_OUT = (-3.9, 0.1), 1.6, 1.5
SPECTATORS, SPECTATORS_KEEP_OUT = numpy.array([[-9.0, 12.0], [9.0, 12.0]]), 1.5
BOUNDARY = numpy.array([[-20, 15], [20, 15], [20, -15], [-12.5, -15]], float)


def circle(radius, count=600):
    turns = numpy.linspace(0, 2 * numpy.pi, count, endpoint=False)
    return numpy.array(WELL) + radius * numpy.stack([numpy.cos(turns), numpy.sin(turns)], axis=1)


def along(start, end, aside=0.0, count=600):
    """Returns places along a side, `aside` metres to its left."""
    way = (end - start) / numpy.linalg.norm(end - start)
    return start + numpy.linspace(0.02, 0.98, count)[:, None] * (end - start) + aside * numpy.array([-way[1], way[0]])


# All obstacles of that scene: their outlines, and the distances that boards keep.
OBSTACLES = [
    ("well", shapely.Point(WELL), KERB + WELL_KEEP_OUT),
    ("camphor tree", shapely.Point(2.6, 0), 0.8 + 1),
    ("courtyard wall", shapely.box(16.7, -9, 17.3, 9), 1),
    ("northern spectators", shapely.LineString([[-9, 12], [9, 12], [12, 11.35]]), SPECTATORS_KEEP_OUT),
    ("southern spectators", shapely.LineString([[-8, -12], [10, -12]]), SPECTATORS_KEEP_OUT),
    ("lantern post", shapely.Point(-13.1, -3), 0.2 + 1.2),
    ("boundary", shapely.LinearRing([[-20, -15], [-17.5, -15], [-17.5, -60], [-12.5, -60], [-12.5, -15], [20, -15], [20, 15], [-20, 15]]), 1),
]
# Both lines are there: between two boards, and to an obstacle.
LINES = "[false, true].every((to) => picture.marks.some(({kind, obstacle, line}) => kind === 'nearest' && line && Boolean(obstacle) === to))"


def dark(light, to_pixel, places, ground):
    """Returns the share of places at which a line is drawn."""
    at = to_pixel(places)
    # The line may lie between two pixels.
    near = numpy.min([light[at[:, 1] + down, at[:, 0] + right] for right in (-1, 0, 1) for down in (-1, 0, 1)], axis=0)
    return float(numpy.mean(near < ground - 0.25))


def obstacles_are_drawn():
    with server() as url, started("--scene", SQUARE, "run", "--quiet", "--json", "--start", "100", "--paused"), browser() as (page, complaints):
        page.goto(f"{url}#nolabels,view=0,0,36")
        drawn(page)
        pixels, to_pixel, scale = canvas_pixels(page)
        light, pixel = luminance(pixels), 1 / scale
        ground = float(light[tuple(to_pixel(numpy.array([8.0, -4.0]))[::-1])])
        at = lambda *place: float(light[tuple(to_pixel(numpy.array(place))[::-1])])
        assert ground > 0.85, ground
        # The well is filled, its keep-out is paler, and the ground beyond is free.
        inside, band, beyond = at(*WELL), at(WELL[0], KERB + 0.8), at(WELL[0], KERB + WELL_KEEP_OUT + 0.35)
        assert inside < band - 0.05 < ground - 0.07 and abs(beyond - ground) < 0.02, (inside, band, beyond, ground)
        # Outlines are whole lines; keep-outs have dashes around them.
        for what, places in [("the kerb", circle(KERB)), ("the spectators", along(*SPECTATORS)), *((f"side {k} of the boundary", along(*BOUNDARY[k : k + 2])) for k in range(3))]:
            share = dark(light, to_pixel, places, ground)
            assert share > 0.9, f"{what}: a line on {100 * share:.0f} %"
        rims = [circle(KERB + WELL_KEEP_OUT + pixel / 2), along(*SPECTATORS, -SPECTATORS_KEEP_OUT - pixel / 2), along(*BOUNDARY[:2], -1 - pixel / 2)]
        for rim in rims:
            share = dark(light, to_pixel, rim, ground)
            assert 0.35 < share < 0.95, f"dashes on {100 * share:.0f} %"
        within = [circle(KERB + WELL_KEEP_OUT - 4 * pixel), along(*SPECTATORS, -SPECTATORS_KEEP_OUT + 4 * pixel)]
        assert not any(dark(light, to_pixel, line, ground) for line in within), "dashes within a keep-out"
        page.goto("about:blank")
        page.goto(f"{url}#view=0,0,36")
        drawn(page)
        names = {"well", "camphor tree", "courtyard wall", "northern spectators", "southern spectators", "lantern post"}
        until(page, f"{sorted(names)}.every((name) => picture.labels.some(({{text}}) => text === name))", "the names of all obstacles")
        # Each line is seen: it ends beyond the plate of its words.
        plates = page.evaluate("picture.labels.map(({text, x, y, half, tall, end}) => [text, end && Math.max(Math.abs(end.x - x) - half, Math.abs(end.y - y) - tall)])")
        assert {text for text, _ in plates} >= names and all(beyond is None or beyond > 2 for text, beyond in plates if text in names), plates
        assert not any("boundary" in text for text in page.evaluate("picture.labels.map(({text}) => text)"))
        # The whole of it: boards and obstacles, also where no board is yet.
        page.goto("about:blank")
        page.goto(url)
        drawn(page)
        pixels, to_pixel, _ = canvas_pixels(page)
        for place in [*SPECTATORS, *circle(KERB)]:
            across, down = to_pixel(numpy.array(place))
            assert 0 < across < pixels.shape[1] and 0 < down < pixels.shape[0], (place, across, down)
        # The head passes the northern spectators within the warning's distance.
        command("seek", 55.8)
        until(page, "document.body.dataset.level === 'approaching'", "an approach")
        alert = page.get_by_role("alert").inner_text()
        assert "nearest now are bench 1 (the head) and the northern spectators" in alert, alert
        until(page, "document.getElementById('metres').textContent === '0.103 m'", "the clearance beyond the keep-out")
        least = until(page, "document.getElementById('curve').getAttribute('aria-label')", "the clearance curve")
        assert "least clearance 0.103 m at 55.8 s, bench 1 and the northern spectators" in least, least
        assert not complaints, complaints


def lines_join_what_is_nearest():
    """In calm motion and while the show stands, lines join the two nearest boards, and a board and the edge of the
    nearest keep-out. This test computes their metres from the drawn places."""
    with server() as url, started("--scene", SQUARE, "run", "--quiet", "--json", "--start", "95", "--time-scale", "0.05"), browser() as (page, complaints):
        page.goto(url)
        drawn(page)
        until(page, LINES, "both lines in motion")
        handles, marks, labels, level, playback = page.evaluate(
            "[[...picture.shown.handles], picture.marks, picture.labels.map(({text}) => text), document.body.dataset.level, document.getElementById('playback').textContent]"
        )
        assert level == "moving" and "PLAYING" in playback, (level, playback)
        handles = numpy.array(handles).reshape(-1, 5)[:, :2]
        boards = [board(handles, bench) for bench in range(len(handles) - 1)]
        pair = next(mark for mark in marks if mark["kind"] == "nearest" and not mark.get("obstacle"))
        one, other = pair["benches"]
        assert abs(boards[one].distance(boards[other]) - pair["place"]["away"]) < 1e-6, pair
        # The search is a moment old.
        least = min(boards[a].distance(boards[b]) for a in range(len(boards)) for b in range(a - 1))
        assert least - 1e-6 < pair["place"]["away"] < least + 0.02, (least, pair)
        met = next(mark for mark in marks if mark.get("obstacle"))
        away = {name: min(one.distance(shape) for one in boards) - keep for name, shape, keep in OBSTACLES}
        name = min(away, key=away.get)
        assert met["obstacle"]["name"] == name and away[name] - 1e-6 < met["place"]["away"] < away[name] + 0.02, (away, met)
        beyond, keep_out = met["place"]["away"], met["obstacle"]["keep_out"]
        words = f"{beyond + keep_out:.3f}\u00a0m to the {met['obstacle']['name']}"
        if keep_out > 0:
            words += f", {beyond:.3f}\u00a0m beyond its keep-out"
        assert met["text"].startswith(words), met
        assert pair["text"] == f"{pair['place']['away']:.3f}\u00a0m", pair
        # Both are lines: their ends are as far apart as their words state, and the second line begins on the board of
        # its bench.
        for mark in (pair, met):
            start, end = (numpy.array([place["x"], place["y"]]) for place in mark["line"])
            assert abs(numpy.hypot(*(end - start)) - mark["place"]["away"]) < 1e-6, mark
        start = shapely.Point(met["line"][0]["x"], met["line"][0]["y"])
        # The handles are of 32 bits, which is a micrometre here, and the page and this test make boards of them each in
        # its own way.
        assert boards[met["benches"][0]].distance(start) < 1e-5, met
        # The panel's clearance is the least of both.
        command("pause")
        until(page, "document.getElementById('playback').textContent.includes('PAUSED')", "a pause")
        until(page, f"({LINES}) && Math.abs(Math.min(...picture.marks.filter(({{kind}}) => kind === 'nearest').map(({{place}}) => place.away)) - parseFloat(document.getElementById('metres').textContent)) < 6e-4",
              "the clearance of the panel as the shorter line")
        assert not complaints, complaints


def curve_stays_in_its_place():
    """The curve of the clearance covers no other part of the panel while the show plays, at any size that shows it. Its
    words are whole and below it."""
    with server() as url, started("--scene", SQUARE, "run", "--quiet", "--json", "--start", "95", "--time-scale", "0.05"), browser() as (page, complaints):
        for width, height in [*SIZES, (1280, 800), (1366, 768), (1600, 900)]:
            page.set_viewport_size({"width": width, "height": height})
            page.goto("about:blank")
            page.goto(f"{url}#keys")
            drawn(page)
            until(page, "!document.getElementById('curve').hidden && ['time', 'rate', 'metres'].every((id) => document.getElementById(id).textContent)", "the curve and all figures")
            box, path, high = page.evaluate("""["#curve", "#curve path", "#curve svg"].map((one) => {
                const {left, top, right, bottom} = document.querySelector(one).getBoundingClientRect();
                return one === "#curve svg" ? bottom - top : [left, top, right, bottom];
            })""")
            if high == 0:
                assert height < 672 and width > height, f"{width} x {height}: no curve"
                continue
            assert high > 20, f"{width} x {height}: {high} px high"
            inside = path[0] > box[0] - 2 and path[1] > box[1] - 2 and path[2] < box[2] + 2 and path[3] < box[3] + 2
            assert inside, f"{width} x {height}: the curve is at {path}, its place at {box}"
            said, left, top, right, bottom, wide, seen, below = page.evaluate("""() => {
                const words = document.querySelector("#curve span"), range = document.createRange();
                range.selectNodeContents(words);
                const {left, top, right, bottom} = range.getBoundingClientRect();
                const below = document.getElementById("curve").nextElementSibling.getBoundingClientRect().top;
                return [words.textContent, left, top, right, bottom, words.scrollWidth, words.clientWidth, below];
            }""")
            hidden = page.evaluate("(({scrollHeight, clientHeight}) => scrollHeight - clientHeight)(document.querySelector('footer'))")
            assert hidden <= 0 or (width, height) != (1600, 900), f"the panel scrolls: {hidden} px are hidden"
            place = f"{width} x {height}: {said!r} is at {[left, top, right, bottom]}, the curve at {path}, what follows at {below}"
            assert said.endswith("spectators") and wide <= seen and box[0] - 1 <= left and right <= box[2] + 1, place
            assert path[3] - 2 < top and bottom <= below, place
        assert not complaints, complaints


def a_board_meets_an_obstacle():
    """A stage whose lamp stands in the way: the countdown, the mark and the words name the lamp."""
    text = pathlib.Path("tests/compute/ground.toml").read_text(encoding="utf-8").replace("center = [4.0, 3.5]", "center = [4.0, 2.9]")
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", suffix=".toml") as scene:
        scene.write(text)
        scene.flush()
        with server() as url, started("--scene", scene.name, "run", "--quiet", "--json", "--start", "0", "--paused"), browser() as (page, complaints):
            page.goto(url)
            drawn(page)
            until(page, "document.getElementById('until').textContent === 'Obstacle ahead'", "the coming obstacle")
            seconds = float(page.inner_text("#left").split()[0].rstrip("s"))
            command("seek", seconds - 3)
            until(page, "document.body.dataset.level === 'approaching'", "an approach")
            coming = until(page, "picture.marks.find(({kind}) => kind === 'coming')?.text", "the mark of what comes")
            assert coming.startswith("obstacle: bench 1 and the stone lamp, here, in 3."), coming
            command("resume")
            until(page, "document.body.dataset.level === 'obstacle'", "the obstacle")
            alert = page.get_by_role("alert").inner_text()
            assert alert.startswith("Bench 1 (the head) met the stone lamp at ("), alert
            assert "OBSTACLE" in page.inner_text("#state").upper() and "ENDED" in page.inner_text("#playback"), words(page)
            place = page.evaluate("picture.marks.find(({kind}) => kind === 'link').place")
            # The touch is on the lamp's keep-out, 0.5 m around 0.4 m.
            away = numpy.hypot(place["x"] - 4.0, place["y"] - 2.9)
            assert abs(away - 0.9) < 0.001, f"{place}, {away} m"
            assert not complaints, complaints


if __name__ == "__main__":
    play(obstacles_are_drawn, lines_join_what_is_nearest, curve_stays_in_its_place, a_board_meets_an_obstacle)
