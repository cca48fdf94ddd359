"""The stage picture in its places: in a kiosk, in another page's frame, on small screens, and in forced colours. Also
before a show that ended long ago, and with 5,000 benches. Same browser and arguments as stage_picture.py.

    stage_places.py SCENARIO PROGRAM NAME
"""

import contextlib
import http.server
import math
import pathlib
import re
import tempfile
import threading

import numpy

import chromium
from stage_picture import BODY_LENGTH, HEAD_LENGTH, browser, drawn, opened, play, publisher, server, started, until, words
from stage_show import at, luminance, projection, risen, shot, spread

# Nearly ten minutes before the contact, longer than any test takes: little changes during the test.
APPROACH = ["--start", "410", "--time-scale", "0.0042"]
# Important elements that are cut off by the window, by a scrolling panel or by the buttons at its foot.
CUT = """() => {
    const nav = document.querySelector("nav").getBoundingClientRect();
    const place = (one) => [one, one.getBoundingClientRect()];
    return [...document.querySelectorAll("#name, #playback, #playback-detail, #state, #until, #left, #alert, #meter, #metres, #legend, #scale, #time, #full, #follow, #whole, #conduct:not([hidden]) :is(button, select, input)")]
        .map(place).filter(([one, {bottom, right}]) => !one.checkVisibility() || bottom + scrollY > Math.max(innerHeight, document.scrollingElement.scrollHeight) + 1 || right > innerWidth + 1
            || (one.closest(".figure, #time") && bottom > nav.top + 1 && nav.top > one.getBoundingClientRect().top && nav.left < right))
        .map(([one]) => one.id || one.tagName);
}"""


def approaching(page, url, address=""):
    page.goto("about:blank")
    page.goto(f"{url}#{address}")
    until(page, "picture.drawn > 0 && document.body.dataset.level === 'approaching' && document.getElementById('time').textContent", "the approach")


def undimmed(page):
    """Waits for a picture that was dimmed while no frames came: it takes a moment to be bright again."""
    until(page, "picture.drawn > 0 && getComputedStyle(document.getElementById('stage')).opacity === '1'", "a picture that is not dimmed", 120)


def nothing_needed_is_cut_off():
    """As a window and as a frame in another page, with and without the transport bar, in both languages."""
    with server() as url, started("view", "--json", "--port", "0", "--control") as conducted, publisher(*APPROACH), browser() as (page, complaints):
        conduct = re.search(r"http://[^\"]+", conducted.stdout.readline()).group()
        for language in ("en", "zh"):
            for address in (url, conduct):
                for width, height in [(844, 390), (900, 500), (1120, 630), (1280, 720), (390, 844), (1280, 800), (1440, 900), (1920, 1080)]:
                    page.set_viewport_size({"width": width, "height": height})
                    approaching(page, address, f"lang={language}")
                    if address == conduct:
                        until(page, "!document.getElementById('conduct').hidden && document.getElementById('conduct-time').textContent", "the bar")
                    until(page, f"!({CUT})().length", f"{width} x {height}, {language}: {page.evaluate(CUT)} are cut off", 5)
                    stage = page.locator("#stage").bounding_box()
                    assert stage["width"] * stage["height"] > 0.3 * width * height, f"{width} x {height}: the picture has {stage}"
        bar_speaks_chinese(page)
        page.set_viewport_size({"width": 1000, "height": 600})
        page.goto(another_page(f'<iframe src="{url}#dark" width="900" height="500" style="border: 0"></iframe>'))
        inner = page.frames[1]
        until(inner, "window.picture?.drawn > 0 && document.body.dataset.level === 'approaching'", "the picture in a frame")
        until(inner, f"!({CUT})().length", "in a frame something is cut off", 5)
        assert not complaints, complaints


def another_page(html):
    """Returns the address of a page that another server of this machine serves."""
    class Page(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(f'<link rel="icon" href="data:,">{html}'.encode())

        def log_message(self, *_):
            pass

    other = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Page)
    threading.Thread(target=other.serve_forever, daemon=True).start()
    return f"http://127.0.0.1:{other.server_port}/"


def bar_speaks_chinese(page):
    texts = page.evaluate("[...document.querySelectorAll('#conduct, #conduct *')].flatMap((one) => [one.title, one.getAttribute('aria-label') ?? '']).join() + document.getElementById('conduct').innerText")
    assert "暂停" in texts and "从头开始" in texts and "碰撞" in texts and not re.search("[A-Za-z]{2,}", texts), texts
    # A refused command: a show that is not paused accepts no step.
    page.click("#conduct-step")
    until(page, "document.getElementById('conduct-answer').textContent === '单步被拒绝：演出播放中。'", "a refusal in Chinese")


def kiosk_shows_no_buttons():
    """As `chromium --kiosk` shows it: in a separate window, not in full screen by the button."""
    with server() as url, started("view", "--json", "--port", "0", "--control") as conducted, publisher(*APPROACH), tempfile.TemporaryDirectory() as profile:
        conduct = re.search(r"http://[^\"]+", conducted.stdout.readline()).group()
        arguments = ["--kiosk", "--window-size=1280,800"]
        with chromium.browsers().launch_persistent_context(profile, executable_path=chromium.PROGRAM, no_viewport=True, args=arguments) as kiosk:
            page = kiosk.pages[0]
            for address in (url, conduct):
                approaching(page, address, "dark,follow")
                time_line = "document.getElementById('conduct').hidden || getComputedStyle(document.getElementById('conduct')).opacity === '0'"
                seen = page.evaluate("[...document.querySelectorAll('nav, #rate, #detail')].filter((one) => one.checkVisibility({opacityProperty: true})).map((one) => one.id || one.tagName)")
                assert not seen and page.evaluate(time_line), f"{seen} or the transport bar in a kiosk"
                assert page.locator("#left").is_visible() and page.locator("#alert").is_visible(), words(page)


def forced_colours_keep_their_meaning():
    with server() as url, publisher(*APPROACH), browser(forced_colors="active", viewport={"width": 1280, "height": 800}) as (page, complaints):
        approaching(page, url)
        pixels = shot(page)
        cut = lambda name: pixels[tuple(slice(int(page.locator(name).bounding_box()[start]), int(page.locator(name).bounding_box()[start] + page.locator(name).bounding_box()[size])) for start, size in (("y", "height"), ("x", "width")))]
        for name in ("#meter", "#legend"):
            colours = {tuple(colour) for colour in cut(name).reshape(-1, 4)}
            assert len(colours) > 2, f"{name} has the colours {colours}"
        # The number does not lie on the words above it: their letters reach from top to bottom.
        ink = luminance(cut("#until")) < 0.3
        rows = numpy.flatnonzero(ink.any(axis=1))
        assert rows[-1] - rows[0] > 0.5 * len(ink), f"of {len(ink)} rows of 'Contact in' {rows} have ink"
        assert not complaints, complaints


def frozen_before_it_was_seen():
    """The speeds before the contact are unknown: head, body and tail have their own colours, and words name them."""
    with server() as url, publisher("--start", "412.5"), browser(viewport={"width": 1280, "height": 800}) as (page, complaints):
        until_frozen = "picture.drawn > 0 && document.body.dataset.level === 'contact' && document.getElementById('speeds').textContent === 'at rest'"
        page.goto(url)
        until(page, until_frozen, "the contact")
        undimmed(page)
        until(page, "document.getElementById('scale').innerText.replaceAll(/\\s+/g, ' ').trim() === 'tail body head'", "words for the colours")
        pixels, to_pixel = shot(page)[..., :3].astype(int), projection(page)
        handles = numpy.array(page.evaluate("[...picture.shown.handles]")).reshape(-1, 5)[:, :2]
        # Beside the middles, away from the signs of head and tail.
        colour = lambda bench, share: pixels[tuple(to_pixel(*(handles[bench] + share * (handles[bench + 1] - handles[bench]))).astype(int)[::-1])]
        head, body, tail = colour(0, 0.66), colour(100, 0.5), colour(222, 0.3)
        for one in (head, body, tail):
            assert numpy.ptp(one) > 30, f"{one} is grey"
        for one, other in ((head, body), (body, tail), (head, tail)):
            assert numpy.abs(one - other).max() > 30, f"{head}, {body}, {tail}"
        assert spread(shot(page)[:, 500:]) > 3
        page.keyboard.press("?")
        until(page, "parseFloat(getComputedStyle(document.getElementById('keys-title')).fontSize) < 40", "a heading of the keys in its own size")
        page.keyboard.press("Escape")
        show, seen = opened(page.context.browser, viewport={"width": 1280, "height": 800})
        show.goto(f"{url}#show")
        until(show, "picture.drawn > 0", "the show look of it")
        assert not complaints and not seen, complaints + seen
    with server() as url, browser() as (page, complaints):
        page.goto(f"{url}#show")
        until(page, "document.body.dataset.transport === 'lost'", "no publisher")
        assert (shot(page)[..., :3] == 0).all(), "something is shown before the doors open"
        page.goto("about:blank")
        page.goto(f"{url}#show,tell")
        until(page, "document.getElementById('notice').checkVisibility() && document.getElementById('notice').innerText === 'Waiting for a publisher'", "words on an empty stage, on request")
        assert not complaints, complaints


@contextlib.contextmanager
def long_scene():
    """config/long.toml with the safe solver, as a file."""
    text = pathlib.Path("config/long.toml").read_text(encoding="utf-8")
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", suffix=".toml") as file:
        file.write(text.replace("head_speed = 1.0", 'solver = "newton"\nhead_speed = 1.0'))
        file.flush()
        yield file.name


def five_thousand_boards_are_drawn():
    """Each board is on a chain on the spiral that is computed here; the space between the turns is empty."""
    middles, links = chain(100.0)
    with long_scene() as scene, server() as url, publisher("--scene", scene, "--start", "100", "--time-scale", "1e-6", "--rate", "5"), browser(viewport={"width": 1920, "height": 1080}) as (page, complaints):
        for address in ("", "show,nolabels"):
            page.goto("about:blank")
            page.goto(f"{url}#{address}")
            undimmed(page)
            if address:
                risen(page)
            pixels, to_pixel = shot(page), projection(page)
            ground = luminance(pixels[3, -3])
            # A quarter of a link from the handles, away from the lanterns. A turn is some five pixels wide: the
            # neighbours count.
            board = numpy.array([to_pixel(*(middle + share * link)) for share in (-0.25, 0.25) for middle, link in zip(middles, links)])
            radius = numpy.hypot(*middles.T)
            gaps = numpy.array([to_pixel(*(middle * (1 + 0.275 / r))) for middle, r in zip(middles, radius)])
            beside = lambda places: luminance(pixels[places[:, 1].astype(int), places[:, 0].astype(int)])
            apart = abs(beside(board) - ground), abs(beside(gaps) - ground)
            assert numpy.percentile(apart[0], 1) > (0.5 if not address else 0.005), f"{address}: boards stand out by {numpy.percentile(apart[0], [0, 1, 50])}"
            assert address or numpy.median(apart[1]) < 0.25 * numpy.median(apart[0]), f"between the turns {numpy.median(apart[1])}, on boards {numpy.median(apart[0])}"
        assert not complaints, complaints


def chain(seconds, benches=5000, pitch=0.55, turns=60):
    """Returns middles and links of the boards of config/long.toml: the head `seconds` metres further in, each handle
    behind by bisection."""
    a = pitch / (2 * math.pi)
    length = lambda theta: a / 2 * (theta * math.sqrt(1 + theta * theta) + math.asinh(theta))
    place = lambda theta: numpy.array([a * theta * math.cos(theta), a * theta * math.sin(theta)])

    def root(function, low, high):
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if function(middle) < 0 else (low, middle)
        return low

    start = 2 * math.pi * turns
    theta = root(lambda one: length(one) - (length(start) - seconds), 0, start)
    handles = [place(theta)]
    for bench in range(benches):
        link = (BODY_LENGTH if bench else HEAD_LENGTH) - 2 * 0.275
        theta = root(lambda one: math.dist(place(one), handles[-1]) - link, theta, theta + 2 * link / (a * theta))
        handles.append(place(theta))
    handles = numpy.array(handles)
    return (handles[:-1] + handles[1:]) / 2, handles[:-1] - handles[1:]


if __name__ == "__main__":
    play(nothing_needed_is_cut_off, kiosk_shows_no_buttons, forced_colours_keep_their_meaning, frozen_before_it_was_seen, five_thousand_boards_are_drawn)
