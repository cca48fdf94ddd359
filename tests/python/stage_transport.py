"""The transport state in the page's header: playing, paused, held, waiting for go, ended, disconnected. Same browser
and arguments as stage_picture.py.

    stage_transport.py SCENARIO PROGRAM NAME
"""

import contextlib
import re
import subprocess
import tempfile

from stage_picture import NAME, PROGRAM, browser, listen, play, server, started, until, words
from stage_show import shot, spread

CUES = """
[[cues]]
name = "the coil closes and the drums begin"
at = 300.0
then = "pause"
"""

# Three seconds or more: a busy browser may show a second late.
LATER = r"(0:0[3-9]|0:[1-9]\d|[1-9]\d*:\d\d)"


@contextlib.contextmanager
def cued_scene():
    """The paper's scene with a cue at which the show waits, as a file."""
    with open("config/paper.toml", encoding="utf-8") as paper, tempfile.NamedTemporaryFile("w", encoding="utf-8", suffix=".toml") as file:
        file.write(paper.read().replace("accuracy = 1e-9", 'solver = "newton"') + CUES)
        file.flush()
        yield file.name


def command(*arguments):
    done = subprocess.run([PROGRAM, "--name", NAME, "control", *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def shows(page, word, detail=""):
    """Waits for a word and for a detail that a pattern matches."""
    until(page, f"document.getElementById('playback').textContent.includes({word!r}) && new RegExp({detail!r}).test(document.getElementById('playback-detail').textContent)", f"{word}, {detail}")


def header_says_what_the_show_does():
    """The countdown stands while the show does, and each change is spoken once."""
    with cued_scene() as scene, server() as url, browser(viewport={"width": 1280, "height": 720}) as (page, complaints):
        with started("run", "--quiet", "--json", "--scene", scene, "--start", "200", "--time-scale", "0.5"):
            page.goto(url)
            listen(page)
            shows(page, "▶ PLAYING", "× 0.5")
            command("seek", 299.0)
            # The cue's whole name stays while the show waits, and lies beside the picture.
            shows(page, "GO?", "^cue 1 · the coil closes and the drums begin · waits " + LATER)
            assert page.evaluate("document.title[0]") == "▷", page.title()
            beside_the_picture(page)
            stands(page, 112.47 / 0.5)
            command("go")
            shows(page, "▶ PLAYING", "× 0.5")
            command("pause")
            # The contact is in nine seconds of the show, eighteen of the wall.
            command("seek", 403.5)
            shows(page, "❚❚ PAUSED", r"^for \d")
            until(page, "document.body.dataset.level === 'approaching'", "the approach")
            paused = stands(page)
            heard = page.evaluate("heard.length")
            shows(page, "PAUSED", "^for " + LATER)
            assert stands(page) == paused, "the countdown of a paused show runs"
            # A busy machine can leave the page without frames for a moment; then the page reports that, and "Paused."
            # again.
            further = page.evaluate("heard")[heard:]
            assert set(further) <= {"no frames", "Paused."}, further
            legible(page)
            command("resume")
            shows(page, "▶ PLAYING")
            command("hold")
            shows(page, "■ HELD", r"^for \d+:\d\d$")
            assert page.inner_text("#spoken-at-once") == "Held.", words(page)
            stands(page)
            legible(page)
            command("release")
            shows(page, "❚❚ PAUSED")
            command("seek", 412.0)
            command("resume")
            shows(page, "▣ ENDED", r"^at 412\.5 s$")
            assert not page.locator("#countdown").is_visible()
            said = page.evaluate("heard")
            for sentence in ("Waiting for go: cue 1 · the coil closes and the drums begin.", "Paused.", "Playing.", "Ended."):
                assert sentence in said, (sentence, said)
            waiting = said.count("Waiting for go: cue 1 · the coil closes and the drums begin.")
            assert waiting <= 1 + said.count("no frames"), said
        shows(page, "◌ NO PUBLISHER", r"^picture from t = \d+\.\d s, " + LATER + " ago$")
        legible(page)
        assert not page.locator("#state").is_visible(), "the motion of a dead publisher is stated"
        assert not complaints, complaints


def stands(page, expected=None):
    """Returns the seconds of a countdown that stands: visible, without a filled letter."""
    until(page, "document.body.dataset.stands === 'true'", "a countdown that stands")
    assert "ahead" in page.inner_text("#until"), page.inner_text("#until")
    assert page.get_by_role("timer", name=re.compile("ahead")).count() == 1, "the countdown has no name"
    until(page, "getComputedStyle(document.getElementById('left')).color === 'rgba(0, 0, 0, 0)'", "an outlined countdown")
    left = page.inner_text("#left")
    minutes, seconds = re.fullmatch(r"(?:(\d+):)?(\d+(?:\.\d)?)\s*(?:s|min)", left).groups()
    left = 60 * int(minutes or 0) + float(seconds)
    assert expected is None or abs(left - expected) < 1.1, (left, expected)
    return left


def beside_the_picture(page):
    """No element with words lies on the picture."""
    on = page.evaluate("""() => {
        const stage = document.getElementById("stage").getBoundingClientRect();
        return [...document.querySelectorAll("main *")].filter((one) => one.checkVisibility() && one.textContent.trim() && one.getBoundingClientRect().width).map((one) => one.id);
    }""")
    assert not on, f"{on} on the picture"


def legible(page):
    """The words have a contrast of 4.5 or more, in both themes."""
    for theme in ("light", "dark"):
        page.evaluate("(theme) => { document.documentElement.dataset.theme = theme; }", theme)
        pixels = shot(page)
        for name in ("#playback", "#playback-detail"):
            box = page.locator(name).bounding_box()
            inside = pixels[int(box["y"]) : int(box["y"] + box["height"]), int(box["x"]) : int(box["x"] + box["width"])]
            assert spread(inside) >= 4.5, f"{theme}: {name} has a contrast of {spread(inside):.2f}"
    page.evaluate("delete document.documentElement.dataset.theme")


if __name__ == "__main__":
    play(header_says_what_the_show_does)
