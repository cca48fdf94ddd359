"""The proved results in the stage picture: only those of the scene with the certificate. Same browser and arguments as
stage_picture.py.

    stage_proofs.py SCENARIO PROGRAM NAME
"""

import contextlib
import decimal
import json
import pathlib
import signal
import subprocess
import tempfile
import threading
import time

from stage_picture import NAME, PROGRAM, browser, drawn, opened, play, started, until, words
from stage_places import CUT, approaching

CONFIG = pathlib.Path(__file__).resolve().parents[2] / "config"
PROVED = "[...document.querySelectorAll(':is(#proofs, #beyond):not([hidden]) li')].filter((one) => one.checkVisibility()).map((one) => one.textContent)"
# Number of proved lines at every picture, with the run of the picture; each change once.
WATCH = """() => {
    window.said = [];
    const look = () => {
        requestAnimationFrame(look);
        const line = `${picture.run} ${document.querySelectorAll(':is(#proofs, #beyond):not([hidden]) li').length}`;
        if (said.at(-1) !== line) said.push(line);
    };
    look();
}"""


class Scenes:
    """Two scenes that differ by a letter of a comment, and the certificate of the first."""

    def __init__(self, folder):
        text = (CONFIG / "school.toml").read_text(encoding="utf-8")
        assert text.startswith("# A school team")
        self.folder, self.own, self.other, self.certificate = folder, folder / "own.toml", folder / "other.toml", folder / "own.jsonl"
        self.own.write_text(text, encoding="utf-8")
        self.other.write_text(text.replace("# A school team", "# A School team", 1), encoding="utf-8")
        subprocess.run([PROGRAM, "--scene", self.own, "events", "--certify", self.certificate], check=True, capture_output=True)
        verdict = subprocess.run([PROGRAM, "verify", "--json", self.certificate], check=True, capture_output=True)
        self.results = {result["event"]: result for result in json.loads(verdict.stdout)["results"]}
        assert self.results["contact"]["status"] == "proved", self.results

    def publisher(self, scene, *arguments):
        return started("--scene", str(scene), "run", "--quiet", "--json", *arguments)

    def before_contact(self):
        """Nearly ten minutes before the contact, longer than any test takes."""
        return ["--start", str(self.results["contact"]["time_lo"] - 3), "--time-scale", "0.0052"]


@contextlib.contextmanager
def scenes():
    with tempfile.TemporaryDirectory() as folder:
        yield Scenes(pathlib.Path(folder))


class View:
    """`view` with arguments: its address, and its lines as they come."""

    def __init__(self, child):
        self.url = json.loads(child.stdout.readline())["url"]
        self.printed, self.logged = [], []
        for stream, lines in ((child.stdout, self.printed), (child.stderr, self.logged)):
            threading.Thread(target=lambda stream=stream, lines=lines: lines.extend(iter(stream.readline, "")), daemon=True).start()

    def until(self, condition, what, seconds=120):
        deadline = time.monotonic() + seconds
        while not condition(self):
            assert time.monotonic() < deadline, f"{what}: not within {seconds} s; printed {self.printed}, logged {self.logged}"
            time.sleep(0.05)

    def checked(self):
        """Returns the verdict on its certificate, once it exists."""
        found = lambda: [line for line in map(json.loads, self.printed) if line["type"] == "certificate"]
        self.until(lambda _: found(), "a verdict")
        return found()[0]

    def warnings(self):
        return [line for line in self.logged if "WARN" in line]

    def errors(self):
        return [line for line in self.logged if "ERROR" in line]


@contextlib.contextmanager
def view(*arguments, others=()):
    names = [part for name in (NAME, *others) for part in ("--name", name)]
    child = subprocess.Popen([PROGRAM, *names, "view", "--json", "--port", "0", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield View(child)
    finally:
        child.kill()
        child.wait()


def nanoseconds(seconds, rounding):
    return str(decimal.Decimal(seconds).quantize(decimal.Decimal("1e-9"), rounding))


def between(result):
    """Returns the interval of a result in whole nanoseconds, rounded outward from the exact value of the doubles."""
    return nanoseconds(result["time_lo"], decimal.ROUND_FLOOR), nanoseconds(result["time_hi"], decimal.ROUND_CEILING)


def kept_from(page, what):
    """Asserts that a picture is drawn, its stage is there, and no proved result is shown, now or in the next second."""
    drawn(page)
    for _ in range(20):
        assert page.evaluate(PROVED) == [], f"{what}: {page.evaluate(PROVED)}"
        assert "proved" not in words(page).lower(), f"{what}: {words(page)!r}"
        time.sleep(0.05)


def checked_while_it_is_seen():
    """The page is loaded before the certificate has been checked: it gets the result without being loaded again."""
    with scenes() as given, browser() as (page, complaints):
        # The rest of the certificate comes after the page has been loaded.
        pipe = given.folder / "pipe.jsonl"
        subprocess.run(["mkfifo", pipe], check=True)
        lines, seen = given.certificate.read_text(encoding="utf-8").splitlines(keepends=True), threading.Event()

        def write():
            with open(pipe, "w", encoding="utf-8") as file:
                file.write(lines[0])
                file.flush()
                seen.wait(100)
                file.writelines(lines[1:])

        threading.Thread(target=write, daemon=True).start()
        with view("--control", "--certificate", str(pipe)) as shown, given.publisher(given.own, *given.before_contact()):
            page.goto(shown.url)
            kept_from(page, "before it has been checked")
            page.evaluate("window.loaded = true")
            seen.set()
            said = until(page, PROVED, "what is proved")
            assert page.evaluate("window.loaded"), "the page was loaded again"
            assert shown.checked()["verdict"] == "proved" and not shown.warnings(), shown.logged
            lo, hi = between(given.results["contact"])
            assert said[0] == f"Contact: proved, first at {lo} to {hi} s", said
            assert len(said) == 4, said
            for result, line in zip(given.results.values(), said):
                if result["status"] == "proved":
                    assert all(part in line for part in between(result)), f"{line}: {result}"
                    # School stops at its contact.
                    assert line.endswith(", after the show") == (result["event"] != "contact"), line
                else:
                    assert result["status"] == "none" and "proved, none" in line, f"{line}: {result}"
            assert page.get_by_role("list", name="Proved by a certificate").count() == 2
            until(page, "document.getElementById('conduct-events').textContent.includes(', proved')", "the mark on the time line")
            # A later page gets the results at once, in Chinese.
            later, _ = opened(page.context.browser)
            later.goto(f"{shown.url}#lang=zh")
            said = until(later, PROVED, "what is proved, in Chinese")
            assert said[0] == f"碰撞：已证明，首次在 {lo} 至 {hi} 秒", said
            # The picture alone has no panel.
            later.goto("about:blank")
            later.goto(f"{shown.url}#show")
            drawn(later)
            assert later.evaluate(PROVED) == []
        until(page, "document.body.innerText.includes('No ') || document.body.innerText.includes('waiting')", "that nothing comes")
        assert page.evaluate(PROVED) == [], "of a publisher that is gone"


def nothing_of_another_scene():
    """A letter of a comment makes another scene; a certificate with a changed number proves nothing."""
    with scenes() as given, browser() as (page, complaints):
        with view("--certificate", str(given.certificate)) as shown, given.publisher(given.other, *given.before_contact()):
            page.goto(shown.url)
            assert shown.checked()["verdict"] == "proved"
            shown.until(lambda it: it.warnings(), "that the certificate is of another scene")
            kept_from(page, "another comment")
            assert len(shown.warnings()) == 1 and "whose text no certificate has" in shown.warnings()[0], shown.logged
            # An open page reports each failed connection to a server that has ended.
            page.goto("about:blank")
        lines = given.certificate.read_text(encoding="utf-8").splitlines(keepends=True)
        at = next(at for at, line in enumerate(lines) if json.loads(line)["type"] == "witness")
        contact = json.loads(lines[at])
        contact["point"][0] += 3
        lines[at] = json.dumps(contact) + "\n"
        tampered = given.folder / "tampered.jsonl"
        tampered.write_text("".join(lines), encoding="utf-8")
        with view("--certificate", str(tampered)) as shown, given.publisher(given.own, *given.before_contact()):
            page.goto(shown.url)
            verdict = shown.checked()
            assert verdict["verdict"] == "refused" and f"line {at + 1}: it does not follow" in verdict["problem"], verdict
            kept_from(page, "a certificate with a changed number")
            # A separate thread reads each of the two outputs.
            shown.until(lambda it: it.errors(), "the log's line on it")
            errors = shown.errors()
            assert len(errors) == 1 and f"line {at + 1}: it does not follow" in errors[0], shown.logged
            assert not complaints, complaints


def gone_with_its_scene():
    """A publisher that is started again under its name with another scene, and again with the first."""
    with scenes() as given, browser() as (page, complaints), view("--certificate", str(given.certificate)) as shown:
        page.goto(shown.url)
        page.evaluate(WATCH)
        runs = []
        for scene in (given.own, given.other, given.own, given.other):
            with given.publisher(scene, *given.before_contact()) as child:
                until(page, f"picture.run !== null && !{json.dumps(runs)}.includes(picture.run)", "the next run")
                runs.append(page.evaluate("picture.run"))
                if scene == given.own:
                    until(page, PROVED, "what is proved")
                else:
                    kept_from(page, "after a restart with another scene")
                child.send_signal(signal.SIGINT)
                child.wait(20)
        said = page.evaluate("said")
        for run, count in map(str.split, said):
            assert count == "0" or run in (runs[0], runs[2]), f"{count} lines were proved of run {run} of {runs}: {said}"
        assert f"{runs[0]} 4" in said and f"{runs[2]} 4" in said, said
        # Once for the scene, however often it comes.
        assert len(shown.warnings()) == 1, shown.logged
        assert not complaints, complaints


def one_of_two_is_proved():
    """Among several dragons, only the dragon with the certified scene has proved results."""
    with scenes() as given, browser() as (page, complaints):
        jade = f"{NAME}_jade"
        child = [PROGRAM, "--name", jade, "--scene", str(given.other), "run", "--quiet", "--json", *given.before_contact()]
        second = subprocess.Popen(child, stdout=subprocess.DEVNULL)
        try:
            with view("--certificate", str(given.certificate), others=[jade]) as shown, given.publisher(given.own, *given.before_contact()):
                page.goto(shown.url)
                until(page, "picture.dragons.length === 2 && picture.dragons.every(({run}) => run !== null)", "both")
                assert shown.checked()["verdict"] == "proved"
                rows = page.locator("#dragons button")
                rows.nth(0).click()
                until(page, PROVED, "what is proved of the first")
                rows.nth(1).click()
                until(page, f"!{PROVED}.length && document.getElementById('name').textContent.includes('{jade}')", "nothing of the second")
                kept_from(page, "the second of two")
                rows.nth(0).click()
                until(page, PROVED, "what is proved of the first, again")
                assert not complaints, complaints
        finally:
            second.kill()
            second.wait()


def seen_where_there_is_little_room():
    """The line of possible events of the show is visible at every size, with and without the transport bar, and no
    other element is lost."""
    cut = CUT.replace("#time,", "#time, #proofs, #proofs li,").replace(".figure, #time", ".figure, #time, #proofs")
    assert cut.count("#proofs") == 3
    with scenes() as given, browser() as (page, complaints), given.publisher(given.own, *given.before_contact()):
        for language, arguments in (("en", []), ("zh", ["--control"])):
            with view("--certificate", str(given.certificate), *arguments) as shown:
                for width, height in [(844, 390), (900, 500), (1120, 630), (1280, 720), (390, 844), (360, 640), (1280, 800)]:
                    page.set_viewport_size({"width": width, "height": height})
                    approaching(page, shown.url, f"lang={language}")
                    until(page, f"{PROVED}.length", "what is proved")
                    until(page, f"!({cut})().length", f"{width} x {height}, {language}: {page.evaluate(cut)} are cut off", 5)
                    wide = page.evaluate("[...document.querySelectorAll('#proofs, #beyond, #proofs li, #beyond li, footer')].filter((one) => one.scrollWidth > one.clientWidth + 1).map((one) => one.id || one.tagName)")
                    assert not wide, f"{width} x {height}, {language}: {wide} overflow"
                    stage = page.locator("#stage").bounding_box()
                    # On the smallest size the transport bar had already taken that much.
                    assert width == 360 or stage["width"] * stage["height"] > 0.3 * width * height, f"{width} x {height}: the picture has {stage}"
        assert not complaints, complaints


if __name__ == "__main__":
    play(checked_while_it_is_seen, nothing_of_another_scene, gone_with_its_scene, one_of_two_is_proved, seen_where_there_is_little_room)
