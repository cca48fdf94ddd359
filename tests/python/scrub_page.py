"""The second thumb of the page's time line: another time of the show, in Debian's Chromium.

    scrub_page.py SCENARIO PROGRAM NAME SCENE

Starts a publisher of SCENE and a server without --control under the service name NAME. `solve --json` has the true
handles, and `control state` the state of the show. Ends with exit code 0, or with a sentence on the error.
"""

import contextlib
import json
import re
import signal
import subprocess
import sys
import time

import numpy as np

from chromium import be_patient, browser as chromium
from show_process import ShowProcess

# No wait here may last forever; an alarm still ends everything that was started.
WATCHDOG = 550

_, SCENARIO, PROGRAM, NAME, SCENE = sys.argv
SHOW = ShowProcess(PROGRAM, NAME)
started, state, until = SHOW.started, SHOW.state, SHOW.until


@contextlib.contextmanager
def served(*arguments, control=()):
    with started("run", SCENE, "--quiet", "--json", "--rate", "50", *arguments):
        until(state, "a publisher")
        with started("view", "--json", "--port", "0", *control) as server:
            yield json.loads(server.stdout.readline())["url"]


def opened(browser, url, complaints):
    page = browser.new_context(viewport={"width": 1280, "height": 720}).new_page()
    page.set_default_timeout(120_000)
    be_patient(page)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(url)
    until(lambda: page.evaluate("picture.drawn > 0"), "a picture")
    return page


def solved(at):
    """Returns the handles of `solve --at` as the wire has them: x, y, heading, vx, vy in 32 bits."""
    rows = subprocess.run([PROGRAM, "solve", SCENE, "--at", at, "--json"], capture_output=True, check=True)
    return np.array([handle[:5] for handle in json.loads(rows.stdout)["handles"]], dtype=np.float32)


def shown(page):
    """Returns the shown time and handles; None while the picture is live or the frame is on its way."""
    found = page.evaluate("picture.scrub && { ...picture.scrub, handles: [...picture.scrub.handles] }")
    return found and (found["time"], np.array(found["handles"], dtype=np.float32).reshape(-1, 5))


def shows(page, at):
    """Waits until the page shows a time, and compares every bit with `solve`."""
    _, handles = until(lambda: (found := shown(page)) and abs(found[0] - float(at)) < 1e-9 and found, f"{at} s")
    truth = solved(at)
    assert handles.shape == truth.shape and (handles.view(np.uint32) == truth.view(np.uint32)).all(), f"{at} s"


def address(page):
    """Returns the page's address. Playwright's own is that of the latest event of navigation, which may be missing."""
    return page.evaluate("location.href")


def number(page, name):
    return float(page.evaluate(f"document.getElementById('scrub-line').{name}"))


def words(page):
    return page.inner_text("#scrub-time")


def contrast(page, front, back):
    """Returns the contrast of two computed colours, as WCAG 2 defines it."""
    def light(colour):
        channels = [int(one) / 255 for one in re.findall(r"\d+", colour)[:3]]
        linear = [one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in channels]
        return sum(part * one for part, one in zip((0.2126, 0.7152, 0.0722), linear))
    of = lambda where: light(page.evaluate(
        "([name, key, pseudo]) => getComputedStyle(document.querySelector(name), pseudo)[key]", list(where)))
    bright, dark = sorted([of(front), of(back)], reverse=True)
    return (bright + 0.05) / (dark + 0.05)


def thumb_shows_another_time():
    complaints = []
    with served("--start", "50", "--time-scale", "0.2") as url, chromium() as browser:
        page = opened(browser, url, complaints)
        until(lambda: not page.evaluate("document.getElementById('scrub').hidden"), "the second thumb")
        assert page.evaluate("document.getElementById('conduct').hidden"), "there is no --control"
        assert shown(page) is None and not page.is_visible("#scrubbed")
        # The thumb is dragged, and the address follows.
        box, end = page.locator("#scrub-line").bounding_box(), number(page, "max")
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        page.mouse.down()
        for share in (0.55, 0.6, 0.7):
            page.mouse.move(box["x"] + box["width"] * share, box["y"] + box["height"] / 2)
        page.mouse.up()
        reached = lambda: (found := re.search(r"#at=([\d.]+)$", address(page))) and abs(float(found.group(1)) / end - 0.7) < 0.05
        until(reached, "the address")
        at = re.search(r"#at=([\d.]+)$", address(page)).group(1)
        shows(page, at)
        assert words(page) == f"t = {float(at):.1f} s, not live" and page.is_visible("#live")
        frame = page.evaluate("getComputedStyle(document.querySelector('main'), '::after').borderTopWidth")
        assert float(frame.removesuffix("px")) >= 4, frame
        # The live show continues, its thumb too, and its frames come.
        before, received = state(), page.evaluate("picture.received")
        share = lambda: float(page.evaluate("document.getElementById('scrub-live').style.getPropertyValue('--share')"))
        place = share()
        until(lambda: share() > place + 0.5 / end, "the live thumb runs on")
        until(lambda: page.evaluate("picture.received") > received + 40, "the live frames continue")
        after = state()
        assert after["playback"] == "playing" and after["sim_time"] > before["sim_time"], (before, after)
        assert after["sim_time"] < 300, "the show has been sought"
        assert shown(page)[0] == float(at), "the shown time stands"
        # Its ghosts: ten seconds before and after, and the next event; each has its words.
        told = until(lambda: (labels := page.evaluate("picture.labels.map(({ text }) => text)")) and
                     any("before" in one for one in labels if one) and labels, "the ghosts' words")
        assert "10 s before" in told and "10 s after" in told and any(one.startswith("contact at 412.5") for one in told if one), told
        page.click("#live")
        until(lambda: shown(page) is None and not page.is_visible("#scrubbed"), "Live")
        until(lambda: "#at" not in address(page), "the address is the live one's")
        assert not complaints, complaints


def address_and_keys():
    complaints = []
    with served("--start", "50", "--time-scale", "0.2", control=("--control",)) as url, chromium() as browser:
        page = opened(browser, url + "#dark&at=300", complaints)
        shows(page, "300")
        assert words(page) == "t = 300.0 s, not live"
        until(lambda: not page.evaluate("document.getElementById('conduct').hidden"), "the bar")
        # Keys of the show conduct the show, those of the second thumb do not, even if all keys are on.
        page.evaluate("document.getElementById('keys-on').click()")
        page.focus("#scrub-line")
        moved = [("ArrowRight", "301"), ("ArrowLeft", "300"), ("PageDown", "290"), ("PageUp", "300"),
                 ("Shift+ArrowRight", "300.1"), ("Home", "0")]
        for key, at in moved:
            page.keyboard.press(key)
            shows(page, at)
        assert page.get_attribute("#scrub-line", "aria-valuetext") == "t = 0.0 s, not live"
        page.keyboard.press("End")
        end = number(page, "max")
        until(lambda: shown(page) and abs(shown(page)[0] - end) < 1e-3, "the end")
        until(lambda: re.search(r"#dark&at=412\.474$", address(page)), "the address keeps its other words")
        # The next Tab reaches Live.
        page.focus("#live")
        page.keyboard.press("Enter")
        until(lambda: shown(page) is None, "Enter on Live")
        assert page.evaluate("document.activeElement.id") == "scrub-line", "the focus stays"
        page.keyboard.press("ArrowRight")
        until(lambda: shown(page), "a key leaves the live picture")
        page.keyboard.press("Escape")
        until(lambda: shown(page) is None and address(page).endswith("#dark"), "Escape")
        show = state()
        assert show["playback"] == "playing" and 50 < show["sim_time"] < 250, f"the show got a command: {show}"
        for theme in ("dark", "light"):
            page.evaluate("(theme) => (document.documentElement.dataset.theme = theme)", theme)
            page.evaluate("document.getElementById('scrub-line').value = 200; document.getElementById('scrub-line').oninput()")
            until(lambda: page.is_visible("#scrubbed"), "the words")
            of_words = contrast(page, ("#scrub-time", "color", None), ("#scrubbed", "backgroundColor", None))
            of_button = contrast(page, ("#live", "color", None), ("#live", "backgroundColor", None))
            of_frame = contrast(page, ("main", "borderTopColor", "::after"), ("main", "backgroundColor", None))
            assert of_words >= 4.5 and of_button >= 4.5 and of_frame >= 3, (theme, of_words, of_button, of_frame)
        page.close()
        # An audience sees the live show.
        for look in ("show", "seat"):
            page = opened(browser, url + f"#{look}&at=300", complaints)
            passed = page.evaluate("picture.passes")
            until(lambda: page.evaluate("picture.passes") >= passed + 3, "passes of the page")
            assert shown(page) is None and not page.is_visible("#scrubbed") and not page.is_visible("#scrub"), look
            page.close()
        assert not complaints, complaints


def several_dragons():
    complaints = []
    with served("--start", "20") as url, chromium() as browser:
        page = opened(browser, url + "#at=60.5", complaints)
        shows(page, "60.5")
        # Each dragon is drawn where it is then: its head is in the picture of that time.
        heads = page.evaluate("picture.labels.filter(({ bench }) => bench === 0).map(({ dragon }) => dragon)")
        assert sorted(set(heads)) == [0, 1], heads
        page.keyboard.press("Escape")
        until(lambda: shown(page) is None, "Escape")
        assert not complaints, complaints


signal.signal(signal.SIGALRM, lambda *_: sys.exit(f"{SCENARIO} did not end within {WATCHDOG} s"))
signal.alarm(WATCHDOG)
{scenario.__name__: scenario for scenario in [thumb_shows_another_time, address_and_keys, several_dragons]}[SCENARIO]()
