"""A publisher's messages, through any number of publishers.

    for frame in subscribe("bench_dragon"):
        print(frame.header.sim_time, frame.handles["x"][0])
"""

from __future__ import annotations

import atexit
import ctypes
import dataclasses
import time
import weakref
from collections.abc import Iterator
from typing import Any, TypeVar

import iceoryx2 as iox2

from bench_dragon.frames import Handles, handles_of, indices_of
from bench_dragon.layouts import (
    CollisionAlert,
    Cue,
    FrameHeader,
    HandlePose,
    HandlePose32,
    LoopStatus,
    Message,
    SceneHeader,
    Stage,
    StageSegment,
)
from bench_dragon.services import new_node, open_messages

# Seconds between two attempts to find a service, and between two tests of a publisher that sends nothing.
RETRY_INTERVAL = 0.1
LIVENESS_INTERVAL = 0.2
# Seconds of one wait for a frame: Ctrl-C is noticed after it.
LONGEST_WAIT = 0.2

Kind = TypeVar("Kind", bound=Message)


@dataclasses.dataclass(frozen=True, slots=True)
class Frame:
    """One frame of a publisher."""

    # The facts of the whole frame, in this process's memory.
    header: FrameHeader
    # The handles, the head first: shape (header.handles,), fields x, y (metres), heading (radians), vx, vy (metres per
    # simulated second). The array is the publisher's memory, read-only and valid until the feed returns the next frame:
    # use `handles.copy()` for later.
    handles: Handles
    # Frames between the frame returned before and this one that this reader lost; 0 at the first frame of a run.
    missed: int


class Feed:
    """The services of one name. The feed waits for a publisher, and after its end for the next publisher.

    An iterator of `Frame`; alerts, cues, statuses, the stage and the scene are read between frames. Keep it inside a
    function or `close` it, or use it in `with`.
    """

    def __init__(self, name: str = "bench_dragon", *, light: bool = False, seconds: float | None = None) -> None:
        """Creates a feed of the services of `name`, which need not exist yet.

        `light` reads the poses in single precision, which a scene offers by `precision = "f32"`. The iterator ends
        after `seconds` of wall time.
        """
        self._name = name
        self._poses = "poses32" if light else "poses"
        self._pose: type[Message] = HandlePose32 if light else HandlePose
        self._end = None if seconds is None else time.monotonic() + seconds
        self._node: Any = new_node()
        self._services: dict[str, Any] = {}
        self._ports: dict[str, Any] = {}
        self._tick: Any = None
        self._sample: Any = None
        self._latest: tuple[int, int] | None = None
        self._tested = float("-inf")
        # The time at which a service was last looked for and not found.
        self._sought: dict[str, float] = {}
        # A feed that is a global variable, as in a notebook, would leave files behind.
        _OPEN.add(self)

    def __iter__(self) -> Iterator[Frame]:
        return self

    def __next__(self) -> Frame:
        while (left := LONGEST_WAIT if self._end is None else self._end - time.monotonic()) > 0.0:
            frame = self.poll(min(left, LONGEST_WAIT))
            if frame is not None:
                return frame
        raise StopIteration

    def poll(self, timeout: float = 0.0) -> Frame | None:
        """Returns the next frame, waiting for it at most `timeout` seconds; None without one.

        Raises `LayoutError` if the publisher's messages have another layout than this module's.
        """
        self._release()
        frame = self._receive()
        if frame is None and timeout > 0.0:
            self._wait(timeout)
            frame = self._receive()
        if frame is None:
            self._leave_a_publisher_that_has_gone()
        return frame

    def alerts(self) -> Iterator[CollisionAlert]:
        """Returns the alerts since the last call. The first call returns the present alert."""
        return self._messages("alerts", CollisionAlert)

    def cues(self) -> Iterator[Cue]:
        """Returns the cues reached since the last call."""
        return self._messages("cues", Cue)

    def statuses(self) -> Iterator[LoopStatus]:
        """Returns the statuses of the publisher's loop since the last call, one a second."""
        return self._messages("status", LoopStatus)

    def stage(self) -> tuple[Stage, ctypes.Array[StageSegment]] | None:
        """Returns geometry and time line of a show that has begun since the last call, and the segments of its paths."""
        stage = None
        port = self._port("stage", iox2.Slice[StageSegment], Stage)
        while port is not None and (sample := port.receive()) is not None:
            segments = StageSegment * sample.header.number_of_elements
            memory = ctypes.string_at(sample.payload_ptr, ctypes.sizeof(segments))
            stage = Stage.from_buffer_copy(sample.user_header().contents), segments.from_buffer_copy(memory)
            sample.delete()
        return stage

    def scene(self) -> tuple[SceneHeader, str] | None:
        """Returns header and text (TOML) of the scene of a show that has begun since the last call."""
        scene = None
        port = self._port("scene", iox2.Slice[ctypes.c_uint8], SceneHeader)
        while port is not None and (sample := port.receive()) is not None:
            memory = ctypes.string_at(sample.payload_ptr, sample.header.number_of_elements)
            scene = SceneHeader.from_buffer_copy(sample.user_header().contents), memory.decode()
            sample.delete()
        return scene

    def handle_indices(self, *handles: int) -> Any:
        """Returns the index of the handle of each pose of a `light` feed: shape (poses,). `handles` is the number of
        handles of the team, or of each team in the order of the stage."""
        return indices_of(self._services[self._poses], *handles)

    def publishers(self) -> int:
        """Returns the number of publishers of frames that are connected."""
        service = self._services.get(self._poses)
        return 0 if service is None else int(service.dynamic_config.number_of_publishers)

    def close(self) -> None:
        """Leaves the services. Arrays of the latest frame must not be read any more."""
        self._disconnect()
        self._node = None
        _OPEN.discard(self)

    def __enter__(self) -> Feed:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _receive(self) -> Frame | None:
        port = self._port(self._poses, iox2.Slice[self._pose], FrameHeader)
        self._sample = None if port is None else port.receive()
        if self._sample is None:
            return None
        header = FrameHeader.from_buffer_copy(self._sample.user_header().contents)
        missed = 0
        if self._latest is not None and self._latest[0] == header.run_id:
            missed = max(header.sequence - self._latest[1] - 1, 0)
        self._latest = header.run_id, header.sequence
        return Frame(header, handles_of(self._sample), missed)

    def _wait(self, timeout: float) -> None:
        """Waits for a frame."""
        if self._tick is None and self._ports.get(self._poses) is not None:
            try:
                service = self._node.service_builder(iox2.ServiceName.new(f"{self._name}/tick")).event().open()
                self._tick = service.listener_builder().create()
            except (iox2.EventOpenError, iox2.ListenerCreateError):
                pass  # The service does not exist yet, or has as many listeners as it admits: poll.
        if self._tick is None:
            time.sleep(min(timeout, 0.02))
        else:
            self._tick.timed_wait(iox2.Duration.from_millis(max(int(1e3 * timeout), 1)))

    def _messages(self, service: str, layout: type[Kind]) -> Iterator[Kind]:
        port = self._port(service, layout)
        while port is not None and (sample := port.receive()) is not None:
            message = layout.from_buffer_copy(sample.payload().contents)
            sample.delete()
            yield message

    def _port(self, service: str, payload: Any, header: type[Message] | None = None) -> Any:
        """Returns the subscriber of a service, or None while the service does not exist."""
        if service in self._ports:
            return self._ports[service]
        now = time.monotonic()
        # A scene without alerts or cues has no such service: the service is not looked for at every frame.
        if now < self._sought.get(service, float("-inf")) + RETRY_INTERVAL:
            return None
        opened = open_messages(self._node, f"{self._name}/{service}", payload, header)
        if opened is None or opened.dynamic_config.number_of_publishers == 0:
            self._sought[service] = now
            return None
        self._services[service] = opened
        self._ports[service] = opened.subscriber_builder().create()
        return self._ports[service]

    def _leave_a_publisher_that_has_gone(self) -> None:
        now = time.monotonic()
        if not self._ports or now < self._tested + LIVENESS_INTERVAL:
            return
        self._tested = now
        self._node.try_cleanup_dead_nodes()
        if self.publishers() == 0 and self._poses in self._ports:
            self._disconnect()

    def _release(self) -> None:
        if self._sample is not None:
            self._sample.delete()
            self._sample = None

    def _disconnect(self) -> None:
        self._release()
        self._tick = None
        self._ports.clear()
        self._services.clear()


def subscribe(name: str = "bench_dragon", *, light: bool = False, seconds: float | None = None) -> Feed:
    """Returns the frames of the publisher of `name`, as an iterator: see `Feed`."""
    return Feed(name, light=light, seconds=seconds)


_OPEN: weakref.WeakSet[Feed] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    for feed in list(_OPEN):
        feed.close()
