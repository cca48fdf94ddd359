"""The place of every handle at the time of display: cubic Hermite interpolation between frames, with numpy alone.

    reader = HermiteReader()
    reader.set_stage(feed.stage()[0])            # for a show of several dragons, whenever a stage comes
    reader.push(frame.header, frame.handles)     # for every frame, as it comes
    time, handles = reader.at(monotonic_ns)      # at any time: simulated seconds and a structured array

Display the stream a period behind the present, such as `time.monotonic_ns() - 1e9 / rate`. The error is then
proportional to the fourth power of the interval of two frames. Frames that a tunnel brings from another machine have
times of that machine's clock: push these with their arrival time.
"""

from __future__ import annotations

import bisect
import collections
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bench_dragon.frames import Handles

PLAYING = 0


class KeptFrame(NamedTuple):
    """The kept part of a frame: fields of `FrameHeader`, and a copy of the handles."""

    run_id: int
    epoch: int
    playback: int
    deadline_ns: int
    sim_time: float
    time_scale: float
    handles: Handles


class HermiteReader:
    """The latest frames of a stream, and the interpolation between them."""

    def __init__(self, keep: int = 64) -> None:
        """Keeps the latest `keep` frames: a display that runs d seconds behind r frames a second needs d r + 2."""
        self._frames: collections.deque[KeptFrame] = collections.deque(maxlen=max(keep, 2))
        self._stage_run: int | None = None
        self._tails: list[int] = []

    def set_stage(self, stage: Any) -> None:
        """Sets the dragons of a run: the last handle of each has the heading of its last bench.

        `stage` is a `Stage`. Without the stage of its run, a frame is of one dragon.
        """
        self._stage_run = stage.run_id
        self._tails = [dragon.first_handle + dragon.benches for dragon in stage.dragons]

    def push(self, header: Any, handles: Handles, arrival_ns: int | None = None) -> None:
        """Adds a copy of the next frame. Frames of another run are dropped.

        `header` has the fields of `FrameHeader`; `handles` has the fields x, y, heading, vx, vy, shape (handles,).
        `arrival_ns` of time.monotonic_ns() replaces the frame's own time, for frames of another machine.
        """
        if self._frames and self._frames[-1].run_id != header.run_id:
            self._frames.clear()
        fields = {field: getattr(header, field) for field in KeptFrame._fields[:-1]}
        frame = KeptFrame(**fields, handles=np.array(handles))
        self._frames.append(frame if arrival_ns is None else frame._replace(deadline_ns=arrival_ns))

    def at(self, monotonic_ns: int) -> tuple[float, Handles] | None:
        """Returns simulated seconds and the handles at a time of CLOCK_MONOTONIC; None if no frame has come.

        Before the oldest kept frame, after the newest, and if simulated time jumps (another epoch), the frame before is
        shown unchanged.
        """
        if not self._frames:
            return None
        after = bisect.bisect_right(self._frames, monotonic_ns, key=lambda frame: frame.deadline_ns)
        a = self._frames[max(after - 1, 0)]
        b = self._frames[after] if 0 < after < len(self._frames) else a
        elapsed = monotonic_ns - a.deadline_ns
        if elapsed <= 0 or a.epoch != b.epoch or len(a.handles) != len(b.handles) or b.sim_time <= a.sim_time:
            return a.sim_time, a.handles
        # The present rate holds until the next frame; the end of the show may come earlier.
        moment = min(a.sim_time + a.time_scale * elapsed * 1e-9, b.sim_time)
        length = b.sim_time - a.sim_time
        u = (moment - a.sim_time) / length
        handles = a.handles.copy()
        # Velocities are zero while the show is paused, not because the handles rest: such velocities are not used.
        moving = (a.playback == PLAYING, b.playback == PLAYING)
        for position, rate in (("x", "vx"), ("y", "vy")):
            ends = (a.handles[position], b.handles[position], a.handles[rate] * length, b.handles[rate] * length)
            handles[position], slope = _coordinate(*ends, moving, u)
            handles[rate] = slope / length
        dx, dy = (handles[axis][:-1] - handles[axis][1:] for axis in "xy")
        handles["heading"][:-1] = np.arctan2(dy, dx)
        for tail in [*(self._tails if a.run_id == self._stage_run else ()), len(handles) - 1]:
            handles["heading"][tail] = handles["heading"][tail - 1]
        return moment, handles


Numbers = npt.NDArray[np.float64]


def _coordinate(
    first: Numbers, last: Numbers, first_rate: Numbers, last_rate: Numbers, moving: tuple[bool, bool], u: float
) -> tuple[Numbers, Numbers]:
    """Returns value and slope of the polynomial of least degree through both places and the usable rates."""
    step, w = last - first, 1.0 - u
    if np.isnan(first_rate).any() or np.isnan(last_rate).any() or moving == (False, False):
        return first + step * u, step
    if moving == (True, True):
        p, q = first_rate - step, last_rate - step
        return (
            first + step * u + u * w * (w * p - u * q),
            step + w * (w - 2.0 * u) * p + u * (u - 2.0 * w) * q,
        )
    if moving[0]:
        return first + u * (first_rate + u * (step - first_rate)), first_rate + 2.0 * u * (step - first_rate)
    return last - w * (last_rate + w * (step - last_rate)), last_rate + 2.0 * w * (step - last_rate)
