"""Times of the page of `design`: from a change to its picture and to its events.

    cargo build --release
    .venv/bin/python benches/design.py              # the table of docs/design-page.md
    .venv/bin/python benches/design.py storm        # the server alone, with 300 changes
    .venv/bin/python benches/design.py picture      # makes docs/design-page.jpg
    .venv/bin/python benches/design.py film         # makes docs/design-page.webp; needs `.venv/bin/pip install pillow`

Uses the release build, Debian's Chromium without a graphics card, and Playwright, which tests/run installs. Everything
runs on this machine, in one run. A change is a number that is typed into a field; its picture is on the canvas at the
end of a pass of the page. A time includes the browser, the server and the way between them.
"""

import contextlib
import io
import json
import math
import os
import pathlib
import statistics
import subprocess
import sys
import time

from playwright.sync_api import sync_playwright
from websockets.sync.client import connect

ROOT = pathlib.Path(__file__).resolve().parents[1]
PROGRAM = next(path for kind in ("release", "debug") if (path := ROOT / "target" / kind / "bench-dragon").exists())
# A scene, a field of it, two values between which it changes, and the number of changes.
SCENES = [
    ("paper.toml", "path.pitch", (0.55, 0.551), 100),
    ("square.toml", None, None, 60),
    ("long.toml", None, None, 30),
]
EXACT = """() => {
    const { session, picture } = design, lists = ["events", "facts"].map((id) => document.getElementById(id).dataset.state);
    return picture.stage && !picture.coming && !session.inFlight && !session.waiting.length && lists.every((one) => one !== "computing");
}"""
AT_REST = """() => {
    const { session, picture } = design, isExact = EXACT, { nearest, newest, shown } = picture.live;
    // The curve comes after the results, and the nearest boards are searched less often than the picture is drawn.
    return isExact() && session.atInFlight === null && session.wantedAt === null && !document.getElementById("curve").hidden
        && nearest.key === [newest.run, shown.from.epoch, shown.time].join();
}""".replace("EXACT", EXACT)
# The outline of a pointer, from its tip (pixels).
ARROW = [(0, 0), (0, 22), (5, 17), (9, 26), (13, 24), (9, 16), (16, 16)]


@contextlib.contextmanager
def design(scene):
    child = subprocess.Popen([PROGRAM, "design", ROOT / "config" / scene, "--json", "--port", "0"], stdout=subprocess.PIPE, text=True)
    try:
        yield json.loads(child.stdout.readline())["url"], child.pid
    finally:
        child.kill()
        child.wait()


@contextlib.contextmanager
def opened(url, **viewport):
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium")
        page = browser.new_page(viewport=viewport or {"width": 1280, "height": 720})
        page.set_default_timeout(120_000)
        page.goto(url)
        until(page, EXACT)
        yield page


def until(page, condition):
    """Waits without the evaluation of strings in the page, which its policy refuses."""
    while not page.evaluate(condition):
        time.sleep(0.005)


def percentile(times, share):
    return sorted(times)[min(len(times) - 1, int(share * len(times)))]


def one_by_one(page, name, values, count):
    """Returns the times from each change to its picture, to its events and to its clearances, ms."""
    for number in range(count):
        page.evaluate("""([name, value]) => {
            const box = document.querySelector(`[data-field="${name}"]`);
            box.value = value;
            box.dispatchEvent(new Event("input"));
        }""", [name, values[number % 2]])
        until(page, EXACT)
    times = page.evaluate("[...design.session.times.values()]")[-count:]
    return {what: [one[what] - one["began"] for one in times if what in one] for what in ("drawn", "events", "facts")}


def flood(page, name, values, seconds=5):
    """Changes a number at every pass of the page, 60 times a second; returns the ms until the last one is exact."""
    return page.evaluate("""async ([name, [from, to], seconds]) => {
        const box = document.querySelector(`[data-field="${name}"]`), begin = performance.now();
        let count = 0;
        while (performance.now() - begin < 1000 * seconds) {
            box.value = from + (to - from) * ((performance.now() - begin) / 1000 / seconds);
            box.dispatchEvent(new Event("input"));
            count++;
            await new Promise((next) => setTimeout(next, 1000 / 60));
        }
        const ended = performance.now(), isExact = EXACT;
        while (!isExact()) await new Promise((next) => setTimeout(next, 1));
        return [count, performance.now() - ended];
    }""".replace("EXACT", EXACT), [name, list(values), seconds])


def processor(pid):
    """Returns the processor time of a process, s."""
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def stopped_search(page, pid):
    """Returns the processor time that the server uses in the second after a search was stopped, ms."""
    page.click("[data-plan=prove]")
    time.sleep(0.3)
    page.evaluate("document.getElementById('plan-stop').click()")
    before = processor(pid)
    time.sleep(1)
    return 1000 * (processor(pid) - before)


def field_of(page):
    """Returns the first pitch, radius or length that can change, and two values."""
    name, value = page.evaluate("""() => {
        const one = design.scene.fields.find(({ name }) => /\\.(pitch|radius|length)$/.test(name) && !name.includes("obstacles"));
        return [one.name, one.value];
    }""")
    return name, (value, round(value * 1.001, 6))


def table():
    print("| scene | picture p50 | p95 | events p50 | p95 | clearances p95 | exact after 5 s of 60 changes/s |")
    print("|---|---|---|---|---|---|---|")
    for scene, name, values, count in SCENES:
        with design(scene) as (url, pid), opened(url) as page:
            if name is None:
                name, values = field_of(page)
            times = one_by_one(page, name, values, count)
            changes, last = flood(page, name, values)
            row = [f"{statistics.median(times[what]):.0f} ms | {percentile(times[what], 0.95):.0f} ms" for what in ("drawn", "events")]
            print(f"| `{scene}` | {' | '.join(row)} | {percentile(times['facts'], 0.95):.0f} ms | {last:.0f} ms ({changes} changes) |", flush=True)
            if scene == "paper.toml":
                stopped = stopped_search(page, pid)
    print(f"\nProcessor time of the server in the second after a stopped proof: {stopped:.0f} ms.")
    print(f"Load average: {os.getloadavg()[0]:.0f} on {os.cpu_count()} cores.")


def storm(changes=300):
    """Sends changes at an even rate, whatever the server answers; prints the times from the last one to its results."""
    for scene, name, _, _ in SCENES:
        # 60 a second, and faster than any picture.
        for seconds in (5, 0.15):
            with design(scene) as (url, _):
                ended = stormed(url.replace("http", "ws") + "design/session", name, changes, seconds)
            print(f"{scene}: {changes} changes in {seconds} s, exact events after {ended[0]:.2f} s, clearances {ended[1]:.2f} s", flush=True)


def stormed(url, name, changes, seconds):
    with connect(url, max_size=None, max_queue=None) as socket:
        def until(is_it):
            while True:
                message = socket.recv(timeout=120)
                if isinstance(message, str) and is_it(answer := json.loads(message)):
                    return answer
        fields = until(lambda answer: answer.get("scene"))["scene"]["fields"]
        until(lambda answer: answer.get("facts"))
        ends = (name,) if name else ("pitch", "radius", "length")
        name, value = next((one["name"], one["value"]) for one in fields if one["name"].endswith(ends))
        begin = time.monotonic()
        for number in range(1, changes + 1):
            time.sleep(max(0, begin + number * seconds / changes - time.monotonic()))
            socket.send(json.dumps({"id": number, "set": {name: value * (1 + 1e-6 * number)}}))
        ended, times = time.monotonic(), []
        for kind in ("events", "facts"):
            until(lambda answer: answer.get("id") == changes and answer.get(kind, {}).get("state") == "exact")
            times.append(time.monotonic() - ended)
        return times


def picture():
    with design("village.toml") as (url, _), opened(url, width=1440, height=810) as page:
        page.evaluate("document.getElementById('when').value = 95; document.getElementById('when').oninput()")
        until(page, "() => design.picture.time > 90")
        time.sleep(1)
        page.screenshot(path=ROOT / "docs" / "design-page.jpg", type="jpeg", quality=80)


class Film:
    """Pictures of a page, ten for each second of the film, with the hand that moves on it."""

    def __init__(self, page):
        self.page, self.pictures, self.at, self.holds = page, [], (620, 420), False

    def take(self, seconds=0.1):
        """Takes a picture that stays for a time, when all of it is exact, however slow this machine is."""
        # Only the film needs it.
        from PIL import Image, ImageDraw
        until(self.page, AT_REST)
        image = Image.open(io.BytesIO(self.page.screenshot())).convert("RGB")
        (x, y), draw = self.at, ImageDraw.Draw(image)
        if self.holds:
            draw.ellipse((x - 14, y - 14, x + 14, y + 14), outline="#d9480f", width=3)
        draw.polygon([(x + across, y + down) for across, down in ARROW], fill="#d9480f", outline="white", width=1)
        self.pictures += [image] * round(10 * seconds)

    def move(self, to, seconds):
        """Moves the hand: it starts and stops slowly."""
        begin, count = self.at, round(10 * seconds)
        for number in range(1, count + 1):
            share = (1 - math.cos(math.pi * number / count)) / 2
            self.at = tuple(a + share * (b - a) for a, b in zip(begin, to))
            self.page.mouse.move(*self.at)
            self.take()

    def click(self, selector, seconds=0.5):
        self.move(self.middle(selector), seconds)
        self.page.mouse.click(*self.at)
        self.take()

    def type(self, field, number):
        """Replaces a number, after scrolling down to its field."""
        selector = f"[data-field='{field}']"
        while self.middle(selector)[1] > self.page.viewport_size["height"] - 20:
            self.move(self.middle("#fields"), 0.3)
            self.page.mouse.wheel(0, 100)
        self.click(selector)
        self.page.keyboard.press("Control+A")
        self.page.keyboard.insert_text(number)
        self.take(0.6)

    def hold(self, holds):
        self.holds = holds
        self.page.mouse.down() if holds else self.page.mouse.up()
        self.take()

    def middle(self, selector):
        until(self.page, AT_REST)
        box = self.page.locator(selector).first.bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def time(self, seconds):
        """Returns the place of a time on the time line, whose knob is 16 pixels wide."""
        box, end = self.page.locator("#when").bounding_box(), float(self.page.get_attribute("#when", "max"))
        return box["x"] + 8 + seconds / end * (box["width"] - 16), box["y"] + box["height"] / 2

    def save(self, path):
        first, *others = self.pictures
        first.save(path, save_all=True, append_images=others, duration=100, loop=0, quality=60,
            method=6, minimize_size=True)
        print(f"{path.name}: {len(self.pictures) / 10:.1f} s, {path.stat().st_size / 1e6:.2f} MB")


def film():
    """From a template to a dragon that walks far enough from itself, as docs/design-page.md describes it."""
    with design("paper.toml") as (url, _), opened(url, width=1120, height=630) as page:
        page.emulate_media(reduced_motion="reduce")
        page.reload()
        until(page, EXACT)
        film = Film(page)
        film.take(0.6)
        film.move(film.middle("#template"), 0.5)
        # An open list is not on a screenshot, so the choice stays for a moment.
        page.evaluate("document.getElementById('template').value = 'turn'")
        film.take(0.5)
        page.select_option("#template", "turn")
        film.take(0.8)
        film.type("team.benches", "60")
        # A zoomed view stays as it is while the dragon walks.
        film.move(film.middle("#stage"), 0.5)
        page.mouse.wheel(0, 90)
        film.take(0.3)
        film.type("require.clearance", "0.5")
        film.take(0.8)
        film.click("#facts [data-verdict=fail] button")
        film.take(1)
        x, y = film.middle("[data-handle='path.pitch']")
        film.move((x, y), 0.5)
        film.hold(True)
        film.move((x + 0.6 * page.evaluate("design.picture.camera.scale"), y), 2.2)
        film.hold(False)
        film.take(0.8)
        film.move(film.time(page.evaluate("design.picture.time")), 0.5)
        film.hold(True)
        film.move(film.time(45), 0.8)
        film.move(film.time(200), 6.4)
        film.hold(False)
        film.take(1.2)
        film.save(ROOT / "docs" / "design-page.webp")


{"film": film, "picture": picture, "storm": storm}.get((sys.argv[1:] or [""])[0], table)()
