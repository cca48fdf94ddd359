"""The page with control: the transport bar in Debian's Chromium, with a publisher that executes its commands.

    conduct_page.py SCENARIO PROGRAM NAME SCENE

Starts a server and a publisher of SCENE under the service name NAME. Another process, `control state`, reads the state
of the publisher. Ends with exit code 0, or with a sentence on the error.
"""

import contextlib
import functools
import http.server
import json
import re
import signal
import subprocess
import sys
import threading
import time

from chromium import be_patient, browser as chromium
from show_process import ShowProcess

# No wait here may last forever; an alarm still ends everything that was started.
WATCHDOG = 550
CONTACT = 412.473837682115

_, SCENARIO, PROGRAM, NAME, SCENE = sys.argv
SHOW = ShowProcess(PROGRAM, NAME)
started, state, until = SHOW.started, SHOW.state, SHOW.until


@contextlib.contextmanager
def publisher(*arguments, scene=SCENE):
    with started("run", scene, "--quiet", "--json", "--rate", "50", *arguments) as child:
        until(state, "a publisher")
        yield child


@contextlib.contextmanager
def server(*arguments):
    with started("view", "--json", "--port", "0", *arguments) as child:
        yield json.loads(child.stdout.readline())


def opened(browser, url):
    page = browser.new_context(viewport={"width": 1280, "height": 720}).new_page()
    # Another test's processes can hold a page up for longer than Playwright's 30 s.
    page.set_default_timeout(120_000)
    be_patient(page)
    page.complaints = []
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.goto(url)
    until(lambda: page.evaluate("picture.drawn > 0"), "a picture")
    return page


def bar_is_shown(page):
    return page.evaluate("!document.getElementById('conduct').hidden")


def says(page, words):
    until(lambda: words in page.inner_text("#conduct-answer"), f"the sentence {words!r}")


def bar_conducts():
    with publisher("--start", "100") as _, server() as closed, server("--control") as ready, chromium() as browser:
        # Without --control: no bar, and a command is refused with a sentence.
        page = opened(browser, closed["url"])
        assert closed["token"] is None and not bar_is_shown(page), "the bar is there without --control"
        answer = """() => new Promise((done) => {
            const socket = new WebSocket(`ws://${location.host}/frames?rate=1`);
            socket.onopen = () => socket.send('{"command":"pause","id":3}');
            socket.onmessage = ({ data }) => typeof data === "string" && JSON.parse(data).type === "answer" && done(data);
        })"""
        refused = json.loads(page.evaluate(answer))
        assert (refused["id"], refused["code"]) == (3, None) and "--control" in refused["sentence"], refused
        page.keyboard.press("Space")
        assert state()["playback"] == "playing"
        page.close()
        page = opened(browser, ready["url"])
        until(lambda: bar_is_shown(page), "the bar")
        buttons(page)
        time_line(page)
        keys_before_the_time_line(browser, ready["url"])
        keyboard(page)
        held(page)
        page = at_the_end(page, browser, ready["url"])
        assert not page.complaints, page.complaints


def buttons(page):
    page.get_by_role("button", name="Pause").click()
    paused = until(lambda: (now := state())["playback"] == "paused" and now, "Pause pauses")
    until(lambda: page.inner_text("#conduct-toggle") == "Play", "the button becomes Play")
    page.get_by_role("button", name="Step").click()
    until(lambda: abs(state()["sim_time"] - paused["sim_time"] - 0.02) < 1e-9, "Step is one period")
    page.get_by_label("Speed").select_option("4 ×")
    page.get_by_role("button", name="Play").click()
    until(lambda: state()["time_scale"] == 4.0, "the speed")
    page.get_by_role("button", name="Restart").click()
    until(lambda: 100 <= state()["sim_time"] < 105, "Restart")
    page.get_by_role("button", name="Pause").click()
    until(lambda: state()["playback"] == "paused", "Pause")


def place_on_line(page, time):
    """Returns the place of a time of the show on the time line."""
    box, end = page.locator("#conduct-seek").bounding_box(), float(page.get_attribute("#conduct-seek", "max"))
    thumb = page.evaluate("parseFloat(getComputedStyle(document.documentElement).fontSize)")
    return box["x"] + thumb / 2 + (box["width"] - thumb) * time / end, box["y"] + box["height"] / 2


def time_line(page):
    end = float(page.get_attribute("#conduct-seek", "max"))
    assert abs(end - CONTACT) < 1e-9, "the time line ends where the show does"
    marks = page.evaluate("[...document.querySelectorAll('#conduct-marks i')].map((mark) => [mark.dataset.kind, Number(mark.dataset.time), mark.getBoundingClientRect().x + 2])")
    assert [mark[0] for mark in marks] == ["contact", "cue", "cue"], marks
    for (_, at, x), true in zip(marks, [CONTACT, 150.0, 300.0]):
        assert abs(at - true) < 1e-9 and abs(x - place_on_line(page, true)[0]) < 1.5, marks
    # A drag seeks on its way, at most about ten times a second, and to its end exactly.
    page.evaluate("(() => { const { send } = WebSocket.prototype; window.sent = []; WebSocket.prototype.send = function (text) { sent.push(text); window.socket = this; if (!(window.swallows && text.includes('seek'))) send.call(this, text); }; new MutationObserver(() => (window.disabled = true)).observe(document.getElementById('conduct-restart'), { attributeFilter: ['disabled'] }); })()")
    page.mouse.move(*place_on_line(page, state()["sim_time"]))
    page.mouse.down()
    began = time.monotonic()
    for step in range(60):
        page.mouse.move(*place_on_line(page, 100 + 3 * step))
    until(lambda: 105 < state()["sim_time"] < 290, "seeks during the drag")
    # A connection that breaks for a moment does not take the time line out of the hand.
    page.evaluate("window.socket.close()")
    until(lambda: page.evaluate("window.disabled"), "the bar knows that there is no server")
    until(lambda: page.is_enabled("#conduct-restart"), "the bar knows that the server is back")
    page.mouse.move(*place_on_line(page, 250))
    took = time.monotonic() - began
    page.mouse.up()
    until(lambda: abs(state()["sim_time"] - 250) < 0.6, "the seek to the end of the drag")
    seeks = [text for text in page.evaluate("sent") if '"seek"' in text]
    assert 1 < len(seeks) <= 10 * took + 3, f"{len(seeks)} seeks in {took} s"
    until(lambda: abs(float(page.input_value("#conduct-seek")) - state()["sim_time"]) < 0.1, "the thumb is where the show is")
    # A screen reader reads the value.
    until(lambda: re.fullmatch(r"\d+(\.\d)?", page.input_value("#conduct-seek")), "a value with tenths")
    # A connection that breaks before the answer to a seek: the bar reports it, and the server's return makes no late
    # jump.
    before, sent = state(), lambda: sum('"seek"' in text and "120" in text for text in page.evaluate("sent"))
    page.evaluate("window.swallows = true; window.sent.length = 0")
    seek(page, 120)
    until(sent, "a seek on its way")
    page.evaluate("window.socket.close(); window.swallows = false")
    says(page, "The connection broke: no answer came.")
    until(lambda: page.is_enabled("#conduct-restart"), "the bar knows that the server is back again")
    until(lambda: abs(float(page.input_value("#conduct-seek")) - before["sim_time"]) < 0.1, "the thumb is where the show is, again")
    assert state()["sim_time"] == before["sim_time"] and before["playback"] == "paused", (before, state())
    assert sent() == 1, "the seek is sent again"


def keys_before_the_time_line(browser, url):
    """An arrow key moves the show from where it is, or not at all: at first the time line has no length."""
    page = browser.new_context().new_page()
    be_patient(page)
    page.add_init_script("""{
        const { setInterval } = window;
        window.setInterval = (act, interval) => setInterval(() => window.begins && act(), interval);
    }""")
    page.goto(url)
    until(lambda: bar_is_shown(page) and page.evaluate("picture.drawn > 0"), "the bar of a page without a time line")
    before = state()["sim_time"]
    page.click("#help")
    page.check("#keys-on")
    page.keyboard.press("Escape")
    page.evaluate("document.activeElement.blur()")
    for key in ("ArrowRight", "ArrowLeft", "."):
        page.keyboard.press(key)
    until(lambda: abs(state()["sim_time"] - before - 0.08) < 1e-6, "a step, and no seek")
    page.evaluate("window.begins = true")
    until(lambda: page.is_enabled("#conduct-seek"), "the time line")
    page.close()


def keyboard(page):
    page.mouse.click(640, 5)
    page.evaluate("document.activeElement.blur()")
    before = state()["sim_time"]
    keys_are_off(page, before)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowLeft")
    until(lambda: abs(state()["sim_time"] - before - 5) < 1e-6, "two arrows to the right and one to the left are 5 s")
    # In the picture, arrows move the picture; the other keys also send commands there. A period of 1/50 s at a rate of
    # 4.
    page.focus("#stage")
    page.keyboard.press("ArrowRight")
    page.keyboard.press(".")
    until(lambda: abs(state()["sim_time"] - before - 5.08) < 1e-6, "a step, and no seek")
    page.keyboard.press("Space")
    until(lambda: state()["playback"] == "playing", "space resumes")
    # A cue that is passed: its name.
    page.keyboard.press("Space")
    until(lambda: state()["playback"] == "paused", "space pauses")
    page.evaluate("document.activeElement.blur()")
    page.get_by_label("Speed").select_option("1 ×")
    seek(page, 149.8)
    page.get_by_role("button", name="Play").click()
    until(lambda: "cue 1 · lamps" in "".join(page.locator("#playback-detail").all_inner_texts()), "the cue's name")
    seek(page, 299.9)
    # The second cue pauses: Play continues from there.
    until(lambda: (now := state())["playback"] == "paused" and now["sim_time"] == 300.0, "the cue that pauses")
    until(lambda: "".join(page.locator("#playback-detail").all_inner_texts()).startswith("cue 2 · coil · waits "), "its name")
    page.get_by_role("button", name="Play").click()
    until(lambda: state()["playback"] == "playing", "on from the cue")


def keys_are_off(page, before):
    """Letters typed anywhere conduct nothing, and the bar states that; with the focus in the bar they conduct. Then the
    keys are switched on, and stay on."""
    for key in ("h", ".", "Space", "ArrowRight"):
        page.keyboard.press(key)
    says(page, "Keys conduct only in this bar")
    assert (state()["playback"], state()["sim_time"]) == ("paused", before), state()
    page.focus("#conduct-restart")
    page.keyboard.press("h")
    until(lambda: state()["playback"] == "held", "H in the bar holds")
    # A second H releases once the page knows of the hold.
    until(lambda: page.get_attribute("#conduct-hold", "aria-pressed") == "true", "the button is latched")
    page.keyboard.press("h")
    until(lambda: state()["playback"] == "paused", "H in the bar releases")
    page.click("#help")
    assert page.is_visible("#keys-conduct") and not page.is_checked("#keys-on")
    page.check("#keys-on")
    page.keyboard.press("Escape")
    page.reload()
    until(lambda: bar_is_shown(page) and page.is_enabled("#conduct-seek"), "the page again")
    assert page.is_checked("#keys-on"), "the choice is forgotten"
    page.evaluate("document.activeElement.blur()")


def seek(page, moment):
    page.evaluate("(time) => { const line = document.getElementById('conduct-seek'); line.value = time; line.onchange(); }", moment)


def held(page):
    page.keyboard.press("h")
    until(lambda: state()["playback"] == "held", "h holds")
    hold = page.locator("#conduct-hold")
    until(lambda: hold.get_attribute("aria-pressed") == "true" and "HELD" in hold.inner_text(), "the button is latched")
    page.get_by_role("button", name="Play").click()
    says(page, "Resume is refused: the show is held.")
    assert state()["playback"] == "held"
    hold.click()
    until(lambda: state()["playback"] == "paused", "release")
    until(lambda: hold.inner_text() == "Hold", "the button is not latched any more")
    names = page.evaluate("[...document.querySelectorAll('#conduct button, #conduct input, #conduct select')].map((one) => (one.labels?.[0] ?? one).textContent || one.ariaLabel)")
    assert all(names), names


def at_the_end(page, browser, url):
    """A page that loads while the show is paused sets its speed, and at the end the button does as its label states."""
    page.close()
    page = opened(browser, f"{url}#keys")
    until(lambda: bar_is_shown(page) and page.locator("#conduct-rate option").count() > 1, "the speeds")
    assert page.locator("#conduct-rate").input_value() == "", "the speed of a paused show is unknown"
    page.keyboard.press("]")
    says(page, "The speed is not known until the show plays.")
    page.get_by_label("Speed").select_option("2 ×")
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("]")
    until(lambda: page.locator("#conduct-rate").input_value() == "4", "the speed that was set")
    assert state()["playback"] == "paused"
    seek(page, CONTACT - 2)
    page.get_by_role("button", name="Play").click()
    until(lambda: state()["time_scale"] == 4.0, "that speed")
    until(lambda: state()["playback"] == "ended", "the end")
    until(lambda: page.inner_text("#conduct-toggle") == "Pause", "time passes at the end, too")
    page.get_by_role("button", name="Pause").click()
    until(lambda: state()["playback"] == "paused", "Pause at the end")
    until(lambda: page.inner_text("#conduct-toggle") == "Play", "the button becomes Play")
    return page


def token_and_own_pages():
    with publisher("--start", "100") as _, chromium() as browser, server("--control", "--listen", "0.0.0.0") as ready:
        port = ready["url"].rstrip("/").rsplit(":", 1)[1]
        here = f"http://127.0.0.1:{port}/"
        # A client without a token, or with a wrong one, may watch.
        for fragment in ["", "#token=0123456789abcdef0123456789abcdef"]:
            page = opened(browser, here + fragment)
            # The server has answered to the token, if there is one, long before the tenth further frame.
            received = page.evaluate("picture.received")
            until(lambda: page.evaluate("picture.received") >= received + 10, "frames")
            assert not bar_is_shown(page), fragment
            page.keyboard.press("Space")
            page.close()
        assert state()["playback"] == "playing"
        page = opened(browser, f"{here}#dark,token={ready['token']}")
        until(lambda: bar_is_shown(page), "the bar, with the token")
        assert page.url == f"{here}#dark", "the token does not stay in the address"
        page.reload()
        until(lambda: page.evaluate("picture.drawn > 0") and bar_is_shown(page), "the bar, loaded again")
        page.click("#conduct-toggle")
        until(lambda: state()["playback"] == "paused", "the button pauses")
    own = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory="examples/page"))
    threading.Thread(target=own.serve_forever, daemon=True).start()
    elsewhere = f"http://127.0.0.1:{own.server_port}"
    with publisher("--start", "100") as _, chromium() as browser:
        with server("--pages", "examples/page") as ready:
            page = browser.new_page()
            page.goto(ready["url"] + "pages")
            assert page.url == ready["url"] + "pages/"
            until(lambda: page.evaluate("page.time") is not None, "frames on the user's own page")
            page.close()
            assert not gets_frames(browser, elsewhere, ready), "a page from elsewhere is admitted without a setting"
        with server("--allow-origin", elsewhere) as ready:
            assert gets_frames(browser, elsewhere, ready), "an admitted page gets nothing"


# Heads, and the other boards of the first and of the second dragon on the example page.
HEAD, FIRST, SECOND = "ffd24a", "1fb8a6", "e2572b"
# The pixels of each colour, and the pixels of a metre.
COLOURS = """() => {
    const canvas = document.querySelector("canvas"), context = canvas.getContext("2d"), counts = {};
    const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
    for (let k = 0; k < data.length; k += 4) {
        const colour = data[k + 3] ? [0, 1, 2].map((one) => data[k + one].toString(16).padStart(2, "0")).join("") : "";
        counts[colour] = (counts[colour] ?? 0) + 1;
    }
    return [counts, canvas.width, canvas.height];
}"""


def own_page_draws():
    """The example page has as many pixels of each colour as its boards have square metres. Only edges are blended."""
    head, body = 3.41 * 0.30, 2.20 * 0.30
    for scene, at, expected in [
        ("config/paper.toml", 100, {HEAD: head, FIRST: 222 * body}),
        ("config/coil.toml", 100, {HEAD: 2 * head, FIRST: 59 * body, SECOND: 59 * body}),
    ]:
        rows = subprocess.run([PROGRAM, "solve", scene, "--at", str(at), "--json"], capture_output=True, check=True)
        handles = json.loads(rows.stdout)["handles"]
        spans = [max(row[axis] for row in handles) - min(row[axis] for row in handles) for axis in (0, 1)]
        with publisher("--start", str(at), "--paused", scene=scene), chromium() as browser, server("--pages", "examples/page") as ready:
            page = browser.new_context(viewport={"width": 1600, "height": 1200}).new_page()
            page.goto(ready["url"] + "pages/")
            until(lambda: len(page.evaluate(COLOURS)[0]) > 1, "a picture on the user's own page")
            counts, wide, high = page.evaluate(COLOURS)
            metre = 0.9 * min(wide / (spans[0] + 2), high / (spans[1] + 2))
            for colour, metres in expected.items():
                share = counts.get(colour, 0) / (metres * metre**2)
                assert 0.6 < share < 1.02, f"{scene}: {share} of the area of {colour}: {counts.get(colour)} pixels"
            assert (SECOND in expected) == (SECOND in counts), scene


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def gets_frames(browser, elsewhere, ready):
    """Returns true if the example page, served from elsewhere, gets frames, and false if it is refused."""
    page, closed = browser.new_page(), []
    page.on("console", lambda message: "403" in message.text and closed.append(message.text))
    page.goto(f"{elsewhere}/?{ready['url'].split('/')[2]}")
    until(lambda: closed or page.evaluate("page.time") is not None, "frames, or a refusal")
    page.close()
    return not closed


signal.signal(signal.SIGALRM, lambda *_: sys.exit(f"{SCENARIO} did not end within {WATCHDOG} s"))
signal.alarm(WATCHDOG)
{scenario.__name__: scenario for scenario in [bar_conducts, token_and_own_pages, own_page_draws]}[SCENARIO]()
