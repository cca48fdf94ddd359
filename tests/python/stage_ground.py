"""Obstacles, their keep-outs and the boundary on the page, in the same browser and with the same arguments as
stage_picture.py:

    stage_ground.py SCENARIO PROGRAM NAME
"""

import pathlib
import tempfile

import numpy

from stage_picture import browser, canvas_pixels, drawn, play, server, started, until, words
from stage_show import luminance
from stage_transport import command

SQUARE = "config/square.toml"
# Of that scene, in metres.
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
        assert not any("boundary" in text for text in page.evaluate("picture.labels.map(({text}) => text)"))
        # The head passes the northern spectators within the warning's distance.
        command("seek", 55.8)
        until(page, "document.body.dataset.level === 'approaching'", "an approach")
        alert = page.get_by_role("alert").inner_text()
        assert "nearest now are bench 1 (the head) and the northern spectators" in alert, alert
        until(page, "document.getElementById('metres').textContent === '0.103 m'", "the clearance beyond the keep-out")
        least = until(page, "document.getElementById('curve').getAttribute('aria-label')", "the clearance curve")
        assert "least clearance 0.103 m at 55.8 s, bench 1 and the northern spectators" in least, least
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
    play(obstacles_are_drawn, a_board_meets_an_obstacle)
