"""The page for all users: small windows, large letters, keys, paper, languages, screen readers. Also the tools of the
crew. Same browser and arguments as stage_picture.py.

    stage_reach.py SCENARIO PROGRAM NAME
"""

import json
import math
import re
import subprocess

import numpy

from stage_picture import NAME, PROGRAM, STILL, browser, drawn, listen, opened, play, publisher, server, started, truth_at, until, words
from stage_places import APPROACH
from stage_show import CONTACT, shot

# Windows: phones, and desktop windows at 200 and 400 % zoom.
WINDOWS = [(390, 844), (360, 640), (640, 360), (320, 256)]
PROCESSION = ["--scene", "config/procession.toml"]


def the_picture_keeps_half_of_the_window():
    """At least 55 % of the height, with and without the transport bar; the page scrolls to the rest, and fingers hit it."""
    with server() as url, started("view", "--json", "--port", "0", "--control") as conducted, publisher(*APPROACH) as _, browser(has_touch=True, is_mobile=True) as (page, complaints):
        conduct = json.loads(conducted.stdout.readline())["url"]
        for width, height in WINDOWS:
            for address in (url, conduct):
                page.set_viewport_size({"width": width, "height": height})
                page.goto("about:blank")
                page.goto(address)
                drawn(page)
                until(page, "document.getElementById('time').textContent && document.body.dataset.level === 'approaching'", "figures")
                if address == conduct:
                    until(page, "document.getElementById('conduct').checkVisibility()", "the bar")
                until(page, f"document.getElementById('stage').getBoundingClientRect().height >= 0.54 * {height}", f"{width} x {height}: a picture of half the window")
                wide = page.evaluate("document.scrollingElement.scrollWidth")
                assert wide <= width, f"{width} x {height}: the page is {wide} px wide"
                small = page.evaluate("[...document.querySelectorAll('button, input, select')].filter((one) => one.checkVisibility() && !one.closest('dialog')).map((one) => [one.id, one.getBoundingClientRect()]).filter(([, {width, height}]) => width < 43.9 || height < 43.9).map(([id, {width, height}]) => `${id} ${width} x ${height}`)")
                assert not small, f"{width} x {height}: {small} are too small for a finger"
                page.locator("#help").scroll_into_view_if_needed()
                bottom = page.evaluate("document.getElementById('help').getBoundingClientRect().bottom")
                assert bottom <= height + 1, f"{width} x {height}: the last button is out of reach"
        assert not complaints, complaints


def a_head_that_moves_outward_has_room():
    """The window reaches 3 m ahead of the snout of a procession, soon and at any speed; the head never leaves it."""
    ahead = """(() => {
        if (!picture.shown) return null;
        const [x, y, heading] = picture.shown.handles, edge = document.getElementById("stage").getBoundingClientRect(), metre = Math.hypot(...[0, 1].map((k) => picture.toPixel(1, 0)[k] - picture.toPixel(0, 0)[k]));
        const [px, py] = picture.toPixel(x, y), dx = Math.cos(heading), dy = -Math.sin(heading);
        const room = Math.min(dx > 0 ? (edge.width - px) / dx : dx < 0 ? px / -dx : Infinity, dy > 0 ? (edge.height - py) / dy : dy < 0 ? py / -dy : Infinity);
        return room / metre;
    })()"""
    with server() as url, browser() as (page, complaints):
        for rate in ("1", "4"):
            with publisher(*PROCESSION, "--start", "2", "--time-scale", rate):
                page.goto("about:blank")
                page.goto(url)
                drawn(page)
                until(page, f"{ahead} >= 3", f"3 m ahead of the head at {rate} times the speed")
                page.evaluate(f"(() => {{ window.rooms = []; const look = () => {{ const room = {ahead}; if (room !== null) rooms.push(room); if (rooms.length < 120) requestAnimationFrame(look); }}; look(); }})()")
                until(page, "rooms.length === 120", "a hundred pictures", 90)
                assert page.evaluate("Math.min(...rooms)") > 0, "the head is outside of the picture"
        assert not complaints, complaints


def paper_is_white():
    """A dark page prints a light picture, its name and its time, and nothing else; then it is dark again."""
    with server() as url, publisher(*STILL), browser(color_scheme="dark") as (page, complaints):
        page.goto(url)
        drawn(page)
        until(page, "document.getElementById('time').textContent", "the time")
        page.evaluate("""() => {
            const corner = () => [...document.getElementById("stage").getContext("2d").getImageData(3, 3, 1, 1).data].slice(0, 3);
            addEventListener("beforeprint", () => {
                window.printed = { corner: corner(), theme: document.documentElement.dataset.theme };
            });
            window.corner = corner;
        }""")
        assert max(page.evaluate("corner()")) < 60
        page.pdf()
        until(page, "window.printed", "a print")
        assert min(page.evaluate("printed.corner")) > 200, page.evaluate("printed")
        until(page, "document.documentElement.dataset.theme !== 'light' && Math.max(...corner()) < 60", "a dark page again")
        page.emulate_media(media="print")
        seen = page.evaluate("[...document.body.querySelectorAll('*')].filter((one) => one.checkVisibility() && !one.querySelector('*') && (one.textContent.trim() || one.tagName === 'CANVAS') && one.getClientRects().length && !one.matches('.unseen')).map((one) => one.id || one.tagName)")
        assert sorted(seen) == ["name", "stage", "time"], seen
        assert page.evaluate("[document.body, document.querySelector('main')].map((one) => getComputedStyle(one).backgroundColor)") == ["rgb(255, 255, 255)"] * 2
        assert not complaints, complaints


def everybody_is_told():
    """The browser's language, the stage and its keys for a screen reader, and no motion where none is wanted."""
    with server() as url, publisher(*STILL), browser(locale="zh-CN", reduced_motion="reduce") as (page, complaints):
        page.goto(url)
        drawn(page)
        assert page.evaluate("document.documentElement.lang") == "zh-Hans" and "间距" in page.inner_text("footer"), words(page)
        page.goto("about:blank")
        page.goto(f"{url}#lang=en")
        drawn(page)
        assert page.evaluate("document.documentElement.lang") == "en"
        assert page.get_attribute("#stage", "aria-roledescription") == "stage"
        assert page.evaluate("parseFloat(getComputedStyle(document.getElementById('stage')).transitionDuration)") == 0
        until(page, "document.getElementById('metres').textContent.endsWith(' m')", "the clearance")
        page.keyboard.press("i")
        page.focus("#stage")
        page.keyboard.press("i")
        x, y = truth_at(300.0)[0]
        sentence = until(page, "document.getElementById('spoken').textContent.startsWith('Head') && document.getElementById('spoken').textContent", "the head, spoken")
        assert re.fullmatch(rf"Head at {x:.2f}, {y:.2f} metres\. Speed 1\.00 m/s\. Clearance 0\.\d+ m\.", sentence), sentence
        # A large canvas that is drawn too slowly gets fewer pixels; a quick one, or a few slow pictures, do not.
        ratios = page.evaluate("""async () => {
            const { Resolution } = await import("/resolution.js");
            const after = (count, ms) => {
                const one = new Resolution();
                for (let k = 0; k < count; k++) one.take(ms);
                return one.ratio(2, 1920, 1080);
            };
            return [after(100, 16), after(20, 60), after(100, 30), after(100, 2000)];
        }""")
        assert ratios == [2, 2, 2560 / 1920, 2], ratios
        # Flames rest a minute after a pause: then nothing changes, and nothing is drawn.
        phases, trail = page.evaluate("""async () => {
            const { Show } = await import("/show.js"), show = new Show(false), pose = new Float64Array(10), phases = [];
            for (const now of [1000, 30000, 30500, 70000, 70500, 700000]) {
                show.breathe(now, false);
                show.update({ time: 5, places: pose, stands: now > 1000, jumped: false, coming: { benches: [], seconds: NaN }, happened: null });
                phases.push(show.phase);
            }
            return [phases, show.trail.length];
        }""")
        assert phases[1] != phases[2] and phases[3] == phases[4] == phases[5], phases
        # The light behind the tail does not pile up meanwhile.
        assert trail == 1, trail
        assert not complaints, complaints


def a_loop_is_announced():
    """The time until a loop begins again: from the scene or, for an option of the publisher, from two ends that were
    alike."""
    with server() as url, browser() as (page, complaints):
        page.goto(url)
        said = page.evaluate("""async () => {
            const { Transport } = await import("/transport.js");
            const ends = (stand, ...lengths) => {
                const one = new Transport(), said = [];
                let now = 0, epoch = 0;
                const look = (playback) => one.look(now, { run: "1", epoch, time: playback === 3 ? 412.5 : 400, playback, scale: 1, cue: 0, at: now }, null, () => null, stand);
                look(0);
                for (const length of lengths) {
                    now += 1000;
                    look(3);
                    said.push(one.detail(now + 600, false));
                    now += 1000 * length;
                    epoch++;
                    look(0);
                }
                return said;
            };
            return [ends(5, 5), ends(null, 3, 3.1, 3), ends(null, 3, 9, 4), ends(5, 2, 2, 2)];
        }""")
        end, again = "at 412.5 s", "at 412.5 s · again in {} s".format
        assert said == [[again(5)], [end, end, again(3)], [end, end, end], [again(5), again(5), again(2)]], said
        assert not complaints, complaints


def distances_are_measured():
    """By two clicks, or by Enter at the middle of the picture; and the nearest two boards of a show that stands."""
    with server() as url, publisher("--start", "300", "--paused"), browser() as (page, complaints):
        page.goto(url)
        drawn(page)
        near = until(page, "picture.marks.find(({kind}) => kind === 'nearest')", "the nearest two boards")
        (ax, ay), (bx, by) = ((end["x"], end["y"]) for end in near["line"])
        shown = float(until(page, "document.getElementById('metres').textContent.split(' ')[0]", "the clearance"))
        assert abs(math.hypot(bx - ax, by - ay) - shown) < 1e-3, f"a line of {math.hypot(bx - ax, by - ay)} m where {shown} m are shown"
        until(page, "picture.labels.some(({text}) => text.replace('\\u00a0', ' ') === document.getElementById('metres').textContent)", "the distance on the picture")
        page.click("#measure")
        assert page.get_attribute("#measure", "aria-pressed") == "true" and "click two places" in page.inner_text("#measured")
        box = page.locator("#stage").bounding_box()
        for x, y in [(-2, 1), (1, -3)]:
            px, py = page.evaluate(f"picture.toPixel({x}, {y})")
            page.mouse.click(box["x"] + px, box["y"] + py)
        metres = float(re.match(r"(\d+\.\d{3}) m from ", page.inner_text("#measured")).group(1))
        pixel = 1 / page.evaluate("picture.toPixel(1, 0)[0] - picture.toPixel(0, 0)[0]")
        assert abs(metres - 5) < 2 * pixel, f"{metres} m, not 5, with pixels of {pixel} m"
        until(page, f"picture.labels.some(({{text}}) => text.startsWith('{metres:.3f}'))", "the length on the picture")
        page.keyboard.press("Escape")
        assert not page.is_visible("#measured") and page.get_attribute("#measure", "aria-pressed") == "false"
        # Without a mouse.
        page.focus("#stage")
        page.keyboard.press("m")
        page.keyboard.press("Enter")
        page.keyboard.press("ArrowRight")
        page.keyboard.press("Enter")
        metres = float(re.match(r"(\d+\.\d{3}) m from ", page.inner_text("#measured")).group(1))
        assert abs(metres - 60 * pixel) < pixel, f"{metres} m for 60 pixels of {pixel} m"
        assert not complaints, complaints


def the_clearance_of_the_whole_show_is_a_curve():
    """The curve's points are from chains solved elsewhere: at 300 s it has the frame's clearance; its least place is
    the contact."""
    with server() as url, started("view", "--json", "--port", "0", "--control") as conducted, publisher(*STILL), browser() as (page, complaints):
        page.goto(url)
        drawn(page)
        until(page, "document.getElementById('curve').checkVisibility()", "the curve", 120)
        assert re.fullmatch(r"Clearance over the whole show.*least clearance 0\.000 m at 412\.5 s, benches 1 and 9", page.get_attribute("#curve", "aria-label"))
        assert page.evaluate("document.getElementById('curve').parentElement.tagName") == "FOOTER"
        box, path = page.locator("#curve svg").bounding_box(), page.get_attribute("#curve path", "d")
        points = numpy.array([[float(one) for one in point.split()] for point in path.strip("MZ").split("L")[1:-1]])
        at = numpy.argmin(abs(points[:, 0] - 1000 * 300 / CONTACT))
        metres, shown = 0.001 * 1000 ** ((100 - points[at, 1]) / 100), float(page.inner_text("#metres").split()[0])
        assert abs(metres - shown) < 0.01, f"the curve has {metres} m at 300 s, the frame {shown} m"
        dot, now = (page.evaluate(f"(() => {{ const r = document.querySelector('#curve {tag}').getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; }})()") for tag in ("b", "i"))
        assert abs(dot[0] - box["x"] - box["width"]) < 2 and abs(dot[1] - box["y"] - box["height"]) < 2, (dot, box)
        assert abs(now[0] - box["x"] - box["width"] * 300 / CONTACT) < 2, (now, box)
        # With a transport bar it stands under the time line, and as wide as the way of the thumb.
        page.goto(json.loads(conducted.stdout.readline())["url"])
        until(page, "document.querySelector('#conduct #curve')?.checkVisibility()", "the curve in the bar", 120)
        until(page, "document.querySelector('#conduct-marks i')", "the marks of the time line")
        mark, dot = (page.evaluate(f"(() => {{ const r = document.querySelector('{one}').getBoundingClientRect(); return r.x + r.width / 2; }})()") for one in ("#conduct-marks i", "#curve b"))
        assert abs(mark - dot) < 2, f"the contact is at {mark} on the line, at {dot} on the curve"
        assert not complaints, complaints


def the_chase_stands_in_the_header():
    """LTC's label and error, as long as a chase runs; the death of a chase is shown."""
    import socket
    import threading

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    stop = threading.Event()

    def send():
        # ArtTimeCode at 25 frames a second, by the wall clock.
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as to:
            import time
            began, frame = time.monotonic(), 25 * 3600
            while not stop.wait(max(0, began + (frame - 25 * 3600) / 25 - time.monotonic())):
                label = [frame % 25, frame // 25 % 60, frame // 1500 % 60, frame // 90000]
                to.sendto(b"Art-Net\0\x00\x97\x00\x0e\0\0" + bytes([*label, 1]), ("127.0.0.1", port))
                frame += 1

    with server() as url, publisher("--paused"), browser() as (page, complaints):
        page.goto(url)
        drawn(page)
        listen(page)
        assert not page.is_visible("#chase"), "a line of a chase that does not run"
        sending = threading.Thread(target=send)
        sending.start()
        try:
            with started("chase", "artnet", "--listen", f"127.0.0.1:{port}", "--offset", "01:00:00:00") as chase:
                until(page, r"/ArtTimeCode 01:00:\d\d:\d\d locked, -?\d+(\.\d)? ms/.test(document.getElementById('chase').textContent)", "a locked chase")
                assert page.is_visible("#chase")
                until(page, "heard.some((one) => one.includes('locked'))", "the lock, spoken")
                chase.kill()
                until(page, "document.getElementById('chase').textContent.includes('has died')", "its death")
            with started("chase", "artnet", "--listen", f"127.0.0.1:{port}", "--offset", "01:00:00:00") as chase:
                until(page, "document.getElementById('chase').textContent.startsWith('ArtTimeCode')", "the next chase")
                chase.terminate()
                until(page, "!document.getElementById('chase').checkVisibility()", "no line after its end")
        finally:
            stop.set()
            sending.join()
        assert not complaints, complaints


if __name__ == "__main__":
    play(the_picture_keeps_half_of_the_window, a_head_that_moves_outward_has_room, paper_is_white, everybody_is_told, a_loop_is_announced, distances_are_measured, the_clearance_of_the_whole_show_is_a_curve, the_chase_stands_in_the_header)
