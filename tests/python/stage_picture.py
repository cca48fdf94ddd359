"""The stage picture in a real browser: Debian's Chromium, driven by Playwright.

    stage_picture.py SCENARIO PROGRAM NAME

Starts a server and publishers under the service name NAME. Tests the words and the picture of the page, and compares
the picture with the exact positions in tests/truth. Ends with exit code 0, or with a sentence on the error.
stage_motion.py tests the motion between two frames.
"""

import base64
import contextlib
import csv
import http.server
import json
import math
import pathlib
import re
import signal
import subprocess
import sys
import threading
import time

import numpy

import chromium
from chromium import at_rest
from show_process import ShowProcess

TRUTH = pathlib.Path(__file__).resolve().parents[1] / "truth" / "paper_scene_exact.csv"
CONTACT = 412.473837682115
WIDTH, HEAD_LENGTH, BODY_LENGTH = 0.30, 3.41, 2.20
# No wait here may last forever; an alarm still ends everything that was started.
WATCHDOG = 550
STILL = ["--start", "300", "--time-scale", "1e-6"]

_, SCENARIO, PROGRAM, NAME = sys.argv
started = ShowProcess(PROGRAM, NAME).started


def publisher(*arguments):
    return started("run", "--quiet", "--json", *arguments)


@contextlib.contextmanager
def server(port=0):
    with started("view", "--json", "--port", str(port)) as child:
        yield json.loads(child.stdout.readline())["url"]


@contextlib.contextmanager
def browser(**context):
    """Returns a page of a separate Chromium, and a list of all its error messages."""
    with chromium.browser() as running:
        yield opened(running, **context)


# A screen of 20 pictures a second, on which a page costs less. Tests of motion and of the seat have an ordinary one.
SLOW_SCREEN = """(() => {
    const next = window.requestAnimationFrame.bind(window);
    window.requestAnimationFrame = (draw) => setTimeout(() => next(draw), 34);
})()"""


def opened(running, screen=SLOW_SCREEN, patient=True, **context):
    page = running.new_context(**{"viewport": {"width": 1280, "height": 720}, "color_scheme": "light", **context}).new_page()
    # Another test's processes can hold a page up for longer than Playwright's 30 s.
    page.set_default_timeout(120_000)
    if screen:
        page.add_init_script(screen)
    if patient:
        chromium.be_patient(page)
    complaints = []
    page.on("console", lambda message: message.type == "error" and complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("requestfailed", lambda request: complaints.append(f"{request.url} failed"))
    return page, complaints


def until(page, script, what, seconds=120):
    """Returns the value of a script as soon as it is true."""
    deadline = time.monotonic() + seconds
    while not (value := page.evaluate(script)):
        assert time.monotonic() < deadline, f"{what}: not within {seconds} s; the page shows {words(page)!r}"
        time.sleep(0.05)
    return value


def passes(page, count=3):
    """Waits until the page has brought words and picture up to date `count` times."""
    before = page.evaluate("picture.passes")
    until(page, f"picture.passes >= {before} + {count}", "passes of the page")


def words(page):
    return page.inner_text("body")


def drawn(page):
    until(page, "picture.head !== null && picture.drawn > 0", "a picture")


def truth_at(second):
    with open(TRUTH, encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if float(row["t_s"]) == second]
    return numpy.array([[float(row["x_m"]), float(row["y_m"])] for row in rows])


def canvas_pixels(page):
    """Returns the canvas's own pixels, and the function from places of the stage (metres) to its pixels."""
    width, height, data, origin, unit = page.evaluate(
        """() => {
            const canvas = document.getElementById("stage"), {width, height} = canvas;
            const data = canvas.getContext("2d").getImageData(0, 0, width, height).data;
            let text = "";
            for (let k = 0; k < data.length; k += 8192) text += String.fromCharCode(...data.subarray(k, k + 8192));
            return [width, height, btoa(text), picture.toPixel(0, 0), picture.toPixel(1, 1)];
        }"""
    )
    pixels = numpy.frombuffer(base64.b64decode(data), numpy.uint8).reshape(height, width, 4)[:, :, :3]
    origin, unit = numpy.array(origin), numpy.array(unit)
    ratio = page.evaluate("devicePixelRatio")
    return pixels, lambda places: numpy.floor((origin + places * (unit - origin)) * ratio).astype(int), unit[0] - origin[0]


def is_board(colours):
    """In the light theme, only boards and their marks are not bright."""
    return colours.min(axis=-1) < 160


def outside_of_board(places, front, rear, length):
    """Returns the distance from each place to a board whose handles are at `front` and `rear`, 0 inside it."""
    along = (front - rear) / numpy.linalg.norm(front - rear)
    offset = places - (front + rear) / 2
    u = numpy.maximum(numpy.abs(offset @ along) - length / 2, 0)
    v = numpy.maximum(numpy.abs(offset @ [-along[1], along[0]]) - WIDTH / 2, 0)
    return numpy.hypot(u, v)


def outside_of_boards(places, handles):
    """Returns the distance from each place to the nearest board."""
    lengths = [HEAD_LENGTH] + [BODY_LENGTH] * (len(handles) - 2)
    boards = zip(handles, handles[1:], lengths)
    return numpy.min([outside_of_board(places, *board) for board in boards], axis=0)


def boards_are_where_the_truth_has_them():
    handles = truth_at(300.0)
    with server() as url, publisher(*STILL), browser() as (page, complaints):
        requests = []
        page.on("request", lambda request: requests.append(request.url))
        page.goto(url)
        drawn(page)
        until(page, "picture.marks.length", "the line between the nearest boards")
        at_rest(page)
        labels = page.evaluate("[...picture.labels, ...picture.marks.map(({place}) => ((([x, y]) => ({x, y, half: 40, tall: 40}))(picture.toPixel(place.x, place.y))))]")
        pixels, to_pixel, scale = canvas_pixels(page)
        box = page.locator("#stage").bounding_box()
        assert box["width"] > 400 and box["height"] > 400, f"the canvas is {box}"
        middles = to_pixel((handles[:-1] + handles[1:]) / 2)
        missing = [bench for bench, (x, y) in enumerate(middles) if not is_board(pixels[y, x])]
        assert not missing, f"no board is drawn where benches {missing} (from 0) are"
        # The ground between the boards, away from their edges, from words, and from lines at the ends and the nearest boards.
        random = numpy.random.default_rng(1)
        places = random.uniform(-9, 9, (20000, 2))
        away = outside_of_boards(places, handles) > 3 / scale
        for end in [handles[0], handles[-1]]:
            away &= numpy.linalg.norm(places - end, axis=1) > 170 / scale
        for label in labels:
            # A line leads from the words to their place.
            right, down = numpy.abs(to_pixel(places) - [label["x"], label["y"]]).T
            away &= (right > label["half"] + 40) | (down > label["tall"] + 40)
        at = to_pixel(places[away])
        inside = (at >= 0).all(axis=1) & (at[:, 0] < pixels.shape[1] - 200) & (at[:, 1] < pixels.shape[0])
        at = at[inside]
        wrong = is_board(pixels[at[:, 1], at[:, 0]])
        assert len(at) > 2000 and not wrong.any(), f"boards are drawn at {wrong.sum()} of {len(at)} places without one"
        shows_who_it_is(page, handles)
        dark_and_light(page)
        assert page.get_by_role("alert").count() == 1 and page.get_by_role("meter").count() == 1
        assert all(request.startswith((url, "data:")) for request in requests), requests
        assert not complaints, complaints


def shows_who_it_is(page, handles):
    """A click on the head's board shows its number, place and speed; a typed number does too."""
    x, y = page.evaluate("([x, y]) => picture.toPixel(x, y)", ((handles[0] + handles[1]) / 2).tolist())
    box = page.locator("#stage").bounding_box()
    page.mouse.click(box["x"] + x, box["y"] + y)
    until(page, "document.getElementById('bench').textContent.startsWith('Bench 1 of 223, the head')", "the head, clicked")
    shown = [float(number) for number in re.findall(r"-?\d+\.\d+", page.inner_text("#bench"))]
    assert numpy.allclose(shown[:3], [*handles[0], 1.0], atol=6e-4), f"{shown} is not {handles[0]} and 1 m/s"
    page.fill("#pick", "223")
    until(page, "document.getElementById('bench').textContent.startsWith('Bench 223 of 223, the tail')", "the tail, by number")
    shown = [float(number) for number in re.findall(r"-?\d+\.\d+", page.inner_text("#bench"))]
    assert numpy.allclose(shown[:2], handles[222], atol=6e-4), f"{shown} is not {handles[222]}"


def dark_and_light(page):
    corner = "Math.max(...document.getElementById('stage').getContext('2d').getImageData(3, 3, 1, 1).data.slice(0, 3))"
    until(page, f"{corner} > 200", "the light ground of the light page")
    page.emulate_media(color_scheme="dark")
    until(page, f"{corner} < 50", "the dark ground of the dark page")
    page.click("#theme")
    until(page, f"{corner} > 200", "the light ground after a click on the button")


def hands_move_the_picture():
    head = truth_at(300.0)[0].tolist()
    at_head = lambda: numpy.array(page.evaluate("([x, y]) => picture.toPixel(x, y)", head))
    scale = lambda: page.evaluate("picture.toPixel(1, 0)[0] - picture.toPixel(0, 0)[0]")
    with server() as url, publisher(*STILL), browser(has_touch=True) as (page, complaints):
        page.goto(url)
        drawn(page)
        box = page.locator("#stage").bounding_box()
        first, size = at_head(), scale()
        page.mouse.move(box["x"] + first[0], box["y"] + first[1])
        page.mouse.wheel(0, -500)
        until(page, f"picture.toPixel(1, 0)[0] - picture.toPixel(0, 0)[0] > 1.5 * {size}", "a larger picture")
        assert numpy.allclose(at_head(), first, atol=1.0), "the wheel moves what is under the pointer"
        page.mouse.down()
        page.mouse.move(box["x"] + first[0] + 70, box["y"] + first[1] - 40, steps=5)
        page.mouse.up()
        assert numpy.allclose(at_head() - first, [70, -40], atol=1.0), "dragging does not move the picture along"
        page.keyboard.press("0")
        shown = f"{first}, {size} pixels a metre, became {at_head()}, {scale()}"
        assert numpy.allclose(at_head(), first, atol=1.0) and math.isclose(scale(), size, rel_tol=1e-3), f"0: {shown}"
        page.keyboard.press("ArrowRight")
        assert at_head()[0] < first[0], "an arrow does not move the picture"
        page.keyboard.press("+")
        assert scale() > size, "+ does not enlarge"
        page.click("#whole")
        pinch(page, box)
        assert math.isclose(scale(), 2 * size, rel_tol=0.02), "two fingers do not enlarge"
        page.focus("#stage")
        page.keyboard.press("f")
        at_rest(page)
        assert numpy.allclose(at_head(), [box["width"] / 2, box["height"] / 2], atol=1.0), "the camera does not follow"
        page.click("#whole")
        page.set_viewport_size({"width": 390, "height": 844})
        at_rest(page)
        fits(page)
        head_pixel = at_head()
        box = page.locator("#stage").bounding_box()
        assert box["height"] > 280 and box["width"] == 390, f"on a phone the stage is {box}"
        page.touchscreen.tap(box["x"] + head_pixel[0], box["y"] + head_pixel[1])
        until(page, "document.getElementById('bench').textContent.startsWith('Bench 1 of')", "the head, tapped")
        assert not complaints, complaints


def pinch(page, box):
    touch = page.context.new_cdp_session(page)
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    fingers = lambda apart: [{"x": x - apart, "y": y, "id": 1}, {"x": x + apart, "y": y, "id": 2}]
    touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": fingers(60)})
    for apart in range(65, 121, 5):
        touch.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": fingers(apart)})
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    at_rest(page)


def fits(page):
    """Nothing is cut off at the sides, and the words stay in their boxes."""
    cut = page.evaluate(
        """() => [...document.querySelectorAll("body, header, h1, h2, #playback-detail, #left, #alert, footer, nav")]
            .filter((one) => one.scrollWidth > one.clientWidth + 1 && getComputedStyle(one).display !== "inline")
            .map((one) => one.id || one.tagName)"""
    )
    assert not cut, f"{cut} are wider than their place at {page.viewport_size}"


def show_ends_in_contact():
    with server() as url, browser() as (page, complaints):
        page.goto(url)
        until(page, "document.body.dataset.level === 'waiting'", "waiting for a publisher")
        listen(page)
        with publisher("--start", "405", "--rate", "20"):
            until(page, "document.body.dataset.level === 'approaching'", "the approach")
            drawn(page)
            counts_down(page)
            hint_is_seen(page)
            receives_the_stream(page)
            fits(page)
            page.set_viewport_size({"width": 390, "height": 844})
            passes(page)
            fits(page)
            page.set_viewport_size({"width": 1280, "height": 720})
            until(page, "document.body.dataset.level === 'contact'", "the contact")
            passes(page, 10)
            fits(page)
            assert "contact" in page.inner_text("#state").lower(), page.inner_text("#state")
            assert "and bench 9 touch" in page.get_by_role("alert").inner_text(), words(page)
            assert page.inner_text("#left") == "", "the countdown continues after the contact"
            heard = page.evaluate("heard")
            assert any("Approaching" in one for one in heard) and any("and bench 9 touch" in one for one in heard), heard
            assert any(re.fullmatch(r"[345] seconds", one) for one in heard), heard
            danger_is_marked(page)
            assert not complaints, complaints


def listen(page):
    """Keeps the announcements of a screen reader."""
    page.evaluate(
        """() => {
            window.heard = [];
            const announced = (changes) => changes.forEach(({target}) => heard.push(target.textContent));
            for (const region of document.querySelectorAll("[role=alert], [aria-live=polite]"))
                new MutationObserver(announced).observe(region, {childList: true, characterData: true});
        }"""
    )


def counts_down(page):
    left, shown = page.evaluate("[document.getElementById('left').textContent, picture.time]")
    number, unit = re.fullmatch(r"(\d+\.\d)(s)", left).groups()
    assert unit == "s" and abs(float(number) - (CONTACT - shown)) < 1, f"{left} left at {shown} s"
    height = page.evaluate("parseFloat(getComputedStyle(document.getElementById('left')).fontSize)")
    assert height >= 0.1 * page.viewport_size["height"], f"a countdown of {height} px is not read from afar"


def hint_is_seen(page):
    """The buttons, which stay at the bottom of the panel, leave the words about a bench free."""
    bench, buttons = page.evaluate("['bench', 'follow'].map((id) => document.getElementById(id).getBoundingClientRect()).map(({top, bottom}) => [top, bottom])")
    assert bench[0] < bench[1] <= buttons[0], f"the hint is at {bench}, the buttons at {buttons}"


def receives_the_stream(page):
    """Half of the frames come in one of some seconds: a busy machine may hold the page up in the others."""
    counts = "[picture.received, picture.sequence, picture.drawn]"
    for _ in range(20):
        first = page.evaluate(counts)
        until(page, f"picture.sequence >= {first[1]} + 25", "frames that are published")
        received, published, drawn_times = (now - then for now, then in zip(page.evaluate(counts), first))
        print(f"{published} frames published, {received} received, {drawn_times} pictures drawn")
        if received >= published / 2 > 0:
            return
    raise AssertionError("never came half of the frames")


def danger_is_marked(page):
    """A red ring of 13 pixels is around the corner of the head's board that touches bench 8, and nowhere far from it."""
    rows = subprocess.run([PROGRAM, "solve", "--at", "contact"], capture_output=True, text=True, check=True).stdout.splitlines()
    handles = numpy.array([[float(row["x"]), float(row["y"])] for row in csv.DictReader(rows)])
    along = (handles[0] - handles[1]) / numpy.linalg.norm(handles[0] - handles[1])
    across, middle = numpy.array([-along[1], along[0]]), (handles[0] + handles[1]) / 2
    corners = [middle + u * HEAD_LENGTH / 2 * along + v * WIDTH / 2 * across for u in (1, -1) for v in (1, -1)]
    distances = [outside_of_board(corner[None], handles[8], handles[9], BODY_LENGTH)[0] for corner in corners]
    assert min(distances) < 1e-6, f"the nearest corner of the head is {min(distances)} m from bench 8"
    touching = corners[int(numpy.argmin(distances))]
    pixels, to_pixel, scale = canvas_pixels(page)
    red = (pixels[:, :, 0] > 150) & (pixels[:, :, 1] < 60) & (pixels[:, :, 2] < 80)
    x, y = to_pixel(touching[None])[0]
    for angle in range(20, 360, 40):
        at_x, at_y = x + round(13 * math.cos(math.radians(angle))), y + round(13 * math.sin(math.radians(angle)))
        assert red[at_y - 1 : at_y + 2, at_x - 1 : at_x + 2].any(), f"no ring around {touching}, at {angle} degrees"
    ys, xs = numpy.nonzero(red)
    furthest = numpy.hypot(xs - x, ys - y).max() / scale
    # The head is 3.41 m long and its name stands at its end.
    assert furthest < 6, f"red {furthest} m from the contact, where neither bench nor its name is"


def publishers_come_and_go():
    with browser() as (page, complaints):
        with server() as url:
            page.goto(url)
            with publisher("--start", "100"):
                drawn(page)
                first = page.evaluate("picture.run")
            until(page, "document.body.dataset.level === 'waiting' && picture.head === null", "its death")
            assert "NO PUBLISHER" in page.inner_text("#playback"), words(page)
            with publisher("--start", "200"):
                until(page, f"picture.run !== null && picture.run !== '{first}' && picture.time >= 200", "its return")
            assert not complaints, complaints
        until(page, "document.getElementById('playback').textContent.includes('NO SERVER')", "the server's death")
        # From here on the browser itself reports each failed connection.
        with server(int(url.rstrip("/").rsplit(":", 1)[1])), publisher("--start", "150"):
            until(page, "picture.head !== null && picture.time >= 150", "the server's return")


# Holds back each request for the clock and counts the connections.
UNANSWERED_CLOCK = """
    window.sockets = 0;
    window.WebSocket = class extends WebSocket {
        constructor(...how) { super(...how); sockets++; }
        send(text) { if (text !== "clock") super.send(text); }
    };
"""


def five_at_once():
    with server() as url, publisher("--start", "100"), chromium.browser() as started:
        views = [opened(started, viewport={"width": 480, "height": 360}) for _ in range(5)]
        # A server too busy to answer: frames are a sign of life.
        views[0][0].add_init_script(UNANSWERED_CLOCK)
        for page, _ in views:
            page.goto(url)
        for page, _ in views:
            drawn(page)
        counts = "[picture.received, picture.drawn, picture.sequence, performance.now()]"
        first = [page.evaluate(counts) for page, _ in views]
        for (page, complaints), then in zip(views, first):
            until(page, f"picture.received >= {then[0]} + 20 && picture.drawn >= {then[1]} + 20", "frames and pictures")
            received, drawn_times, published, ms = (now - before for now, before in zip(page.evaluate(counts), then))
            print(f"{1000 * received / ms:.0f} of {1000 * published / ms:.0f} frames/s, {1000 * drawn_times / ms:.0f} pictures/s")
            assert published >= received, (published, received)
            assert not complaints, complaints
        until(views[0][0], "performance.now() > 12_000", "two intervals of the clock")
        assert views[0][0].evaluate("sockets") == 1, "a server whose frames come is given up"


def foreign_pages_are_refused():
    """A page of another server on the same machine, which no other rule of the browser keeps away."""
    elsewhere = http.server.ThreadingHTTPServer(("127.0.0.1", 0), http.server.BaseHTTPRequestHandler)
    threading.Thread(target=elsewhere.serve_forever, daemon=True).start()
    with server() as url, publisher(*STILL), browser() as (page, _):
        opens = lambda: page.evaluate(
            """(url) => new Promise((resolve) => {
                const socket = new WebSocket(url);
                [socket.onopen, socket.onerror] = [() => resolve(true), () => resolve(false)];
            })""",
            url.replace("http", "ws", 1) + "frames",
        )
        page.goto(url)
        assert opens(), "its own page cannot watch"
        page.goto(f"http://127.0.0.1:{elsewhere.server_port}/")
        assert not opens(), "a page from elsewhere can watch"


def play(*scenarios):
    """Runs the scenario that was named on the command line."""
    signal.signal(signal.SIGALRM, lambda *_: sys.exit(f"{SCENARIO} took more than {WATCHDOG} s"))
    signal.alarm(WATCHDOG)
    {scenario.__name__: scenario for scenario in scenarios}[SCENARIO]()


if __name__ == "__main__":
    scenarios = (boards_are_where_the_truth_has_them, hands_move_the_picture, show_ends_in_contact)
    play(*scenarios, publishers_come_and_go, five_at_once, foreign_pages_are_refused)
