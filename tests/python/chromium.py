"""Debian's Chromium, driven by Playwright, for the scripts that test pages."""

import contextlib
import ctypes
import time

from playwright.sync_api import sync_playwright

PROGRAM = "/usr/bin/chromium"
# linux/prctl.h, linux/capability.h
PR_CAPBSET_DROP, CAP_SYS_NICE = 24, 23


@contextlib.contextmanager
def browsers():
    """Returns an object that starts a Chromium. As root, Chromium would raise its priority above all other processes,
    which would then miss their deadlines. Processes started from here on have no right to that."""
    # Refused to users other than root, whose browsers have no such right anyway.
    ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0)
    with sync_playwright() as playwright:
        yield playwright.chromium


@contextlib.contextmanager
def browser():
    """A separate Chromium."""
    with browsers() as chromium, chromium.launch(executable_path=PROGRAM) as started:
        yield started


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
