"""A show of several dragons in one scene on the page, in the same browser and with the same arguments as stage_picture.py:

    stage_dragons.py SCENARIO PROGRAM NAME

Places are those of `solve`; distances between boards are computed here, by shapely.
"""

import csv
import re
import subprocess
import tempfile

import numpy
import shapely

from chromium import at_rest
from stage_labels import SIZES, distances, points_of
from stage_picture import BODY_LENGTH, HEAD_LENGTH, PROGRAM, WIDTH, browser, canvas_pixels, drawn, is_board, play, server, started, until, words
from stage_show import projection, risen, shot
from stage_transport import command

COIL = ["--scene", "config/coil.toml"]
NAMES = ["gold", "jade"]
# Handles of each dragon of that scene, and its contact.
HANDLES, CONTACT = 61, 335.726813723


def handles_at(second):
    """Returns the handles of each dragon from `solve`, which numbers them through."""
    printed = subprocess.run([PROGRAM, *COIL, "solve", "--at", str(second)], capture_output=True, text=True, check=True).stdout
    rows = [[float(row["x"]), float(row["y"])] for row in csv.DictReader(printed.splitlines())]
    assert len(rows) == 2 * HANDLES, len(rows)
    return [numpy.array(rows[:HANDLES]), numpy.array(rows[HANDLES:])]


def board(handles, bench):
    """Returns the rectangle of a bench."""
    front, rear = handles[bench], handles[bench + 1]
    along = (front - rear) / numpy.linalg.norm(front - rear)
    middle, half = (front + rear) / 2, (HEAD_LENGTH if bench == 0 else BODY_LENGTH) / 2
    across = WIDTH / 2 * numpy.array([-along[1], along[0]])
    return shapely.Polygon([middle + half * along + across, middle - half * along + across, middle - half * along - across, middle + half * along - across])


def nearest(dragons):
    """Returns the distance of the nearest two boards that share no handle, of all dragons, and their names."""
    boards = [(dragon, bench, board(handles, bench)) for dragon, handles in enumerate(dragons) for bench in range(HANDLES - 1)]
    pairs = ((one, other) for k, one in enumerate(boards) for other in boards[:k] if one[0] != other[0] or one[1] - other[1] > 1)
    name = lambda dragon, bench: f"{'HEAD (bench 1)' if bench == 0 else f'bench {bench + 1}'} of {NAMES[dragon]}"
    return min((one[2].distance(other[2]), {name(*one[:2]), name(*other[:2])}) for one, other in pairs)


def show(*arguments):
    return started(*COIL, "run", "--quiet", "--json", *arguments)


def both_drawn(page):
    until(page, "picture.dragons.length === 2 && picture.dragons.every((one) => one.head !== null) && picture.drawn > 0", "both dragons")


def row(page, name):
    return page.locator("#dragons li", has_text=name).inner_text()


def one_page_of_two():
    """Boards, names, one countdown and one transport; a bench is that of its dragon; marks and lines between dragons."""
    with server() as url, show("--start", "300", "--paused"), browser(viewport={"width": 1600, "height": 900}) as (page, complaints):
        page.goto(f"{url}#nolabels")
        both_drawn(page)
        assert page.evaluate("picture.dragons.map((one) => one.name)") == NAMES
        dragons = handles_at(300)
        boards_are_drawn(page, dragons)
        assert page.locator("#countdown").count() == 1 and "PAUSED" in page.inner_text("#playback")
        seconds = float(re.search(r"[\d.]+", page.inner_text("#left")).group())
        assert abs(seconds - (CONTACT - 300)) < 0.06, seconds
        # A click on the head of jade.
        page.goto("about:blank")
        page.goto(url)
        both_drawn(page)
        to_pixel = projection(page)
        page.mouse.click(*to_pixel(*((dragons[1][0] + dragons[1][1]) / 2)))
        until(page, "document.getElementById('bench').textContent.startsWith('Bench 1 of 60 of jade, the head')", "the head of jade")
        until(page, "document.querySelectorAll('#dragons button')[1].getAttribute('aria-pressed') === 'true'", "its row")
        page.fill("#pick", "60")
        until(page, "document.getElementById('bench').textContent.startsWith('Bench 60 of 60 of jade, the tail')", "the tail of jade")
        x, y = map(float, re.findall(r"-?\d+\.\d+", page.inner_text("#bench"))[:2])
        assert numpy.hypot(*(dragons[1][59] - [x, y])) < 2e-3, (x, y)
        labels = set(page.evaluate("picture.labels.map((one) => one.text)"))
        assert {"HEAD of gold", "HEAD of jade", "TAIL of gold", "bench 60 of jade"} <= labels, labels
        # The line between the nearest two boards, of two dragons.
        metres, _ = nearest(dragons)
        assert f"gold and jade: {metres:.3f}\u00a0m" in labels, f"{metres} is not in {labels}"
        assert abs(float(page.inner_text("#metres").split()[0]) - metres) < 6e-4, page.inner_text("#metres")
        approach(page)
        assert not complaints, complaints


def two_are_drawn_apart():
    """Two dragons of one path, one of them moved, turned round and mirrored: each is where its placement states, and no
    board is drawn elsewhere."""
    dragon = """
[[dragons]]
name = "{name}"
placement = {{ origin = [{x}, {y}], rotation_turns = {turns}, mirror = {mirror} }}
[dragons.team]
benches = 40
head_length = 3.41
body_length = 2.2
width = 0.3
hole_inset = 0.275
[dragons.path]
kind = "spiral"
pitch = 0.55
start_turn = 10
[dragons.motion]
head_speed = 1.0
"""
    text = "[alerts]\n" + dragon.format(name="gold", x=0.0, y=0.0, turns=0.0, mirror="false") + dragon.format(name="jade", x=15.0, y=-3.0, turns=0.3, mirror="true")
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", suffix=".toml") as scene:
        scene.write(text)
        scene.flush()
        printed = subprocess.run([PROGRAM, "--scene", scene.name, "solve", "--at", "20"], capture_output=True, text=True, check=True).stdout
        rows = numpy.array([[float(row["x"]), float(row["y"])] for row in csv.DictReader(printed.splitlines())])
        gold, jade = rows[:41], rows[41:]
        # The placement by hand: mirrored, then turned, then moved.
        c, s = numpy.cos(0.6 * numpy.pi), numpy.sin(0.6 * numpy.pi)
        placed = (gold * [1, -1]) @ numpy.array([[c, s], [-s, c]]) + [15, -3]
        assert numpy.abs(placed - jade).max() < 1e-9, numpy.abs(placed - jade).max()
        with server() as url, started("--scene", scene.name, "run", "--quiet", "--json", "--start", "20", "--paused"), browser(viewport={"width": 1600, "height": 900}) as (page, complaints):
            page.goto(f"{url}#nolabels")
            both_drawn(page)
            boards_are_drawn(page, [gold, placed], benches=40)
            pixels, to_pixel, scale = canvas_pixels(page)
            # Nothing that is a board lies between the two: away from all boards there are only ground and paths.
            both = shapely.union_all([board(handles, bench) for handles in (gold, placed) for bench in range(40)]).buffer(0.3)
            aisle = [(x, y) for x in numpy.linspace(-7, 22, 150) for y in numpy.linspace(-9, 6, 80) if not both.contains(shapely.Point(x, y))]
            at = to_pixel(numpy.array(aisle))
            inside = (at[:, 0] > 0) & (at[:, 1] > 0) & (at[:, 0] < pixels.shape[1]) & (at[:, 1] < pixels.shape[0])
            strays = is_board(pixels[at[inside, 1], at[inside, 0]])
            # The line between the nearest two boards and the scale are dark too.
            assert strays.mean() < 0.01, f"boards are drawn at {100 * strays.mean():.1f} % of the free places"
            assert not complaints, complaints


def boards_are_drawn(page, dragons, benches=HANDLES - 1):
    # The camera eases to its frame; a show that stands has the same picture from then on.
    at_rest(page)
    pixels, to_pixel, _ = canvas_pixels(page)
    for name, handles in zip(NAMES, dragons):
        middles = to_pixel((handles[:-1] + handles[1:]) / 2)
        missing = [bench for bench, (x, y) in enumerate(middles[1:-1], 1) if not is_board(pixels[y, x])]
        assert not missing, f"{name}: no board is drawn where benches {missing} (from 0) are"
    # Nothing joins the tail of gold and the head of jade, whose handles follow each other.
    between = to_pixel(numpy.array([dragons[0][-1] + share * (dragons[1][0] - dragons[0][-1]) for share in numpy.linspace(0.02, 0.98, 200)]))
    both = shapely.union_all([board(handles, bench) for handles in dragons for bench in range(benches)]).buffer(0.3)
    free = [place for place, share in zip(between, numpy.linspace(0.02, 0.98, 200)) if not both.contains(shapely.Point(dragons[0][-1] + share * (dragons[1][0] - dragons[0][-1])))]
    assert len(free) > 50 and not any(is_board(pixels[y, x]) for x, y in free), "a board between two dragons"


def approach(page):
    """Before the contact of the two heads both are outlined and named; at the contact both touch."""
    command("seek", 333)
    until(page, "document.body.dataset.level === 'approaching' && picture.marks.length === 4", "marks of both dragons")
    metres, pair = nearest(handles_at(333))
    expected = [f"{metres:.3f}\u00a0m", "HEAD (bench 1) of gold", "HEAD (bench 1) of jade", *pair]
    until(page, f"{expected}.every((one) => picture.labels.some(({{text}}) => text === one))", f"the words {expected}")
    alert = page.get_by_role("alert").inner_text()
    assert "bench 1 (the head) of gold and bench 1 (the head) of jade" in alert, alert
    long_name_is_cut(page)
    assert "approaching" in row(page, "gold") and "approaching" in row(page, "jade"), words(page)
    command("seek", 335.6)
    command("resume")
    until(page, "document.body.dataset.level === 'contact'", "the contact")
    until(page, "document.getElementById('now').textContent === 'Bench 1 of gold and bench 1 of jade touch'", "what touches")
    assert "contact" in row(page, "gold") and "contact" in row(page, "jade"), words(page)


def long_name_is_cut(page):
    """In a low window, where the state and the name share a line, a long name leaves the state free."""
    size = page.viewport_size
    page.set_viewport_size({"width": 1120, "height": 630})
    state, name = page.evaluate("""() => {
        const name = document.getElementById("name"), range = document.createRange();
        name.textContent = "a show with a long name · a_publisher_with_a_long_name_too";
        range.selectNodeContents(document.getElementById("state"));
        return [range.getBoundingClientRect().right, name.getBoundingClientRect().left];
    }""")
    assert state <= name, f"the state ends at {state}, the name begins at {name}"
    page.set_viewport_size(size)


def labels_of_two_point_at_their_boards():
    """In five windows no label of a dragon's bench is nearer to another board of any dragon."""
    count = 0
    with server() as url, show("--start", "300", "--paused"), browser(viewport={"width": 1280, "height": 720}) as (page, complaints):
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            page.goto("about:blank")
            page.goto(f"{url}#keys")
            both_drawn(page)
            for moment in (320, 330, 334):
                command("seek", moment)
                until(page, f"Math.abs(picture.time - {moment}) < 0.01 && picture.shown && Math.abs(picture.shown.time - {moment}) < 0.01", f"the picture of {moment} s")
                page.keyboard.press("0")
                at_rest(page)
                found = labels_of_two(page)
                assert len(found) >= 2, f"{width} x {height} at {moment} s: {found}"
                for label, near in found:
                    own = (label["dragon"], label["bench"])
                    assert near == own, f"{width} x {height} at {moment} s: {label['text']!r} is nearest to bench {near}, not {own}"
                count += len(found)
        assert count >= 40, f"only {count} labels were measured"
        assert not complaints, complaints


def labels_of_two(page):
    """Returns each bench's label with the dragon and the bench of the board that it points at."""
    dragons, origin, right, up, labels = page.evaluate(
        "[picture.dragons.map((one) => [...one.shown.handles]), picture.toPixel(0, 0), picture.toPixel(1, 0), picture.toPixel(0, 1), picture.labels]"
    )
    origin, right, up = map(numpy.array, (origin, right, up))
    scale, found = numpy.hypot(*(right - origin)), []
    for label in labels:
        if label.get("bench") is None:
            continue
        nearest = []
        for dragon, places in enumerate(dragons):
            handles = numpy.array(places).reshape(-1, 5)[:, :2]
            handles = origin + handles[:, :1] * (right - origin) + handles[:, 1:] * (up - origin)
            away = distances(points_of(label), handles, scale).min(axis=0)
            nearest.append((away.min(), dragon, int(away.argmin())))
        found.append((label, min(nearest)[1:]))
    return found


def colours_along(pixels, handles, to_pixel):
    """Returns the mean colour of the outer lanterns of a dragon's body, in red, green and blue."""
    places = []
    for bench in range(2, HANDLES - 2):
        front, rear = handles[bench], handles[bench + 1]
        along = (front - rear) / numpy.linalg.norm(front - rear)
        places += [(front + rear) / 2 + side * 0.41 * BODY_LENGTH / 2 * along for side in (1, -1)]
    at = numpy.array([to_pixel(*place) for place in places]).round().astype(int)
    inside = ((at >= 2) & (at < [pixels.shape[1] - 2, pixels.shape[0] - 2])).all(axis=1)
    # The middle of a lantern is white; around it is its paper.
    around = numpy.concatenate([pixels[at[inside, 1] + down, at[inside, 0] + right, :3] for right, down in [(2, 0), (-2, 0), (0, 2), (0, -2)]])
    return around.astype(float).mean(axis=0)


def each_has_its_light():
    """In the show look each dragon has lanterns in its own colour, and in the seat too; no words."""
    with server() as url, show("--start", "300", "--paused"), browser(reduced_motion="reduce") as (page, complaints):
        dragons = handles_at(300)
        for address in ("show", "seat"):
            page.goto("about:blank")
            page.goto(f"{url}#{address}")
            both_drawn(page)
            risen(page)
            pixels = shot(page)
            # Above the floor, by the middle of a lantern.
            height = [1.18 + 0.32] if address == "seat" else []
            to_pixel = lambda x, y: page.evaluate("(place) => picture.toPixel(...place)", [x, y, *height])
            gold, jade = (colours_along(pixels, handles, to_pixel) for handles in dragons)
            print(f"{address}: gold's lanterns are {gold}, jade's {jade}")
            # In the seat dancers and other lanterns stand before some.
            assert gold[0] > gold[1] + 15 and gold[1] > gold[2] + 30, f"{address}: gold's lanterns are {gold}"
            assert jade[1] / jade[0] > gold[1] / gold[0] + 0.08, f"{address}: gold's lanterns are {gold}, jade's {jade}"
            assert jade[2] / jade[0] > gold[2] / gold[0] + 0.08, f"{address}: gold's lanterns are {gold}, jade's {jade}"
            assert page.evaluate("picture.labels.length") == 0
        assert not complaints, complaints


if __name__ == "__main__":
    play(one_page_of_two, two_are_drawn_apart, labels_of_two_point_at_their_boards, each_has_its_light)
