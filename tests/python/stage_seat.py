"""The view from a seat, in the same browser and with the same arguments as stage_picture.py, and the cameras that a page
keeps. Places of the picture are computed here from the truth, by the eye that docs/driving-a-stage-picture.md describes.

    stage_seat.py SCENARIO PROGRAM NAME
"""

import json
import math

import numpy

from stage_picture import HEAD_LENGTH, STILL, browser, drawn, play, publisher, server, started, truth_at, until
from stage_show import BLACK, SEEN, hands, luminance, risen, shot

TURNS, DISTANCE, HEIGHT = 0.1, 19, 4.4
WIDTH, TALL = 1280, 720
BOARD = 1.18


def eye(middle):
    """Returns the function from a place of the stage and its height to a pixel."""
    turn, pitch = 2 * math.pi * TURNS, 0.6 * math.atan2(HEIGHT - 0.9, DISTANCE)
    at = numpy.array([middle[0] + DISTANCE * math.sin(turn), middle[1] - DISTANCE * math.cos(turn), HEIGHT])
    right = numpy.array([math.cos(turn), math.sin(turn), 0])
    ahead = numpy.array([-math.sin(turn) * math.cos(pitch), math.cos(turn) * math.cos(pitch), -math.sin(pitch)])
    up = numpy.cross(right, ahead)
    focus = WIDTH / 2 / math.tan(math.radians(27))

    def pixel(x, y, z):
        ray = numpy.array([x, y, z]) - at
        return numpy.array([WIDTH / 2 + focus * (ray @ right) / (ray @ ahead), TALL / 2 - focus * (ray @ up) / (ray @ ahead)])

    return pixel


def warm(pixels, place, reach):
    """Returns true if most pixels around a place are as light and as warm as lit paper."""
    x, y = numpy.round(place).astype(int)
    part = pixels[y - reach : y + reach + 1, x - reach : x + reach + 1, :3].astype(int)
    return numpy.mean((part[..., 0] > 170) & (part[..., 0] > part[..., 2] + 40)) > 0.6


def seat_shows_the_dragon():
    handles = truth_at(300.0)
    pixel = eye(numpy.round((handles.min(axis=0) + handles.max(axis=0)) / 2))
    view = {"viewport": {"width": WIDTH, "height": TALL}, "reduced_motion": "reduce", "has_touch": True}
    with started("view", "--json", "--port", "0", "--control") as conducted, browser(screen=None, **view) as (page, complaints):
        url = json.loads(conducted.stdout.readline())["url"]
        with publisher(*STILL):
            page.goto(f"{url}#seat={TURNS},{DISTANCE},{HEIGHT}")
            drawn(page)
            risen(page)
            for x, y in handles[::40]:
                said = numpy.array(page.evaluate("([x, y, z]) => picture.toPixel(x, y, z)", [x, y, BOARD]))
                assert numpy.abs(said - pixel(x, y, BOARD)).max() < 0.1, f"({x}, {y}) is at {said}, by the truth at {pixel(x, y, BOARD)}"
            pixels = shot(page)
            assert luminance(pixels[: TALL // 8]).mean() < 0.01, "the sky is not dark"
            near_and_far(pixels, handles, pixel)
            # The cheek of the head, 2 m above the floor and 1.1 m behind the end of its board.
            along = (handles[0] - handles[1]) / numpy.linalg.norm(handles[0] - handles[1])
            skull = (handles[0] + handles[1]) / 2 + (HEAD_LENGTH / 2 - 0.8) * along
            red = pixels[tuple(numpy.round(pixel(*skull, 2.2)).astype(int)[::-1])].astype(int)
            assert red[0] > 120 and red[0] > red[2] + 50, f"the head is {red}"
            # The words are the small line alone; no hand and no key does anything.
            assert page.evaluate(SEEN) == ["seat-note"], page.evaluate(SEEN)
            assert page.inner_text("#seat-note").startswith("Not to scale"), page.inner_text("#seat-note")
            hands(page)
            before = page.evaluate("picture.toPixel(1, 1)")
            for key in ("Shift+Digit1", "Digit1", "Digit9"):
                page.keyboard.press(key)
            assert page.evaluate("picture.toPixel(1, 1)") == before and "PLAYING" in page.evaluate("document.getElementById('playback').textContent")
        until(page, "picture.life === 0", "lanterns that have died down")
        until(page, f"({SEEN}).length === 0", "no words")
        # The last pictures of a slow computer are stills.
        until(page, BLACK, "a black picture")
        assert not complaints, complaints


def near_and_far(pixels, handles, pixel):
    """The middle lantern of each bench is lit where the truth has it, and the floor beside the dragon is not."""
    places = [pixel(*(handles[bench] + handles[bench + 1]) / 2, BOARD + 0.32) for bench in range(1, 223)]
    # Dancers and nearer lanterns stand before some; those in front of the picture hide the lowest rows.
    seen = [place for place in places if 8 < place[0] < WIDTH - 8 and place[1] < 0.78 * TALL]
    lit = numpy.mean([warm(pixels, place, 2) for place in seen])
    assert len(seen) > 100 and lit > 0.6, f"{100 * lit:.0f} % of {len(seen)} lanterns are lit where the truth has them"
    above = [pixel(*(handles[bench] + handles[bench + 1]) / 2, 9) for bench in range(1, 223)]
    dark = numpy.mean([warm(pixels, place, 2) for place in above if 8 < place[0] < WIDTH - 8 and 8 < place[1] < 0.78 * TALL])
    assert dark < 0.05, f"the air above {100 * dark:.0f} % of the benches is as lit"


# Pictures of a given cost, on a clock of its own: 60 passes a second between pictures. Returns for each second whether the
# look is a still, and the pictures drawn.
PACED = """async (cost) => {
    const { Pace } = await import("/pace.js"), pace = new Pace(), seconds = [];
    let now = 0, drawn = 0;
    while (seconds.length < cost.length) {
        if (pace.begin(now)) {
            pace.drawn(now);
            drawn++;
            now += cost[seconds.length];
        } else now += 1000 / 60;
        if (now >= 1000 * (seconds.length + 1)) {
            seconds.push([pace.isStill, drawn]);
            drawn = 0;
        }
    }
    return seconds;
}"""


def slow_computer_shows_stills():
    """Below ten pictures a second the seat is a still that is renewed every four seconds, and the page states that."""
    with server() as url, publisher("--start", "300"), browser(screen=None) as (page, complaints):
        page.goto(f"{url}#seat")
        drawn(page)
        slow = page.evaluate(PACED, [120] * 60)
        assert slow[0] == [False, 9] and all(still for still, _ in slow[10:]), slow
        assert 10 <= sum(count for _, count in slow[20:]) <= 11, slow
        assert not any(still for still, _ in page.evaluate(PACED, [80] * 60)), "twelve pictures a second are no still"
        # A computer that is only busy for a while moves again.
        again = page.evaluate(PACED, [150] * 20 + [30] * 60)
        assert again[19][0] and not again[79][0] and again[79][1] > 20, again
        page.context.new_cdp_session(page).send("Emulation.setCPUThrottlingRate", {"rate": 20})
        until(page, "document.getElementById('seat-note').textContent.includes('A still, renewed every 4 s')", "a still", 100)
        count = "[picture.drawn, picture.passes, performance.now()]"
        before = page.evaluate(count)
        until(page, f"picture.passes > {before[1] + 20} && picture.drawn > {before[0] + 1}", "two renewals", 100)
        after = page.evaluate(count)
        assert after[0] - before[0] <= (after[2] - before[2]) / 4000 + 1, (before, after)
        assert not complaints, complaints


def cameras_are_kept():
    """Shift and a digit keep the camera, on this browser; the digit takes it, on the page and in the seat that hands may
    change."""
    corner = "[picture.toPixel(0, 0), picture.toPixel(1, 1)].flat().map((one) => one.toFixed(2)).join()"
    with server() as url, publisher(*STILL), browser(screen=None) as (page, complaints):
        for address, arrow in [("#keys", "ArrowLeft"), ("#seat,hands", "ArrowUp")]:
            page.goto("about:blank")
            page.goto(f"{url}{address}")
            drawn(page)
            whole = until(page, corner, "a camera")
            for _ in range(3):
                page.keyboard.press("+")
                page.keyboard.press(arrow)
            until(page, f"{corner} !== '{whole}'", "another camera")
            # Until the last key's picture is there, also where the seat is a still that is renewed every 4 s.
            kept = None
            while (now := page.evaluate(corner)) != kept:
                kept = now
                # A plan of a show this slow is drawn again when it has changed only.
                count = "picture.drawn" if "seat" in address else "picture.passes"
                until(page, f"{count} > {page.evaluate(count)} + 1", "two pictures")
            page.keyboard.press("Shift+Digit1")
            page.keyboard.press("0")
            until(page, f"{corner} === '{whole}'", f"{address}: the whole stage")
            page.keyboard.press("Digit1")
            until(page, f"{corner} === '{kept}'", f"{address}: camera 1")
            page.reload()
            drawn(page)
            page.keyboard.press("Digit1")
            until(page, f"{corner} === '{kept}'", f"{address}: camera 1 after a reload")
            page.keyboard.press("Digit9")
            assert page.evaluate(corner) == kept, "an empty camera moves the picture"
        page.goto("about:blank")
        page.goto(f"{url}#keys")
        drawn(page)
        page.keyboard.press("Digit9")
        until(page, "document.getElementById('camera-note').checkVisibility() && document.getElementById('camera-note').textContent.includes('empty')", "a sentence about an empty camera")
        page.keyboard.press("?")
        assert "take a kept camera" in page.inner_text("#keys")
        assert not complaints, complaints


if __name__ == "__main__":
    play(seat_shows_the_dragon, slow_computer_shows_stills, cameras_are_kept)
