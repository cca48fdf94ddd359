"""The place of every handle at the time of display: cubic Hermite interpolation between frames, with numpy alone.

    reader = HermiteReader()
    reader.push(header, handles)                 # for every frame, as it comes
    time, handles = reader.at(monotonic_ns)      # at any time: simulated seconds and a structured array

`header` has the fields of FrameHeader, `handles` is a structured array with x, y, heading, vx, vy (as `handles_of` in
bench_dragon_messages.py returns it). Display the stream a period behind the present, such as `time.monotonic_ns() - 1e9
/ rate`: the error is then proportional to the fourth power of the interval of two frames. Frames that a tunnel brings
from another machine have times of that machine's clock: push these with their arrival time. Run as a program it
subscribes and prints the head's place 20 times a second:

    python3 examples/python/hermite.py [--name bench_dragon] [--seconds 10] [--delay 0.1] [--other-machine]
"""

import argparse
import bisect
import collections
import time

import numpy as np

PLAYING = 0

Frame = collections.namedtuple("Frame", "run_id epoch playback deadline_ns sim_time time_scale handles")


class HermiteReader:
    """The latest frames of a stream, and the interpolation between them."""

    def __init__(self, keep=64):
        """Keeps the latest `keep` frames: a display that runs d seconds behind r frames a second needs d r + 2."""
        self._frames = collections.deque(maxlen=max(keep, 2))

    def push(self, header, handles, arrival_ns=None):
        """Adds a copy of the next frame. Frames of another run are dropped.

        `arrival_ns` of time.monotonic_ns() replaces the frame's own time, for frames of another machine.
        """
        if self._frames and self._frames[-1].run_id != header.run_id:
            self._frames.clear()
        fields = (getattr(header, field) for field in Frame._fields[:-1])
        frame = Frame(*fields, np.array(handles))
        self._frames.append(frame if arrival_ns is None else frame._replace(deadline_ns=arrival_ns))

    def at(self, monotonic_ns):
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
        # Velocities are zero while the show is paused, not because the handles rest: those are not used.
        moving = (a.playback == PLAYING, b.playback == PLAYING)
        for position, rate in (("x", "vx"), ("y", "vy")):
            ends = (a.handles[position], b.handles[position], a.handles[rate] * length, b.handles[rate] * length)
            handles[position], slope = _coordinate(*ends, moving, u)
            handles[rate] = slope / length
        dx, dy = (handles[axis][:-1] - handles[axis][1:] for axis in "xy")
        handles["heading"][:-1] = np.arctan2(dy, dx)
        handles["heading"][-1] = handles["heading"][-2]
        return moment, handles


def _coordinate(first, last, first_rate, last_rate, moving, u):
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


def frames(name, seconds):
    """Yields (header, handles) of a publisher's frames, and None whenever no frame has come."""
    import iceoryx2 as iox2
    from bench_dragon_messages import FrameHeader, HandlePose, handles_of

    iox2.set_log_level(iox2.LogLevel.Fatal)
    node = iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
    poses = node.service_builder(iox2.ServiceName.new(f"{name}/poses"))
    end, subscriber = time.monotonic() + seconds, None
    while subscriber is None and time.monotonic() < end:
        try:
            service = poses.publish_subscribe(iox2.Slice[HandlePose]).user_header(FrameHeader).open()
            subscriber = service.subscriber_builder().create()
        except iox2.PublishSubscribeOpenError:
            time.sleep(0.1)  # There is no publisher yet.
    while time.monotonic() < end:
        while (sample := subscriber.receive()) is not None:
            yield sample.user_header().contents, handles_of(sample)
            sample.delete()
        yield None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", default="bench_dragon")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--delay", type=float, default=0.1, help="seconds behind the present: a period and a little")
    parser.add_argument("--other-machine", action="store_true", help="frames come by a tunnel: use their arrival time")
    arguments = parser.parse_args()
    reader = HermiteReader()
    for frame in frames(arguments.name, arguments.seconds):
        if frame is not None:
            reader.push(*frame, time.monotonic_ns() if arguments.other_machine else None)
            continue
        shown = reader.at(time.monotonic_ns() - int(1e9 * arguments.delay))
        if shown is not None:
            moment, handles = shown
            print(f"t = {moment:9.4f} s  head ({handles['x'][0]:+.4f}, {handles['y'][0]:+.4f}) m", flush=True)
        time.sleep(0.05)


if __name__ == "__main__":
    main()
