"""Two dragons on one page, in Debian's Chromium: the paper's coil and a procession that passes it.

    several_page.py SCENARIO PROGRAM NAME

Starts a server and publishers under the service names NAME_a and NAME_b. Tests the words and the picture of the page,
and reads the state of the publishers themselves. Ends with exit code 0, or with a sentence on the error.
"""

import contextlib
import csv
import json
import subprocess
import time

import numpy

from chromium import at_rest
from stage_picture import NAME, PROGRAM, WIDTH, browser, canvas_pixels, is_board, opened, passes, play, truth_at, until, words
from stage_show import contrast, luminance, projection, shot

A, B = f"{NAME}_a", f"{NAME}_b"
PROCESSION = ["--scene", "config/procession.toml"]
STILL_A = ["run", "--quiet", "--json", "--start", "300", "--time-scale", "1e-6"]
STILL_B = [*PROCESSION, "run", "--quiet", "--json", "--start", "20", "--time-scale", "1e-6"]
DEFICIENCIES = ("none", "protanopia", "deuteranopia", "tritanopia", "achromatopsia")
# Distance of the middle of the line around a board from the board's edge, pixels.
CASING = 2.5


@contextlib.contextmanager
def started(*arguments):
    child = subprocess.Popen([PROGRAM, *arguments], stdout=subprocess.PIPE, text=True)
    try:
        yield child
    finally:
        child.kill()
        child.wait()


@contextlib.contextmanager
def server(*arguments, port=0):
    with started("--name", A, "--name", B, "view", "--json", "--port", str(port), *arguments) as child:
        yield json.loads(child.stdout.readline())["url"]


def publisher(name, arguments):
    return started("--name", name, *arguments)


def places_of(arguments, second):
    """Returns the places of a scene's handles from `solve`."""
    command = [PROGRAM, *arguments, "solve", "--at", str(second)]
    rows = csv.DictReader(subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines())
    return numpy.array([[float(row["x"]), float(row["y"])] for row in rows])


def both_drawn(page):
    until(page, "picture.dragons.length === 2 && picture.dragons.every((one) => one.head !== null)", "both dragons")
    # The camera moves until both are in the picture.
    at_rest(page)


def row(page, name):
    return page.locator("#dragons li", has_text=name)


def beside(handles, bench, side, pixel):
    """Returns a line of places beside a board, `pixel` pixels beyond its edge, without its rounded ends."""
    front, rear = handles[bench], handles[bench + 1]
    along = (front - rear) / numpy.linalg.norm(front - rear)
    across = numpy.array([-along[1], along[0]])
    start = rear + 0.2 * (front - rear)
    return [start + share * 0.6 * (front - rear) + side * (WIDTH / 2 + CASING * pixel) * across for share in numpy.linspace(0, 1, 25)]


def two_on_one_stage():
    handles = {A: truth_at(300.0), B: places_of(PROCESSION, 20)}
    with server() as url, publisher(A, STILL_A), publisher(B, STILL_B), browser(viewport={"width": 1600, "height": 900}) as (page, complaints):
        # Words would cover some boards.
        page.goto(f"{url}#nolabels")
        both_drawn(page)
        pixels, to_pixel, scale = canvas_pixels(page)
        high, wide = pixels.shape[:2]
        for name, places in handles.items():
            middles = to_pixel((places[:-1] + places[1:]) / 2)
            assert ((middles >= 0) & (middles < [wide, high])).all(), f"{name} is not all in the picture"
            # Both ends have signs on them.
            missing = [bench for bench, (x, y) in enumerate(middles[1:-1], 1) if not is_board(pixels[y, x])]
            assert not missing, f"{name}: no board is drawn where benches {missing} (from 0) are"
        for name in (A, B):
            assert "moving" in row(page, name).inner_text(), words(page)
        assert page.title() == f"{A}, {B}: stage picture", page.title()
        told_apart(page, handles)
        chosen_by_hand(page, handles)
        page.goto("about:blank")
        page.goto(url)
        both_drawn(page)
        labels = page.evaluate("picture.labels.map((one) => one.text)")
        assert {f"{A}: HEAD", f"{B}: HEAD"} <= set(labels), labels
        show, seen = opened(page.context.browser, viewport={"width": 1280, "height": 720})
        show.goto(f"{url}#show")
        both_drawn(show)
        assert show.evaluate("picture.labels.length") == 0, "words in the show look"
        assert not complaints and not seen, complaints + seen


# A square of each dragon's colour, over everything.
SQUARES = """async () => {
    const { identitiesOf } = await import("/palette.js"), all = identitiesOf(Array.from({length: 16}, (_, place) => `d${place}`));
    for (const [place, { colour }] of all.entries()) {
        const square = document.body.appendChild(Object.assign(document.createElement("div"), { className: "square" }));
        square.style.cssText = `position: fixed; left: ${20 * place}px; top: 0; width: 20px; height: 20px; z-index: 9; background: ${colour}`;
    }
    return all.map(({ dashes }) => dashes.join());
}"""


def told_apart(page, handles):
    """The casings differ: one is a whole line, one dashed, both with a contrast of 3 to the ground, in every colour
    vision."""
    vision = page.context.new_cdp_session(page)
    to_pixel = projection(page)
    dashes = page.evaluate(SQUARES)
    assert len(set(dashes)) == 16, f"two of 16 have the same dashes: {dashes}"
    for theme in ("light", "dark"):
        page.emulate_media(color_scheme=theme)
        for deficiency in DEFICIENCIES:
            vision.send("Emulation.setEmulatedVisionDeficiency", {"type": deficiency})
            passes(page)
            deadline = time.monotonic() + 120
            # A dragon whose publisher a busy machine holds up is drawn pale for as long.
            while fault := fault_of_casings(page, handles, to_pixel):
                assert time.monotonic() < deadline, f"{theme}, {deficiency}: {fault}"
    vision.send("Emulation.setEmulatedVisionDeficiency", {"type": "none"})
    page.emulate_media(color_scheme="light")
    page.evaluate("document.querySelectorAll('.square').forEach((one) => one.remove())")


def fault_of_casings(page, handles, to_pixel):
    """Returns the fault of the casings in the picture of the page, or nothing."""
    pixels = shot(page)
    pixel = 1 / numpy.hypot(*(to_pixel(1, 0) - to_pixel(0, 0)))
    box = page.locator("#stage").bounding_box()
    ground = pixels[int(box["y"]) + 3, int(box["x"]) + 3]
    light = luminance(pixels)
    squares = [contrast(pixels[10, 20 * place + 10], ground) for place in range(16)]
    if min(squares) < 3:
        return f"lines with a contrast of {squares}"
    shares = {}
    # The outermost turn of the coil from outside, and the straight part of the procession from both sides.
    for name, benches in [(A, range(193, 219)), (B, range(12, 50))]:
        lines = [numpy.array([to_pixel(*place) for bench in benches for place in beside(handles[name], bench, side, pixel)]) for side in (1, -1)]
        seen = [light[line[:, 1].astype(int), line[:, 0].astype(int)] for line in lines]
        low = float(luminance(ground))
        shares[name] = [float(numpy.mean((numpy.maximum(one, low) + 0.05) / (numpy.minimum(one, low) + 0.05) >= 3)) for one in seen]
    whole, dashed = max(shares[A]), min(shares[B])
    if not (whole > 0.9 and 0.35 < dashed < 0.85 and max(shares[B]) < 0.85):
        return f"the casings are inked on {shares}"
    return ""


def chosen_by_hand(page, handles):
    """A click on a bench shows the figures of that dragon; a click on a row does too, and Escape brings the figures
    back."""
    to_pixel = projection(page)
    x, y = to_pixel(*((handles[B][0] + handles[B][1]) / 2))
    page.mouse.click(x, y)
    until(page, "document.getElementById('bench').textContent.startsWith('Bench 1 of 60, the head')", "the procession's head")
    until(page, "document.querySelectorAll('#dragons button')[1].getAttribute('aria-pressed') === 'true'", "its row")
    row(page, A).get_by_role("button").click()
    page.fill("#pick", "223")
    until(page, "document.getElementById('bench').textContent.startsWith('Bench 223 of 223, the tail')", "the coil's tail")
    page.locator("#stage").focus()
    page.keyboard.press("Escape")
    until(page, "[...document.querySelectorAll('#dragons button')].every((one) => one.getAttribute('aria-pressed') === 'false')", "no row")


def one_dies_alone():
    handles = {A: truth_at(300.0), B: places_of(PROCESSION, 20)}
    with browser(viewport={"width": 1600, "height": 900}) as (page, complaints):
        with server() as url, publisher(A, STILL_A):
            with publisher(B, STILL_B):
                page.goto(url)
                both_drawn(page)
                first = page.evaluate("picture.dragons[1].run")
                is_cut = "(({scrollWidth, clientWidth}) => scrollWidth > clientWidth)(document.getElementById('dragons'))"
                assert not page.evaluate(is_cut), f"a row is cut off: {words(page)}"
                # The line between the nearest boards, and its words, come to rest.
                at_rest(page)
                before = live_light(page, handles)
            until(page, "picture.dragons[1].head === null", "its death")
            notice = until(page, "!document.getElementById('notice').hidden && document.getElementById('notice').textContent", "a notice")
            assert notice.startswith(f"{B}: No publisher. The picture is from t = 20.0 s. Running here: "), notice
            assert page.evaluate("document.body.dataset.stale") == "false", "the whole picture is dimmed"
            assert "no publisher" in row(page, B).inner_text().lower() and "moving" in row(page, A).inner_text(), words(page)
            deadline = time.monotonic() + 120
            while (after := light(page, handles))[B] <= before[B] + 0.1:
                assert time.monotonic() < deadline, f"{B} is not dimmed: {before} became {after}"
                passes(page)
            assert abs(after[A] - before[A]) < 0.02, f"{A} is dimmed: {before} became {after}"
            labels = page.evaluate("picture.labels.map((one) => one.text)")
            assert f"{B}: HEAD (waiting for a publisher)" in labels and f"{A}: HEAD" in labels, labels
            with publisher(B, STILL_B):
                until(page, f"picture.dragons[1].run !== null && picture.dragons[1].run !== '{first}'", "its return")
                until(page, "document.getElementById('notice').hidden", "no notice")
                at_rest(page)
                deadline = time.monotonic() + 120
                while abs((after := live_light(page, handles))[B] - before[B]) >= 0.02:
                    assert time.monotonic() < deadline, f"{B} is dimmed still: {before} became {after}"
            assert not complaints, complaints
        until(page, "document.body.dataset.stale === 'true'", "the server's death")
        port = int(url.rstrip("/").rsplit(":", 1)[1])
        with server(port=port), publisher(A, ["run", "--quiet", "--json", "--start", "406", "--rate", "20"]), publisher(B, STILL_B):
            until(page, "picture.dragons.every((one) => one.head !== null)", "the server's return")
            until(page, "document.body.dataset.level === 'contact'", "the contact")
            alert = page.get_by_role("alert").inner_text()
            assert alert.startswith(f"{A}: ") and "and bench 9 touch" in alert, alert
            assert "moving" in row(page, B).inner_text() and "contact" in row(page, A).inner_text(), words(page)


def shows(page, name, expected):
    """Waits until the row of a dragon has the sign of its transport and these words."""
    sign, word = expected.split()
    row_of = f"[...document.querySelectorAll('#dragons li')].find((one) => one.textContent.includes('{name}'))"
    until(page, f"(({{textContent}}) => textContent.includes('{sign}') && textContent.includes('{word}'))({row_of})", f"{expected} of {name}")


def light(page, handles):
    """Returns the lightness of the boards of each dragon, where no word lies on them."""
    (pixels, to_pixel, _), boxes, ratio = canvas_pixels(page), page.evaluate("picture.labels"), page.evaluate("devicePixelRatio")
    is_under = lambda x, y: any(abs(x - box["x"] * ratio) <= box["half"] * ratio + 2 and abs(y - box["y"] * ratio) <= box["tall"] * ratio + 2 for box in boxes)
    mean = {}
    for name, places in handles.items():
        benches = range(60, 180) if name == A else range(15, 45)
        at = to_pixel(numpy.array([(places[bench] + places[bench + 1]) / 2 for bench in benches]))
        at = numpy.array([place for place in at if not is_under(*place)])
        assert len(at) > 3, f"{name} is covered by {boxes}"
        mean[name] = float(numpy.median(luminance(pixels[at[:, 1], at[:, 0]])))
    return mean


def live_light(page, handles):
    """Returns the lightness while frames of both dragons arrive: a busy machine can hold a publisher up.

    The words that tell it are laid out again after 250 ms, so what was seen must still be seen then.
    """
    is_stale = "picture.labels.some((one) => one.text.includes('HEAD ('))"
    deadline = time.monotonic() + 120
    while True:
        passes(page)
        before, seen = page.evaluate(is_stale), light(page, handles)
        time.sleep(0.3)
        passes(page)
        again, after = light(page, handles), page.evaluate(is_stale)
        if not before and not after and all(abs(again[name] - seen[name]) < 0.005 for name in seen):
            return seen
        assert time.monotonic() < deadline, f"frames of a dragon do not arrive: {words(page)}"


def state(name):
    asked = subprocess.run([PROGRAM, "--name", name, "--json", "control", "state"], capture_output=True)
    return json.loads(asked.stdout) if asked.returncode == 0 else {"playback": None}


def both(playback, what, seconds=60):
    """Waits until the two publishers are in the given state."""
    deadline = time.monotonic() + seconds
    while (now := [state(name)["playback"] for name in (A, B)]) != playback:
        assert time.monotonic() < deadline, f"{what}: {now}, not {playback}"
        time.sleep(0.05)


def bar_conducts_one_or_all():
    run = ["run", "--quiet", "--json", "--rate", "50"]
    with server("--control") as url, publisher(A, [*run, "--start", "100"]) as first, publisher(B, [*PROCESSION, *run]), browser() as (page, complaints):
        page.goto(url)
        until(page, "picture.dragons.length === 2 && picture.dragons.every((one) => one.head !== null)", "both dragons")
        until(page, "!document.getElementById('conduct').hidden", "the bar")
        whom, toggle, hold = page.locator("#conduct-whom"), page.locator("#conduct-toggle"), page.locator("#conduct-hold")
        assert whom.locator("option").all_inner_texts() == ["All", A, B]
        toggle.click()
        both(["paused", "paused"], "all pause")
        until(page, "document.getElementById('conduct-toggle').textContent === 'Play'", "the button is Play")
        whom.select_option(B)
        toggle.click()
        both(["paused", "playing"], "one plays")
        for name, words_of_row in ((A, "❚❚ Paused"), (B, "▶ moving")):
            shows(page, name, words_of_row)
        page.locator("#conduct-rate").select_option("2 ×")
        deadline = time.monotonic() + 120
        while state(B)["time_scale"] != 2.0:
            assert time.monotonic() < deadline, "the speed of one"
        assert state(A)["playback"] == "paused"
        # One is paused and one plays: all pause, and then all play.
        whom.select_option("")
        until(page, "document.getElementById('conduct-toggle').textContent === 'Pause'", "the button is Pause")
        toggle.click()
        both(["paused", "paused"], "all pause again")
        until(page, "document.getElementById('conduct-toggle').textContent === 'Play'", "the button is Play")
        toggle.click()
        both(["playing", "playing"], "all play")
        # A hold is for all dragons, independent of the selected one.
        whom.select_option(A)
        hold.click()
        both(["held", "held"], "both are held")
        until(page, "document.getElementById('conduct-hold').getAttribute('aria-pressed') === 'true'", "the button is latched")
        toggle.click()
        until(page, f"document.getElementById('conduct-answer').textContent.startsWith('{A}: Resume is refused')", "whose refusal")
        hold.click()
        both(["paused", "paused"], "both are released")
        # Beyond the end of one show, that show stays at its end.
        whom.select_option("")
        page.evaluate("(() => { const line = document.getElementById('conduct-seek'); line.value = line.max; line.onchange(); })()")
        longest = page.evaluate("Number(document.getElementById('conduct-seek').max)")
        deadline = time.monotonic() + 60
        while abs(max(now := [state(name)["sim_time"] for name in (A, B)]) - longest) > 1e-6 or min(now) < 100:
            assert time.monotonic() < deadline, f"the end of both: {now}, {longest}"
            time.sleep(0.05)
        # One publisher is gone: a hold reaches the other, and the bar names the publisher that it did not reach.
        first.kill()
        until(page, "picture.dragons[0].head === null", "its death")
        hold.click()
        both([None, "held"], "the one that is left is held")
        until(page, f"document.getElementById('conduct-answer').textContent.includes('{A}: ')", "the name of the publisher without a hold")
        assert not complaints, complaints


if __name__ == "__main__":
    play(two_on_one_stage, one_dies_alone, bar_conducts_one_or_all)
