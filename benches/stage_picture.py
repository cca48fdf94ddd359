"""Cost of the stage picture for the publisher, its delay, and the number of pictures a second.

    cargo build --release
    .venv/bin/python benches/stage_picture.py cost      # lateness and step of a 1 kHz publisher: five browsers against none;
                                                        # further arguments go to `run`: cost --realtime 80
    .venv/bin/python benches/stage_picture.py latency   # from sent_ns to received and to drawn, at 20 Hz, 60 Hz and 1 kHz
    .venv/bin/python benches/stage_picture.py long      # pictures a second of a scene of 5,000 benches, and of it as a show
    .venv/bin/python benches/stage_picture.py renderers # the same boards by canvas and by WebGL, in stage_picture_renderers.html
    .venv/bin/python benches/stage_picture.py looks     # processor time and rate of the page, #show and #seat, in turn
    .venv/bin/python benches/stage_picture.py before    # processor time of #show beside the #show before the lanterns, in turn
    .venv/bin/python benches/stage_picture.py film '#seat' 400 412 frames   # 25 pictures a second of show time, as PNG
    .venv/bin/python benches/stage_picture.py pictures [NAME...]   # makes the pictures of the documents, or those

Uses the release build, or the debug build if there is no other. Needs Debian's Chromium and Playwright, which tests/run
installs. Everything runs on this machine, in turn in one run: the ratios are more reliable than the times.
"""

import contextlib
import json
import os
import pathlib
import signal
import statistics
import subprocess
import sys
import tempfile
import time

from playwright.sync_api import sync_playwright

ROOT = pathlib.Path(__file__).resolve().parents[1]
PROGRAM = next(path for kind in ("release", "debug") if (path := ROOT / "target" / kind / "bench-dragon").exists())
NAME = "stage_picture_bench"


@contextlib.contextmanager
def started(*arguments):
    child = subprocess.Popen([PROGRAM, "--name", NAME, *arguments], stdout=subprocess.PIPE, text=True)
    try:
        yield child
    finally:
        child.kill()
        child.wait()


@contextlib.contextmanager
def server(*arguments):
    with started("view", "--json", "--port", "0", *arguments) as child:
        yield json.loads(child.stdout.readline())["url"], child.pid


@contextlib.contextmanager
def pages(url, count, address="", script="", **viewport):
    """Pages, each in a separate Chromium, in which `script` runs first."""
    with contextlib.ExitStack() as stack:
        playwright = stack.enter_context(sync_playwright())
        opened = []
        for _ in range(count):
            chromium = stack.enter_context(playwright.chromium.launch(executable_path="/usr/bin/chromium"))
            opened.append(chromium.new_page(viewport=viewport))
            opened[-1].add_init_script(script)
            opened[-1].goto(url + address)
        yield opened


def picture(page):
    return page.evaluate("({...picture, now: performance.now()})")


def rates(page, seconds):
    """Returns the frames received and pictures drawn per second, and their latencies in ms."""
    first = picture(page)
    page.wait_for_timeout(1000 * seconds)
    last = picture(page)
    passed = (last["now"] - first["now"]) / 1000
    received, drawn = ((last[key] - first[key]) / passed for key in ("received", "drawn"))
    return received, drawn, last["ways"], last["latency"]


def summary_of_a_run():
    """Returns the summary of a 20 s run at 1 kHz."""
    with started("run", "--quiet", "--json", "--rate", "1000", "--start", "100", "--duration", "20", *sys.argv[2:]) as child:
        return json.loads(child.communicate()[0].splitlines()[-1])


def cost():
    """In turn, so that other work of the machine affects all alike."""
    rounds = {"no viewer": [], "server, no browser": [], "five browsers": []}
    for turn in range(3):
        rounds["no viewer"].append(summary_of_a_run())
        with server() as (url, _):
            rounds["server, no browser"].append(summary_of_a_run())
            with pages(url, 5, width=640, height=480):
                rounds["five browsers"].append(summary_of_a_run())
    print(f"{'median of 3 runs of 20 s, us':32}" + "".join(f"{head:>14}" for head in ["wake-up p50", "wake-up p99", "step p50", "step p99", "skipped"]))
    figures = {}
    for who, runs in rounds.items():
        median = lambda part, key: statistics.median(run[part][key] for run in runs) / 1000
        figures[who] = [median(part, key) for part in ("wakeup_ns", "step_ns") for key in ("p50", "p99")]
        skipped = statistics.median(run["skipped"] for run in runs)
        print(f"{who:32}" + "".join(f"{figure:14.1f}" for figure in figures[who]) + f"{skipped:14.0f}")
    for who in ("server, no browser", "five browsers"):
        print(f"{who + ' : no viewer':32}" + "".join(f"{with_ / without:14.2f}" for with_, without in zip(figures[who], figures["no viewer"])))


def spread(figures):
    ordered = sorted(figures)
    if not ordered:
        return "-"
    return f"p50 {ordered[len(ordered) // 2]:.1f}, p99 {ordered[len(ordered) * 99 // 100]:.1f} ms"


def latency():
    for rate in ("20", "60", "1000"):
        with server() as (url, _), started("run", "--quiet", "--json", "--start", "100", "--rate", rate), pages(url, 1, width=1280, height=720) as [page]:
            page.wait_for_timeout(3000)
            received, drawn, ways, drawn_after = rates(page, 10)
            print(f"{rate:>5} Hz: {received:.0f} frames/s received after {spread(ways)}; {drawn:.0f} pictures/s, what they show was sent {spread(drawn_after)} before")


def chromium_cpu():
    """Returns the milliseconds of processor time that every Chromium started here has used so far."""
    parents, used = {}, {}
    for folder in pathlib.Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            fields = (folder / "stat").read_text().rsplit(")", 1)[1].split()
            parents[int(folder.name)] = int(fields[1])
            used[int(folder.name)] = (int(fields[11]) + int(fields[12])) * 1000 / os.sysconf("SC_CLK_TCK")
    def is_here(process):
        while process in parents and process != os.getpid():
            process = parents[process]
        return process == os.getpid()
    return sum(time for process, time in used.items() if process != os.getpid() and is_here(process))


def renderers():
    """In turn, so that other work of the machine affects all alike."""
    found = {"paths": [], "lines": [], "webgl": []}
    for _ in range(5):
        for renderer, turns in found.items():
            with pages((pathlib.Path(__file__).parent / "stage_picture_renderers.html").as_uri(), 1, f"#{renderer}", width=1920, height=1080) as [page]:
                page.wait_for_timeout(1000)
                first, before = page.evaluate("[pictures, performance.now()]"), chromium_cpu()
                page.wait_for_timeout(3000)
                last, after = page.evaluate("[pictures, performance.now()]"), chromium_cpu()
                drawn = last[0] - first[0]
                turns.append((1000 * drawn / (last[1] - first[1]), (after - before) / drawn))
    for renderer, turns in found.items():
        rate, cost = (statistics.median(figures) for figures in zip(*turns))
        print(f"{renderer:6} {rate:5.1f} pictures/s, {cost:5.1f} ms of processor a picture")


TEAMS = [("223 benches", ["--start", "300"]), ("5,000 benches", ["--scene", str(ROOT / "config" / "long.toml")])]


def used_by(url, address, arguments, size, script):
    """Returns pictures a second of a page, and milliseconds of processor a picture."""
    with started("run", "--quiet", "--json", *arguments), pages(url, 1, address, script, **size) as [page]:
        page.wait_for_timeout(4000)
        first, before = picture(page), chromium_cpu()
        page.wait_for_timeout(5000)
        last, after = picture(page), chromium_cpu()
    drawn = max(1, last["drawn"] - first["drawn"])
    return 1000 * drawn / (last["now"] - first["now"]), (after - before) / drawn


def compared(looks, size, turns, *serving, script=""):
    """Measures pages, by their addresses, in turn, so that other work of the machine affects all alike."""
    for name, arguments in TEAMS:
        found = {look: [] for look in looks}
        for _ in range(turns):
            for look, address in looks.items():
                with server(*serving) as (url, _):
                    found[look].append(used_by(url, address, arguments, size, script))
        medians = {look: [statistics.median(figures) for figures in zip(*turns)] for look, turns in found.items()}
        for look, (rate, used) in medians.items():
            print(f"{name}, {size['width']} x {size['height']}: {look:18} {rate:5.1f} pictures/s, {used:6.1f} ms of processor a picture")
        yield medians


def looks():
    list(compared({"page": "", "#show": "#show", "#seat": "#seat"}, {"width": 1280, "height": 720}, 3))


# The last commit whose #show has no lanterns, and the parts that its page lacks: the names, and a stage with one
# dragon's sizes.
BEFORE = "b45e230~1"
VIEW = "crates/outputs/src/view"
OLD_STAGE = ("handle(message) {", 'handle(message) {\n    if (message.type === "stage") message = { ...message, ...message.dragons[0], name: "" };')


# Both draw as many pictures a second: the cost of a page besides its pictures is then the same share of each.
EQUAL = "{ const next = requestAnimationFrame; window.requestAnimationFrame = (draw) => setTimeout(() => next(draw), 80); }"


def before():
    """Serves the page of an earlier commit, as it was, beside the present one."""
    git = lambda *arguments: subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    with tempfile.TemporaryDirectory() as folder:
        for file in git("ls-tree", "--name-only", BEFORE, f"{VIEW}/").split():
            if not file.endswith(".rs"):
                text = git("show", f"{BEFORE}:{file}")
                pathlib.Path(folder, pathlib.Path(file).name).write_text(text.replace(*OLD_STAGE), encoding="utf-8")
        pathlib.Path(folder, "publishers.js").write_text(f"export const publishers = {json.dumps([NAME])};\n", encoding="utf-8")
        pages = {"#show": "#show", "#show before": "pages/index.html#show"}
        for medians in compared(pages, {"width": 1920, "height": 1080}, 5, "--pages", folder, script=EQUAL):
            print(f"    ratio {medians['#show'][1] / medians['#show before'][1]:.2f}")


def film():
    """Pictures of a show that plays as slowly as they are taken."""
    address, begin, end, folder = sys.argv[2], float(sys.argv[3]), float(sys.argv[4]), pathlib.Path(sys.argv[5])
    folder.mkdir(parents=True, exist_ok=True)
    # The lanterns rise before the first picture.
    lead = 0.5
    with server() as (url, _), pages(url, 1, address, width=1920, height=1080) as [page]:
        with started("run", "--quiet", "--json", "--start", str(max(0, begin - lead)), "--time-scale", "0.05"):
            for number in range(int((end - begin) * 25 + 1e-9) + 1):
                while not page.evaluate(f"picture.time !== null && picture.time >= {begin + number / 25}"):
                    page.wait_for_timeout(5)
                page.screenshot(path=folder / f"{number:05}.png")


def long():
    scene = ROOT / "config" / "long.toml"
    with server() as (url, _), started("run", "--quiet", "--json", "--scene", str(scene)), pages(url, 1, width=1920, height=1080) as [page]:
        page.wait_for_timeout(3000)
        received, drawn, _, _ = rates(page, 10)
        print(f"5,000 benches, 1920 x 1080: {received:.1f} frames/s received, {drawn:.1f} pictures/s")
        trace = page.context.new_cdp_session(page)
        trace.send("Profiler.enable")
        trace.send("Profiler.start")
        page.wait_for_timeout(5000)
        profile = trace.send("Profiler.stop")["profile"]
        names = {node["id"]: node["callFrame"]["functionName"] or "(script)" for node in profile["nodes"]}
        times = {}
        for node, delta in zip(profile["samples"], profile["timeDeltas"]):
            times[names[node]] = times.get(names[node], 0) + delta
        whole = sum(times.values())
        top = sorted(times.items(), key=lambda item: -item[1])[:8]
        print("the page's thread: " + ", ".join(f"{name} {100 * part / whole:.0f} %" for name, part in top))
        page.click("#follow")
        page.wait_for_timeout(1000)
        received, drawn, _, _ = rates(page, 5)
        print(f"following the head: {drawn:.1f} pictures/s")
    with server() as (url, _), started("run", "--quiet", "--json", "--scene", str(scene)), pages(url, 1, "#show", width=1920, height=1080) as [page]:
        page.wait_for_timeout(3000)
        print(f"#show: {rates(page, 10)[1]:.1f} pictures/s")


def pictures():
    wide, phone = {"width": 1120, "height": 630}, {"width": 390, "height": 844}
    seconds_before = "picture.time !== null && picture.time >= 412.47 - {}"
    # Lanterns rise for two seconds: on a busy machine a slower show is not far on by then.
    lit = "picture.life === 1 && picture.time > {}"
    coil, square = (["--scene", str(ROOT / "config" / f"{name}.toml")] for name in ("coil", "square"))
    wanted = [
        ("coil", "332 --time-scale 0.25", "#show", wide, lit.format(335.2), *coil),
        ("square", "95", "#light,view=-0.5,-0.5,33", wide, "picture.time > 104", *square),
        ("dark", "405", "#dark", wide, seconds_before.format(4.2)),
        ("light", "405", "#light", wide, "document.body.dataset.level === 'contact' && picture.shown.time >= 412.47"),
        ("phone", "405", "#light", phone, seconds_before.format(4.2)),
        ("show", "333.5 --time-scale 0.1", "#show", wide, lit.format(334)),
        ("close", "403.5 --time-scale 0.1", "#show,view=0,-1.5,8", wide, lit.format(404)),
        ("seat", "400", "#seat", wide, "picture.time > 404"),
        ("seat-head", "372", "#seat=0.05,12,4", wide, "picture.time > 376"),
        ("show-contact", "409.5 --time-scale 0.25", "#show", wide, lit.format(412.1)),
    ]
    for name, start, address, viewport, when, *scene in wanted:
        if sys.argv[2:] and name not in sys.argv[2:]:
            continue
        with server() as (url, _), started(*scene, "run", "--quiet", "--json", "--start", *start.split()), pages(url, 1, address, **viewport) as [page]:
            deadline = time.monotonic() + 120
            while not page.evaluate(when):
                assert time.monotonic() < deadline, f"{name}: not within two minutes"
                page.wait_for_timeout(20)
            # Photographs by night are five times as large as PNG.
            page.screenshot(path=ROOT / "docs" / f"stage-picture-{name}.jpg", type="jpeg", quality=86)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    {"cost": cost, "latency": latency, "long": long, "renderers": renderers, "looks": looks, "before": before, "film": film, "pictures": pictures}[sys.argv[1]]()
