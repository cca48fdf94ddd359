"""The page of designs in Debian's Chromium.

    design_page.py SCENARIO PROGRAM NAME FOLDER

Starts `design` on files in FOLDER and plays a scenario by pointer and keyboard. Results are compared with those of
other processes, `events --json` and `check --json`, on the text that the page has. Ends with exit code 0, or with a
sentence on the error.
"""

import json
import pathlib
import signal
import struct
import subprocess
import sys
import urllib.parse
import zlib

from chromium import browser as chromium
from design_driver import FOLDER, PROGRAM, SCENARIO, drag, exact, field, handle, is_exact, middle, no_complaints, opened
from design_driver import passes, same_results, server, set_field, set_text, skeleton, template, text_of, undo, until

# No wait here may last forever; an alarm still ends everything that was started.
WATCHDOG = 550

# A village in at most thirty actions.


def village_by_pointer():
    """From a template to PASS, by fields, handles and buttons."""
    with chromium() as browser, server() as (url, _):
        page = opened(browser, url)
        actions = 0

        def act(what, *arguments):
            nonlocal actions
            actions += 1
            what(page, *arguments)

        act(template, "turn")
        act(set_field, "team.benches", 40)
        act(set_field, "require.clearance", 0.3)
        assert verdict(page) == "fail", page.inner_text("#results")
        # A well in the middle of the picture, dragged out of the way, with its keep-out.
        act(add, "obstacle circle")
        pitch = last_field(page, "pitch")
        while verdict(page) != "pass":
            assert actions < 30, page.inner_text("#results")
            obstacles = page.locator("#facts [data-check=require][data-verdict=fail]", has_text="boards")
            if obstacles.count():
                act(set_field, pitch, round(1.1 * float(field(page, pitch).input_value()), 3))
            else:
                act(lambda page: drag(page, handle(page, circle(page)), 60, -60))
        assert actions <= 30
        print(f"PASS after {actions} actions")
        same_results(page)
        scene = FOLDER / "village_by_pointer.toml"
        scene.write_text(text_of(page), encoding="utf-8")
        assert subprocess.run([PROGRAM, "check", str(scene)], capture_output=True).returncode == 0
        no_complaints(page)


def village_by_keyboard():
    """The same without a pointer: Tab, arrow keys, letters."""
    with chromium() as browser, server() as (url, _):
        page = opened(browser, url)
        choose(page, "#template", "turn")
        for name, value in [("team.benches", "40"), ("require.clearance", "0.3")]:
            type_field(page, name, value)
        choose(page, "#add", "obstacle circle")
        pitch, pressed = last_field(page, "pitch"), 4
        while verdict(page) != "pass":
            assert pressed < 30, page.inner_text("#results")
            if page.locator("#facts [data-check=require][data-verdict=fail]", has_text="boards").count():
                type_field(page, pitch, str(round(1.1 * float(field(page, pitch).input_value()), 3)))
            else:
                to(page, f'[data-handle="{circle(page)}"]')
                for _ in range(10):
                    page.keyboard.press("ArrowUp")
                exact(page)
            pressed += 1
        same_results(page)
        no_complaints(page)


def verdict(page):
    return page.get_attribute("#verdict", "data-verdict")


def add(page, what):
    page.select_option("#add", what)
    exact(page)


def circle(page):
    return page.evaluate("design.scene.handles.findLast(({ kind }) => kind === 'centre').name")


def last_field(page, name):
    """The first field of that name that can be changed."""
    return page.evaluate("(name) => design.scene.fields.find((one) => one.name.endsWith(`.${name}`)).name", name)


def to(page, selector):
    """Moves the focus to an element by Tab alone."""
    page.evaluate("document.activeElement.blur()")
    for _ in range(400):
        page.keyboard.press("Tab")
        if page.evaluate("(selector) => document.activeElement.matches(selector)", selector):
            return
        # Tab leaves the text area as any other element.
    raise AssertionError(f"Tab does not reach {selector}")


def choose(page, selector, value):
    """Chooses from a list by its keys."""
    to(page, selector)
    texts = page.evaluate("(selector) => [...document.querySelector(selector).options].map(({ value }) => value)", selector)
    page.keyboard.press("Home")
    for _ in range(texts.index(value)):
        page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    exact(page)


def type_field(page, name, value):
    to(page, f'[data-field="{name}"]')
    page.keyboard.press("Control+a")
    page.keyboard.type(value)
    page.keyboard.press("Tab")
    exact(page)


# Every handle.

def every_handle():
    """A drag changes numbers of the handle's fields, and no other byte. One undo brings the text back."""
    with chromium() as browser, server() as (url, _):
        page = opened(browser, url)
        kinds = set()
        for key in page.evaluate("[...document.getElementById('template').options].map(({ value }) => value)")[1:]:
            template(page, key)
            text = text_of(page)
            for one in page.evaluate("design.scene.handles"):
                if one["kind"] == "insert":
                    continue
                moved = drag_one(page, one, text)
                kinds |= {one["kind"]} if moved else set()
                undo(page)
                assert text_of(page) == text, f"{key}, {one['name']}: undo"
        print("dragged:", *sorted(kinds))
        assert {"end", "pitch", "placement", "centre", "rim", "corner", "keep_out"} <= kinds, kinds
        no_complaints(page)


def drag_one(page, one, text):
    """Drags a handle by pointer; returns whether the text has changed."""
    node = handle(page, one["name"])
    # The handle may be out of sight, or below another one.
    page.evaluate("({ x, y }) => design.picture.camera.view(x, y, 12)", one)
    until(lambda: node.is_visible(), one["name"])
    node.evaluate("(node) => node.parentElement.append(node)")
    passes(page)
    for right, down in [(25, -40), (-40, 30)]:
        drag(page, node, right, down)
        now = text_of(page)
        if now != text:
            break
    bones, numbers = skeleton(text)
    now_bones, now_numbers = skeleton(now)
    assert now_bones == bones or len(now_bones) > len(bones), f"{one['name']}: more than numbers has changed"
    if now_bones == bones:
        changed = sum(a != b for a, b in zip(numbers, now_numbers))
        assert changed <= 2 or one["kind"] in ("middle", "placement", "centre"), (one, changed)
    return now != text


# Texts and steps that are kept.

def server_restarted():
    """A server that is killed, and a page that is loaded again, lose nothing."""
    scene = FOLDER / "kept.toml"
    scene.write_text(PAPER, encoding="utf-8")
    with chromium() as browser:
        with server(scene) as (url, child):
            port = urllib.parse.urlparse(url).port
            page = opened(browser, url)
            set_field(page, "path.pitch", 0.6)
            child.kill()
            until(lambda: page.evaluate("document.documentElement.dataset.connection") == "lost", "the loss")
            # Typing continues meanwhile.
            page.locator("#scene-text").press("Control+End")
            page.keyboard.type("# written without a server\n")
            kept = text_of(page)
        assert "pitch = 0.6" in kept and kept.endswith("# written without a server\n")
        with server(scene, port=port):
            exact(page)
            assert text_of(page) == kept
            same_results(page)
            # A reload has the text, and all earlier ones.
            page.reload()
            exact(page)
            assert text_of(page) == kept
            for _ in range(40):
                if text_of(page) == PAPER:
                    break
                undo(page)
            assert text_of(page) == PAPER
            page.keyboard.press("Control+Shift+z")
            exact(page)
            assert "pitch = 0.6" in text_of(page) and page.input_value('[data-field="path.pitch"]') == "0.6"
            no_complaints(page)


def two_sessions():
    """Two pages of one server change their own texts, in one browser and in two."""
    with chromium() as browser, server() as (url, _):
        first, second = opened(browser, url), opened(browser, url)
        third = opened(browser, url, context=first.context)
        for page, pitch in [(first, 0.6), (second, 0.7), (third, 0.8)]:
            set_field(page, "path.pitch", pitch)
        for page, pitch in [(first, 0.6), (second, 0.7), (third, 0.8)]:
            page.reload()
            exact(page)
            assert float(field(page, "path.pitch").input_value()) == pitch
            same_results(page)
            no_complaints(page)


PAPER = """# The paper's scene: a comment that stays.
name = "paper"

[team]
benches = 223   # with head and tail
head_length = 3.41
body_length = 2.20
width = 0.30
hole_inset = 0.275

[path]
kind = "spiral"
pitch = 0.55    # metres a turn
start_turn = 16

[motion]
head_speed = 1.0
on_contact = "continue"

[alerts]

[[cues]]
name = "lamps"
at = 100.0
"""


def texts_of_all_kinds():
    """Errors stand at their line, and nothing that is typed breaks the page."""
    scene = FOLDER / "hostile.toml"
    scene.write_text(PAPER, encoding="utf-8")
    with chromium() as browser, server(scene) as (url, _):
        page = opened(browser, url)
        drawn = page.evaluate("design.scene.text")
        for text, line in [(PAPER.replace("0.55 ", "0,55 "), 13), (PAPER.replace("pitch = 0.55", "pitch = -1"), 13),
                           (PAPER.replace("width", "widht"), 8)]:
            set_text(page, text)
            error = until(lambda: page.locator("#text-error[data-error]:visible").count() and page.locator("[data-error]"), "an error")
            until(lambda: error.get_attribute("data-line") == str(line), f"line {line}: {error.inner_text()}")
            assert page.evaluate("document.documentElement.dataset.stale") == "true"
            assert page.evaluate("design.scene.text") == drawn, "the last good picture stays"
        hostile = '<img src=x onerror="window.broken=1"><script>window.broken=1</script>'
        quoted = json.dumps(hostile)
        set_text(page, PAPER.replace('"paper"', quoted).replace('"lamps"', quoted))
        until(lambda: is_exact(page) or page.locator("#text-error:visible").count(), "an answer")
        for text in ["", "\0", "\u202e[team]\n" * 50, "[" * 5000, "a = " + "9" * 5000, PAPER.replace("223", "1e9"),
                     PAPER.replace("223", "99999999999999999999"), "x = \"" + "y" * 300_000 + "\""]:
            set_text(page, text)
            until(lambda: page.locator("#text-error:visible").count() or page.locator("#status:not(:empty)").count(), f"an answer to {text[:20]!r}")
        set_text(page, PAPER)
        until(lambda: is_exact(page), "the page again")
        assert page.evaluate("window.broken") is None
        same_results(page)
        no_complaints(page)


def gestures():
    """Undo is one a gesture, shared by text, fields, sliders and handles; the time line, events, pin, files."""
    scene = FOLDER / "gestures.toml"
    scene.write_text(PAPER, encoding="utf-8")
    with chromium() as browser, server(scene, "--save") as (url, _):
        page = opened(browser, url, accept_downloads=True)
        same_results(page)
        fields_and_undo(page)
        events_and_time(page)
        files(page, scene)
        ground_picture(page)
        searches(page)
        assert page.evaluate("[...document.querySelectorAll('button, input, select, textarea')].filter((one) => !one.hidden && !(one.ariaLabel || one.textContent.trim() || one.labels?.[0]?.textContent.trim())).map((one) => one.outerHTML)") == []
        no_complaints(page)


def fields_and_undo(page):
    before = text_of(page)
    slider = page.locator('[data-slider="path.pitch"]')
    drag(page, slider, 20, 0, steps=15)
    slid = text_of(page)
    assert slid != before and skeleton(slid)[0] == skeleton(before)[0]
    assert slid.count("# metres a turn") == 1
    # Keys that go through the browser one by one come a second apart where it is held up: a pause of typing.
    page.evaluate("""(letters) => {
        const area = document.getElementById("scene-text");
        for (const letter of letters) {
            area.setRangeText(letter, area.value.length, area.value.length, "end");
            area.dispatchEvent(new InputEvent("input", { inputType: "insertText" }));
        }
    }""", "# one\n# two\n")
    exact(page)
    set_field(page, "motion.head_speed", 1.5)
    steps = [text_of(page)]
    for _ in range(3):
        undo(page)
        steps.append(text_of(page))
    assert steps[1:] == [slid + "# one\n# two\n", slid, before], steps
    page.locator("#redo").click()
    exact(page)
    assert text_of(page) == slid
    page.locator("#undo").click()
    exact(page)
    assert text_of(page) == before
    # A refused value stays in sight, and the text stays as it was.
    field(page, "path.pitch").fill("-3")
    until(lambda: field(page, "path.pitch").get_attribute("aria-invalid") == "true", "the refusal")
    assert text_of(page) == before
    field(page, "path.pitch").press("Tab")


def events_and_time(page):
    page.locator("#events [data-event=contact] button").click()
    until(lambda: abs(page.evaluate("design.picture.time") - 412.473837682115) < 1e-9, "the time of the contact")
    page.click("#play")
    until(lambda: page.evaluate("design.picture.time") > 412.5, "play from the contact")
    page.click("#play")
    when = page.locator("#when")
    drag(page, when, -200, 0)
    first = page.evaluate("design.picture.time")
    page.click("#play")
    until(lambda: page.evaluate("design.picture.time") > first + 2, "play")
    page.click("#play")
    until(lambda: page.get_attribute("#play", "aria-pressed") == "false", "pause")
    # A cue is dragged to another time.
    before = text_of(page)
    drag(page, page.locator('[data-cue="0"]'), 60, 0)
    after = text_of(page)
    assert after != before and skeleton(after)[0] == skeleton(before)[0], after
    undo(page)
    assert text_of(page) == before
    page.click("#pin")
    assert page.get_attribute("#pin", "aria-pressed") == "true"
    set_field(page, "path.pitch", 0.6)
    assert page.is_visible("#pinned") and "contact at 412.5 s" in page.inner_text("#pinned")
    page.click("#pin")
    undo(page)


def files(page, scene):
    with page.expect_download() as download:
        page.click("#download")
    assert pathlib.Path(download.value.path()).read_text(encoding="utf-8") == text_of(page)
    set_field(page, "path.pitch", 0.56)
    page.keyboard.press("Control+s")
    until(lambda: scene.read_text(encoding="utf-8") == text_of(page), "the saved file")
    other = PAPER + "# another program\n"
    scene.write_text(other, encoding="utf-8")
    set_field(page, "path.pitch", 0.57)
    page.click("#save")
    until(lambda: "changed" in page.inner_text("#status"), "the refusal")
    assert scene.read_text(encoding="utf-8") == other
    before = text_of(page)
    square = {"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {"name": "barn"}, "geometry": {
        "type": "Polygon", "coordinates": [[[20, 20], [24, 20], [24, 23], [20, 23], [20, 20]]]}}]}
    page.set_input_files("#geojson", {"name": "barn.geojson", "mimeType": "application/geo+json",
                                      "buffer": json.dumps(square).encode()})
    until(lambda: text_of(page) != before, "the polygon")
    exact(page)
    assert handle(page, "stage.obstacles[0].polygon[0]").count() == 1, text_of(page)
    undo(page)
    assert text_of(page) == before


def png(width, height):
    """Returns a grey picture."""
    rows = b"".join(b"\0" + bytes([90 + k % 100]) * width for k in range(height))
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def ground_picture(page):
    page.set_input_files("#ground-file", {"name": "ground.png", "mimeType": "image/png", "buffer": png(600, 400)})
    until(lambda: page.is_visible("#ground-picture"), "the picture of the ground")
    # A picture that shows everything may move between the clicks, and so may one that makes room for the curve.
    until(lambda: page.is_visible("#curve"), "the curve")
    page.evaluate("design.picture.camera.release()")
    x, y = middle(page.locator("#stage"))
    page.mouse.click(x - 100, y + 40)
    page.mouse.click(x + 100, y + 40)
    page.fill("#ground-metres", "12.5")
    page.keyboard.press("Enter")
    scale = page.evaluate("design.picture.camera.scale")
    wide, pixels = page.evaluate("parseFloat(document.getElementById('ground-picture').style.width)"), 200
    # The picture was 30 m wide, and the clicks were `pixels` apart.
    until(lambda: abs(page.evaluate("parseFloat(document.getElementById('ground-picture').style.width)")
                      / scale - 30 * 12.5 / (pixels / scale)) < 1e-3, f"the scale: {wide}")
    # Stored, so that a reload has it.
    until(lambda: page.evaluate("(localStorage.getItem('bench-dragon design ground') ?? '').includes('data:image/')"), "kept")
    page.reload()
    exact(page)
    assert page.is_visible("#ground-picture")
    page.click("#ground-remove")
    assert page.is_hidden("#ground-picture")


def searches(page):
    # Near a lock, a handle is faster than any limit; a show that stops at its contact has no lock.
    page.click("[data-plan=speed]")
    until(lambda: "lock" in page.inner_text("#plan-answer"), "the reason of the refusal")
    set_text(page, text_of(page).replace('"continue"', '"stop"'))
    exact(page)
    before = text_of(page)
    page.click("[data-plan=speed]")
    until(lambda: page.is_visible("#plan-discard"), "a result")
    assert page.inner_text("#plan-answer"), "a sentence"
    page.click("#plan-discard")
    assert text_of(page) == before
    page.click("[data-plan=speed]")
    until(lambda: page.is_visible("#plan-use"), "a result that can be used")
    page.click("#plan-use")
    exact(page)
    assert text_of(page) != before and skeleton(text_of(page))[0] == skeleton(before)[0]
    undo(page)
    assert text_of(page) == before
    # In one task: the proof's answer cannot come between the two.
    page.evaluate("""() => {
        document.querySelector("[data-plan=prove]").click();
        const stop = document.getElementById("plan-stop");
        if (!stop.hidden) stop.click();
    }""")
    until(lambda: "Stopped" in page.inner_text("#plan-answer"), "the stop")
    same_results(page)


def small_screens():
    """A tablet edits by touch, a phone only shows, and 1120 x 630 has everything."""
    with chromium() as browser, server() as (url, _):
        page = opened(browser, url, context=browser.new_context(viewport={"width": 820, "height": 1180}, has_touch=True, is_mobile=True))
        before = text_of(page)
        one = page.evaluate("design.scene.handles.find(({ kind }) => kind === 'pitch') ?? design.scene.handles[0]")
        node = handle(page, one["name"])
        box = node.bounding_box()
        assert min(box["width"], box["height"]) >= 44, box
        touch_drag(page, *middle(node), 40, 30)
        until(lambda: text_of(page) != before, "a change by touch")
        exact(page)
        no_complaints(page)
        phone = opened(browser, url, context=browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True))
        assert phone.is_hidden("#scene-text") and phone.is_hidden("#handles")
        assert phone.is_visible("#stage") and phone.is_visible("#when") and phone.is_visible("#events")
        assert phone.evaluate("document.documentElement.scrollWidth <= innerWidth")
        low = opened(browser, url, context=browser.new_context(viewport={"width": 1120, "height": 630}, reduced_motion="reduce"))
        for selector in ["#scene-text", "#fields", "#stage", "#verdict", "#when", "#play", "[data-plan=prove]", "#download"]:
            box = low.locator(selector).bounding_box()
            assert box and box["x"] >= 0 and box["y"] >= 0 and box["x"] + box["width"] <= 1120 and box["y"] + box["height"] <= 631, (selector, box)
        assert low.evaluate("document.documentElement.scrollHeight <= innerHeight")
        no_complaints(low)


def touch_drag(page, x, y, right, down):
    client = page.context.new_cdp_session(page)
    point = lambda share: [{"x": x + right * share, "y": y + down * share}]
    client.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": point(0)})
    for step in range(1, 6):
        client.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": point(step / 5)})
    client.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


signal.signal(signal.SIGALRM, lambda *_: sys.exit(f"{SCENARIO} did not end within {WATCHDOG} s"))
signal.alarm(WATCHDOG)
{scenario.__name__: scenario for scenario in [village_by_pointer, village_by_keyboard, every_handle, server_restarted, two_sessions, texts_of_all_kinds, gestures, small_screens]}[SCENARIO]()
