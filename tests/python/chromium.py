"""Debian's Chromium, driven by Playwright, for the scripts that test pages."""

import atexit
import contextlib
import ctypes
import pathlib
import time

from playwright.sync_api import sync_playwright

PROGRAM = "/usr/bin/chromium"
# linux/prctl.h, linux/capability.h
PR_CAPBSET_DROP, CAP_SYS_NICE = 24, 23


# Playwright, and the Chromium of all scenarios of this process.
running = {}


def browsers():
    """Returns an object that starts a Chromium. As root, Chromium would raise its priority above all other processes,
    which would then miss their deadlines. Processes started from here on have no right to that."""
    if "playwright" not in running:
        # Refused to users other than root, whose browsers have no such right anyway.
        ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0)
        running["playwright"] = sync_playwright().start()
        atexit.register(running["playwright"].stop)
    return running["playwright"].chromium


@contextlib.contextmanager
def browser():
    """A Chromium without pages, whose new pages are closed at the end."""
    if "browser" not in running:
        running["browser"] = browsers().launch(executable_path=PROGRAM)
    try:
        yield running["browser"]
    finally:
        for context in running["browser"].contexts:
            context.close()


# The module with the time without frames after which the page reports silence.
PUBLISHER = pathlib.Path(__file__).resolve().parents[2] / "crates/outputs/src/view/publisher.js"


def be_patient(page):
    """Lets a page report silence after 40 s instead of two: a busy machine sends no frame for seconds."""
    module = PUBLISHER.read_text(encoding="utf-8")
    assert module.count("const SILENCE = 2000;") == 1
    module = module.replace("const SILENCE = 2000;", "const SILENCE = 40_000;")
    page.route("**/publisher.js", lambda route: route.fulfill(body=module, content_type="text/javascript"))


# The passes of the page so far; where the camera has two places, and where the words and their lines are, in pixels.
PLACES = """() => [picture.passes, [picture.toPixel(0, 0), picture.toPixel(1, 1),
    ...picture.labels.map(({x, y, half, end}) => [x, y, half, end ? end.x : 0, end ? end.y : 0])].flat()]"""


def at_rest(page, seconds=120):
    """Waits until camera and words stand still.

    A show at a millionth of its speed still moves by invisible parts of a pixel. Words are laid out again after 250 ms.
    Between two looks there are more, and some passes of the page, however slow the machine.
    """
    deadline, (before, places) = time.monotonic() + seconds, page.evaluate(PLACES)
    while True:
        time.sleep(0.3)
        passes, now = page.evaluate(PLACES)
        if passes < before + 3:
            assert time.monotonic() < deadline, f"the page made {passes - before} passes"
            continue
        moved = max((abs(old - new) for old, new in zip(places, now)), default=0)
        if len(now) == len(places) and moved < 0.05:
            return
        assert time.monotonic() < deadline, f"camera and words do not come to rest: {places} became {now}"
        before, places = passes, now
