"""Drives the page of designs in Debian's Chromium for design_page.py: opens it, types, drags, and compares its results
with those of other processes."""

import contextlib
import json
import pathlib
import re
import subprocess
import sys
import time

_, SCENARIO, PROGRAM, NAME, FOLDER = sys.argv
FOLDER = pathlib.Path(FOLDER)
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.])")


@contextlib.contextmanager
def server(*arguments, port=0):
    child = subprocess.Popen([PROGRAM, "design", *map(str, arguments), "--json", "--port", str(port)],
                             stdout=subprocess.PIPE, text=True)
    try:
        yield json.loads(child.stdout.readline())["url"], child
    finally:
        child.kill()
        child.wait()


def until(condition, what, seconds=120):
    deadline = time.monotonic() + seconds
    while not (result := condition()):
        assert time.monotonic() < deadline, f"not within {seconds} s: {what}"
        time.sleep(0.02)
    return result


def opened(browser, url, context=None, **options):
    context = context or browser.new_context(viewport={"width": 1280, "height": 720}, **options)
    page = context.new_page()
    # Another test's processes can hold a page up for longer than Playwright's 30 s.
    page.set_default_timeout(120_000)
    page.complaints = []
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    # A server that is gone, and one that refuses to write a changed file, are part of the scenarios.
    page.on("console", lambda message: message.type == "error" and not re.search("WebSocket|409", message.text)
            and page.complaints.append(message.text))
    page.goto(url)
    exact(page)
    return page


def is_exact(page):
    """True if picture, events and clearances are those of the text on the page."""
    return page.evaluate("""() => {
        const { session, picture, scene } = design, text = document.getElementById("scene-text").value;
        const states = ["events", "facts"].map((id) => document.getElementById(id).dataset.state);
        return Boolean(scene) && scene.text === text && !session.inFlight && !session.waiting.length && !picture.coming &&
            picture.stage !== null && states.every((state) => state !== "computing");
    }""")


def exact(page):
    until(lambda: is_exact(page), "exact results")


def text_of(page):
    return page.input_value("#scene-text")


def set_text(page, text):
    page.fill("#scene-text", text)


def template(page, key):
    page.select_option("#template", key)
    exact(page)


def field(page, name):
    return page.locator(f'[data-field="{name}"]')


def set_field(page, name, value):
    """Types a value into a field, and leaves the field."""
    box = field(page, name)
    box.fill(str(value))
    box.press("Tab")
    exact(page)


def handle(page, name):
    return page.locator(f'#handles [data-handle="{name}"]')


def middle(locator):
    box = locator.bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def drag(page, locator, right, down, steps=5):
    """Drags an element by pixels, and waits for the results."""
    x, y = middle(locator)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + right, y + down, steps=steps)
    until(lambda: page.evaluate("!design.session.inFlight"), "the answer to the drag")
    page.mouse.up()
    exact(page)


def undo(page):
    page.keyboard.press("Control+z")
    exact(page)


def printed(*arguments):
    """Returns the JSON lines that a command prints."""
    output = subprocess.run([PROGRAM, *map(str, arguments), "--json"], capture_output=True, text=True)
    return [json.loads(line) for line in output.stdout.splitlines()]


def same_results(page):
    """Events and clearances are those of the commands, to the last digit."""
    scene = FOLDER / "compared.toml"
    scene.write_text(text_of(page), encoding="utf-8")
    shown = page.evaluate("[...document.querySelectorAll('#events [data-event]')].map(({ dataset }) => ({ ...dataset }))")
    events = printed("events", scene)
    number = lambda value: "" if value is None else value
    assert len(shown) == len(events), (shown, events)
    for one, event in zip(shown, events):
        assert one["event"] == event["event"] and float(one["time"]) == event["time"], (one, event)
        assert [one["a"], one["b"]] == [str(number(event[key])) for key in ("bench_a", "bench_b")], (one, event)
    facts = page.evaluate("[...document.querySelectorAll('#facts [data-check]')].map(({ dataset }) => ({ ...dataset }))")
    expected = sorted(printed("check", scene), key=lambda fact: fact["check"] != "require")
    assert [fact["check"] for fact in expected] == [one["check"] for one in facts], (facts, expected)
    for one, fact in zip(facts, expected):
        for key in ("clearance", "time"):
            assert one[key] == "" if fact.get(key) is None else float(one[key]) == fact[key], (one, fact)
        assert one.get("verdict") == fact.get("verdict"), (one, fact)


def no_complaints(page):
    assert not page.complaints, page.complaints


def skeleton(text):
    """The text with a sign in place of each number, and the numbers."""
    return NUMBER.sub("#", text), NUMBER.findall(text)
