"""The words on the picture belong to the boards that they name, in the same browser and with the same arguments as
stage_picture.py:

    stage_labels.py SCENARIO PROGRAM NAME
"""

import time

import numpy

from chromium import at_rest
from stage_picture import BODY_LENGTH, HEAD_LENGTH, WIDTH, browser, drawn, play, publisher, server, until
from stage_show import shot
from stage_transport import command

SIZES = [(390, 844), (844, 390), (640, 480), (1280, 720), (1920, 1080)]
TIMES = range(394, 413, 2)
# The inks of words on the light page: an event and its benches, the nearest now, head and tail.
INKS = [(194, 0, 31), (138, 75, 0), (22, 24, 29)]
# The pixels of the handles, and the labels of the picture, of one moment.
LABELS = "[[...picture.shown.handles], picture.toPixel(0, 0), picture.toPixel(1, 0), picture.toPixel(0, 1), picture.labels]"


def distances(points, handles, scale):
    """Returns the distance in pixels from each point to each board; handles in pixels too."""
    front, rear = handles[:-1], handles[1:]
    along = (front - rear) / numpy.linalg.norm(front - rear, axis=1, keepdims=True)
    half = numpy.full(len(front), BODY_LENGTH * scale / 2)
    half[0] = HEAD_LENGTH * scale / 2
    offset = points[:, None] - (front + rear) / 2
    u = numpy.maximum(numpy.abs((offset * along).sum(-1)) - half, 0)
    v = numpy.maximum(numpy.abs(offset[..., 1] * along[:, 0] - offset[..., 0] * along[:, 1]) - WIDTH * scale / 2, 0)
    return numpy.hypot(u, v)


def points_of(label):
    """Returns the points of a label that identify its board: the end of its line, or every part of a box."""
    if label["end"]:
        return numpy.array([[label["end"]["x"], label["end"]["y"]]])
    if label["isBadge"]:
        return numpy.array([[label["x"], label["y"]]])
    across, down = numpy.meshgrid(numpy.linspace(-1, 1, 21), numpy.linspace(-1, 1, 9))
    return numpy.stack([label["x"] + across.ravel() * label["half"], label["y"] + down.ravel() * label["tall"]], axis=-1)


def labels_of(page):
    """Returns each bench's label with the board that it points at. This is the board where its line ends, or the board
    nearest to every part of a box without a line."""
    handles, origin, right, up, labels = page.evaluate(LABELS)
    handles = numpy.array(handles).reshape(-1, 5)[:, :2]
    origin, right, up = map(numpy.array, (origin, right, up))
    handles, scale = origin + handles[:, :1] * (right - origin) + handles[:, 1:] * (up - origin), numpy.hypot(*(right - origin))
    found = []
    for label in labels:
        if label.get("bench") is None:
            continue
        away = distances(points_of(label), handles, scale).min(axis=0)
        # A line's end must lie on its board.
        found.append((label, int(away.argmin()), away.min() if label["end"] else 0, away[label["bench"]], away.min()))
    return found


def wrong(found):
    return [(label, near, _) for label, near, away, *_ in found if near != label["bench"] or away > 1.5]


def labels_point_at_their_boards():
    """Over the approach, in five windows: no label is nearer to another board."""
    count, bare, lines = 0, 0, []
    with server() as url, publisher("--start", "390", "--paused") as _, browser(viewport={"width": 1280, "height": 720}) as (page, complaints):
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            page.goto("about:blank")
            page.goto(f"{url}#keys")
            drawn(page)
            for moment in TIMES:
                command("seek", moment)
                until(page, f"Math.abs(picture.time - {moment}) < 0.01 && picture.shown && Math.abs(picture.shown.time - {moment}) < 0.01", f"the picture of {moment} s")
                # The camera frames all boards at once, and does not ease for seconds.
                page.keyboard.press("0")
                at_rest(page)
                found = labels_of(page)
                assert not wrong(found), f"{width} x {height} at {moment} s: {wrong(found)}"
                assert len(found) >= 2, f"{width} x {height} at {moment} s: {found}"
                count += len(found)
                bare += sum(label["end"] is None for label, *_ in found)
                lines += [numpy.hypot(label["x"] - label["end"]["x"], label["y"] - label["end"]["y"]) for label, *_ in found if label["end"]]
            lines_are_drawn(page, found)
        print(f"{count} labels, {bare} without a line; the ends of lines are {numpy.mean(lines):.0f} px from the words on average, at most {max(lines):.0f}")
        assert count >= 150, f"only {count} labels were measured"
        assert not complaints, complaints


def lines_are_drawn(page, found):
    """The dot at a line's end has a colour of words."""
    pixels, box = shot(page), page.locator("#stage").bounding_box()
    for label, *_ in found:
        if not label["end"]:
            continue
        x, y = round(box["x"] + label["end"]["x"]), round(box["y"] + label["end"]["y"])
        patch = pixels[y - 1 : y + 2, x - 1 : x + 2, :3].astype(int).reshape(-1, 3)
        nearest = min(numpy.abs(patch - ink).max(axis=1).min() for ink in INKS)
        assert nearest < 40, f"no dot at the end of the line of {label['text']!r}: {patch.tolist()}"


def labels_move_with_their_boards():
    """While the show plays, at three times its speed, every label of every picture is right."""
    with server() as url, publisher("--start", "380", "--time-scale", "3") as _, browser(viewport={"width": 900, "height": 600}) as (page, complaints):
        page.goto(f"{url}#bench=40")
        drawn(page)
        seen = 0
        # Eight seconds, and on a busy machine as long as a hundred labels take; the contact is 10 s of wall time away.
        began = time.monotonic()
        while time.monotonic() < began + 8 or (seen <= 100 and time.monotonic() < began + 60):
            found = labels_of(page)
            assert not wrong(found), wrong(found)
            seen += len(found)
            time.sleep(0.03)
        assert seen > 100, f"{seen} labels"
        assert not complaints, complaints


if __name__ == "__main__":
    play(labels_point_at_their_boards, labels_move_with_their_boards)
