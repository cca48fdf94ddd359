"""The motion of the stage picture between two frames, in the same browser and with the same arguments as
stage_picture.py:

    stage_motion.py SCENARIO PROGRAM NAME
"""

import json
import math
import subprocess
import time

import numpy

from chromium import at_rest
from stage_picture import CONTACT, PROGRAM, STILL, browser, drawn, passes, play, publisher, server, until

# Number of places of the drawn head until eight frames have been received, and the number of these frames.
PLACES = """() => new Promise((done) => {
    const seen = new Set(), before = picture.received;
    const look = () => {
        seen.add(picture.head.join());
        picture.received < before + 8 ? requestAnimationFrame(look) : done([seen.size, picture.received - before]);
    };
    look();
})"""


def motion_is_smooth_at_any_rate():
    counts = "[picture.received, picture.drawn, picture.sequence, picture.passes]"
    with server() as url, browser(screen=None, viewport={"width": 640, "height": 480}) as (page, complaints):
        page.goto(url)
        with publisher("--start", "100", "--rate", "2"):
            drawn(page)
            places, received = page.evaluate(PLACES)
            assert places > 2 * received > 0, f"{places} places from {received} frames: nothing between them"
        until(page, "document.body.dataset.level === 'waiting'", "the publisher's end")
        with publisher("--start", "100", "--rate", "1000"):
            drawn(page)
            first = page.evaluate(counts)
            until(page, f"picture.sequence >= {first[2]} + 1000 && picture.drawn > {first[1]}", "a thousand frames")
            received, pictures, published, all_passes = (now - then for now, then in zip(page.evaluate(counts), first))
            assert 0 < received < published / 4, f"{received} of {published} frames: a page needs fewer"
            assert pictures >= all_passes / 2, f"{pictures} pictures in {all_passes} passes of the page"
        until(page, "document.body.dataset.level === 'waiting'", "the publisher's end")
        with publisher(*STILL):
            drawn(page)
            at_rest(page)
            before = page.evaluate("picture.drawn")
            passes(page, 30)
            assert page.evaluate("picture.drawn") == before, "a show that is not seen to move is drawn"
        assert not complaints, complaints


def solved_at(times):
    """Returns x, y, heading of every handle at each of some times, by the exact solver."""
    moments = ",".join(repr(time) for time in times)
    command = [PROGRAM, "solve", "--at", moments, "--json"]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    solved = [json.loads(line) for line in lines.splitlines()]
    assert [line["t"] for line in solved] == times, "the solver has other times"
    return [numpy.array(line["handles"])[:, :3] for line in solved]


def between_frames_is_where_the_solver_has_it():
    """At 10 Hz: single precision is 6.7e-7 m up to 16 m from the centre, straight lines would be 0.14 mm off. The test
    is at the start of the show, where the bends are widest. There four frames that a busy machine leaves out in a row
    cost 2.4e-7 m."""
    random = numpy.random.default_rng()
    with server() as url, publisher("--rate", "10"), browser(screen=None) as (page, complaints):
        page.goto(url)
        drawn(page)
        until(page, "picture.received >= 5", "frames to draw between")
        samples = []
        while len(samples) < 40:
            time.sleep(random.uniform(0.02, 0.15))
            samples.append(page.evaluate("[picture.shown.time, [...picture.shown.handles]]"))
        assert not complaints, complaints
    # As shares of the interval of two frames: most times are between frames.
    shares = [10 * moment % 1 for moment, _ in samples]
    assert sum(0.15 < share < 0.85 for share in shares) >= 10, f"only frames were drawn: {shares}"
    worst, turned = 0.0, 0.0
    for (_, shown), exact in zip(samples, solved_at([moment for moment, _ in samples])):
        handles = numpy.array(shown).reshape(-1, 5)
        worst = max(worst, numpy.hypot(*(handles[:, :2] - exact[:, :2]).T).max())
        angles = handles[:, 2] - exact[:, 2]
        turned = max(turned, numpy.abs((angles + math.pi) % (2 * math.pi) - math.pi).max())
    print(f"from {samples[0][0]:.3f} to {samples[-1][0]:.3f} s: {worst:.2e} m, {turned:.2e} rad")
    assert worst < 1e-6, f"a handle is drawn {worst:e} m from where it was"
    assert turned < 2e-6, f"a heading is {turned:e} rad from what it was"


# The simulated time and the handles of every picture drawn in four seconds, or until the show has begun again twice.
PICTURES = """() => new Promise((done) => {
    const seen = [], start = performance.now();
    let loops = 0;
    const look = () => {
        const { time, handles } = picture.shown, passed = performance.now() - start;
        loops += seen.length > 0 && time < seen.at(-1)[0];
        seen.push([time, [...handles]]);
        passed < 4000 || (loops < 2 && passed < 60000) ? requestAnimationFrame(look) : done(seen);
    };
    look();
})"""


def loops_are_not_joined():
    """Every picture drawn while the show loops lies on the spiral; an interpolation between end and start would not."""
    options = ["--start", "411", "--rate", "10", "--loop", "--end-hold", "0"]
    with server() as url, publisher(*options), browser(screen=None, viewport={"width": 640, "height": 480}) as (page, complaints):
        page.goto(url)
        drawn(page)
        pictures = page.evaluate(PICTURES)
        assert not complaints, complaints
    times = numpy.array([moment for moment, _ in pictures])
    jumps = numpy.nonzero(numpy.diff(times) < 0)[0]
    assert len(jumps) >= 2, f"no loop in {len(times)} pictures"
    # A busy machine skips pictures at some ends; no picture has a time between these two.
    ends = [(times[jump], times[jump + 1]) for jump in jumps]
    assert any(end > CONTACT - 0.5 and begin < 411.5 for end, begin in ends), f"from the first to the second: {ends}"
    handles = numpy.array([shown for _, shown in pictures]).reshape(len(pictures), -1, 5)
    growth = 0.55 / (2 * math.pi)
    turns = numpy.hypot(handles[:, :, 0], handles[:, :, 1]) / growth - numpy.arctan2(handles[:, :, 1], handles[:, :, 0])
    beside = growth * numpy.abs((turns + math.pi) % (2 * math.pi) - math.pi)
    assert beside.max() < 1e-3, f"a handle is drawn {beside.max()} m beside the path at {times[beside.max(axis=1).argmax()]} s"


# A reader of three handles at (cubic in t, parabola in t), frames a second apart; its results at times in ms.
READ = """async ([frames, moments, stage]) => {
    const { HermiteReader } = await import("/hermite.js"), reader = new HermiteReader(8);
    if (stage) reader.setStage(stage);
    const empty = reader.at(0);
    for (const frame of frames) reader.push({ ...frame, handles: Float64Array.from(frame.handles.map((n) => n ?? NaN)) });
    return [empty, moments.map((moment) => { const { time, handles } = reader.at(moment); return [time, [...handles]]; })];
}"""


def interpolation_keeps_its_rules():
    """Tests the module that any page can use, apart from the page."""
    curves = [(lambda t, k=k: (1 + k + t * (2 - t * (3 - t)), 5 - k + t * (1 + 2 * t))) for k in range(3)]
    rates = lambda t: (2 - 6 * t + 3 * t * t, 1 + 4 * t)

    def frame(t, velocities=rates, **changes):
        handles = [[*curve(t), 9, *velocities(t)] for curve in curves]
        usual = {"due": 1000 * t, "time": t, "scale": 1, "playing": True, "run": "1", "epoch": 0}
        return {**usual, "handles": sum(handles, []), **changes}

    with server() as url, browser(screen=None) as (page, complaints):
        page.goto(url)

        def at(frames, *moments, stage=None):
            empty, read = page.evaluate(READ, [frames, moments, stage])
            assert empty is None, "something is shown before the first frame"
            return [(moment, numpy.array(handles, float).reshape(3, 5)) for moment, handles in read]

        place = lambda t: numpy.array([curve(t) for curve in curves])
        line = lambda t, a=0, b=1: place(a) + (place(b) - place(a)) * (t - a) / (b - a)
        for t, (moment, handles) in zip((0.25, 0.7), at([frame(0), frame(1)], 250, 700)):
            assert math.isclose(moment, t) and numpy.allclose(handles[:, :2], place(t), atol=1e-12), "no cubic"
            assert numpy.allclose(handles[:, 3:], rates(t), atol=1e-12), "the rates are not those of the cubic"
            heading = math.atan2(*(place(t)[0] - place(t)[1])[::-1])
            assert numpy.allclose(handles[:, 2], heading), "headings do not follow from the positions"
        for moment, handles in at([frame(0), frame(1)], 0, 1000, -50, 1050):
            assert moment in (0, 1) and numpy.array_equal(handles[:, :2], place(moment)), "a frame is not shown as it is"
            assert (handles[:, 2] == 9).all(), "a frame's headings are not shown as they are"
        still = lambda t: (0, 0)
        for frames in ([frame(0), frame(1, still, playing=False)], [frame(0, still, playing=False), frame(1)]):
            ((_, handles),) = at(frames, 400)
            assert numpy.allclose(handles[:, 1], place(0.4)[:, 1], atol=1e-12), "the velocity of a still frame was used"
        none = lambda t: (None, None)
        for frames in ([frame(0, none), frame(1, none)], [frame(0, still, playing=False), frame(1, still, playing=False, scale=1)]):
            ((_, handles),) = at(frames, 400)
            assert numpy.allclose(handles[:, :2], line(0.4)), "no straight line without velocities"
        # The show ends 0.3 s after a frame, and the next frame comes after 1 s.
        ((moment, _), (end, handles)) = at([frame(0), frame(0.3, still, playing=False, due=1000)], 200, 700)
        assert math.isclose(moment, 0.2) and end == 0.3 and numpy.allclose(handles[:, :2], place(0.3)), (moment, end)
        for later in (frame(1, epoch=1), frame(1, epoch=1, time=0.5)):
            for moment, handles in at([frame(0), later], 400, 999):
                assert moment == 0 and numpy.array_equal(handles[:, :2], place(0)), "something lies between two epochs"
        # Two dragons, of one bench and of none: the second handle has the heading of the bench before it.
        dragons = [{"first_handle": 0, "benches": 1}, {"first_handle": 2, "benches": 0}]
        steep = [{**frame(t), "handles": [0, 0, 9, 0, 0, t, 1, 9, 1, 0, 5, 1, 9, 0, 0]} for t in (0, 1)]
        for run, heading in (("1", math.atan2(-1, -0.5)), ("2", math.pi)):
            ((_, handles),) = at(steep, 500, stage={"run_id": run, "dragons": dragons})
            assert math.isclose(handles[1, 2], heading), f"the heading of a dragon's last handle is {handles[1, 2]}"
        # Frames of another run are dropped.
        ((moment, _),) = at([frame(0), frame(1, run="2")], 400)
        assert moment == 1, "a frame of another run is shown"
        assert not complaints, complaints


if __name__ == "__main__":
    play(
        motion_is_smooth_at_any_rate,
        between_frames_is_where_the_solver_has_it,
        loops_are_not_joined,
        interpolation_keeps_its_rules,
    )
