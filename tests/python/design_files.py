"""The page of designs beside commands and files in Debian's Chromium: saving, the token, numbers that fit, hand-outs.

    design_files.py SCENARIO PROGRAM NAME FOLDER

Starts `design` on files in FOLDER. Ends with exit code 0, or with a sentence on the error.
"""

import json
import pathlib
import signal
import subprocess
import sys
import urllib.parse

from chromium import browser as chromium
from design_driver import FOLDER, PROGRAM, SCENARIO, exact, no_complaints, opened, server, set_field, text_of, undo, until

# No wait here may last forever; an alarm still ends everything that was started.
WATCHDOG = 550
CONFIG = pathlib.Path(__file__).resolve().parents[2] / "config"
PAPER = (CONFIG / "paper.toml").read_text(encoding="utf-8")


def saving():
    """No page writes over a text that it has not read: of a second page, or of another program while it was cut off."""
    scene = FOLDER / "saved.toml"
    scene.write_text(PAPER, encoding="utf-8")
    on_disk = lambda: scene.read_text(encoding="utf-8")
    with chromium() as browser:
        with server(scene, "--save") as (url, child):
            port = urllib.parse.urlparse(url).port
            first, second = opened(browser, url), opened(browser, url)
            set_field(first, "path.pitch", 0.56)
            # The second save begins before the first one has an answer.
            first.keyboard.press("Control+s")
            first.keyboard.press("Control+s")
            until(lambda: on_disk() == text_of(first), "the saved file")
            of_first = on_disk()
            set_field(first, "path.pitch", 0.57)
            saved(first, on_disk)
            of_first = on_disk()
            set_field(second, "motion.head_speed", 1.5)
            of_second = text_of(second)
            refused(second)
            assert on_disk() == of_first
            # Loaded again, the page shows the file; its own text is a step before.
            second.reload()
            exact(second)
            assert text_of(second) == of_first
            undo(second)
            assert text_of(second) == of_second
            saved(second, on_disk)
            child.kill()
            until(lambda: first.evaluate("document.documentElement.dataset.connection") == "lost", "the loss")
        other = PAPER + "# another program\n"
        scene.write_text(other, encoding="utf-8")
        with server(scene, "--save", port=port):
            until(lambda: "has changed" in first.inner_text("#status"), "word of the other file")
            exact(first)
            set_field(first, "path.pitch", 0.58)
            refused(first)
            assert on_disk() == other
            first.reload()
            exact(first)
            assert text_of(first) == other
            set_field(first, "path.pitch", 0.59)
            saved(first, on_disk)
            no_complaints(first)


def saved(page, on_disk):
    page.click("#save")
    until(lambda: on_disk() == text_of(page), "the saved file")
    until(lambda: page.inner_text("#status").startswith("Saved"), "word of it")


def refused(page):
    page.click("#save")
    until(lambda: "nothing was written" in page.inner_text("#status"), "the refusal")


def token():
    """Beyond loopback a page without the token shows no scene, and one with it designs and saves."""
    scene = FOLDER / "token.toml"
    scene.write_text(PAPER, encoding="utf-8")
    child = subprocess.Popen([PROGRAM, "design", scene, "--save", "--listen", "0.0.0.0", "--port", "0", "--json"],
                             stdout=subprocess.PIPE, text=True)
    try:
        with chromium() as browser:
            ready = json.loads(child.stdout.readline())
            url = f"http://127.0.0.1:{urllib.parse.urlparse(ready['url']).port}/design"
            stranger = browser.new_context().new_page()
            for fragment in ["", "#token=0123456789abcdef"]:
                stranger.goto(url + fragment)
                stranger.reload()
                until(lambda: "token" in stranger.inner_text("#status"), "the reason")
                assert stranger.evaluate("design.scene") is None and text_of(stranger) == ""
            page = opened(browser, f"{url}#token={ready['token']}")
            assert ready["token"] not in page.evaluate("location.href"), "an address that is shown has no token"
            set_field(page, "path.pitch", 0.56)
            saved(page, lambda: scene.read_text(encoding="utf-8"))
            no_complaints(page)
    finally:
        child.kill()
        child.wait()


def numbers_that_fit():
    """*Fit* gives the marked numbers alone the values that `plan fit` finds."""
    text = (CONFIG / "turnaround.toml").read_text(encoding="utf-8").replace("benches = 223", "benches = 20")
    scene, answer = FOLDER / "fit.toml", FOLDER / "fitted.toml"
    scene.write_text(f"{text}\n[require]\nclearance = 0.5\n", encoding="utf-8")
    with chromium() as browser, server(scene) as (url, _):
        page = opened(browser, url)
        assert page.is_disabled("#plan-fit"), "no number is marked"
        for name in ["path.pitch", "path.turn_radius", "path.arc_ratio"]:
            page.check(f'[data-vary="{name}"]')
        page.uncheck('[data-vary="path.arc_ratio"]')
        # The marks stay where the fields are built again.
        page.select_option("#add", "cue")
        exact(page)
        scene.write_text(text_of(page), encoding="utf-8")
        page.click("#plan-fit")
        until(lambda: page.is_visible("#plan-use"), "numbers that fit")
        page.click("#plan-use")
        exact(page)
        vary = ["--vary", "path.pitch", "--vary", "path.turn_radius"]
        subprocess.run([PROGRAM, "plan", "fit", scene, *vary, "-o", answer], check=True, stdout=subprocess.DEVNULL)
        assert text_of(page) == answer.read_text(encoding="utf-8")
        no_complaints(page)


def hand_outs():
    """The button downloads what `sheets` writes of the text as it stands."""
    with chromium() as browser, server(CONFIG / "procession.toml") as (url, _):
        page = opened(browser, url, accept_downloads=True)
        for value, forms in [(1.25, ["sheets", "csv"]), (1.5, ["sheets-zh"])]:
            set_field(page, "motion.head_speed", value)
            scene = FOLDER / "handed.toml"
            scene.write_text(text_of(page), encoding="utf-8")
            for form in forms:
                page.select_option("#sheets-form", form)
                with page.expect_download() as download:
                    page.click("[data-action=sheets]")
                given = pathlib.Path(download.value.path()).read_text(encoding="utf-8")
                pages, rows = FOLDER / "handed.html", FOLDER / "handed.csv"
                language = "zh" if form == "sheets-zh" else "en"
                subprocess.run([PROGRAM, "sheets", scene, "-o", pages, "--csv", rows, "--lang", language], check=True)
                assert given == (rows if form == "csv" else pages).read_text(encoding="utf-8"), form
                assert download.value.suggested_filename == f"procession.{'csv' if form == 'csv' else 'html'}"
                until(lambda: "benches" in page.inner_text("#plan-answer"), "word of it")
        no_complaints(page)


signal.signal(signal.SIGALRM, lambda *_: sys.exit(f"{SCENARIO} did not end within {WATCHDOG} s"))
signal.alarm(WATCHDOG)
{scenario.__name__: scenario for scenario in [saving, token, numbers_that_fit, hand_outs]}[SCENARIO]()
