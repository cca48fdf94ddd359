# Generated from crates/messages/src (layouts and state), not written by hand:
# BENCH_DRAGON_WRITE=1 cargo test --test repository msgs::
"""The memory layouts of bench-dragon's messages, once, for every Python subscriber.

Each class is what iceoryx2 compares with the publisher's type. Its name ends in the layout's version, so that a
publisher with another layout is refused.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any, ClassVar

# The bench number that means "no bench".
NO_BENCH = 0xFFFFFFFF

# The state of the dragon: the latest event passed, until the show ends or loops, or else an approaching event.
STATES = (
    # Nothing has happened and nothing is near.
    "moving",
    # An event is near in time, or two boards are near each other.
    "approaching",
    # Two boards that share no handle have touched.
    "contact",
    # A link is at its dead point, square to the path at its front handle: the rest of the chain is pushed backwards.
    "stall",
    # A link is in a singular configuration, square to the path at its rear handle, which would need unbounded speed.
    "lock",
    # The head has reached the end of the path.
    "path_end",
    # A board has reached the keep-out of an obstacle, or has left the boundary by its keep-out.
    "obstacle",
)

# The level of an alert.
LEVELS = (
    # Nothing has happened and nothing is near.
    "clear",
    # An event is near in time, or two boards are near each other.
    "approaching",
    # Two boards that share no handle have touched.
    "contact",
    # A link is at its dead point, square to the path at its front handle: the rest of the chain is pushed backwards.
    "stall",
    # A link is in a singular configuration, square to the path at its rear handle, which would need unbounded speed.
    "lock",
    # No value has this number.
    None,
    # A board has reached the keep-out of an obstacle, or has left the boundary by its keep-out.
    "obstacle",
)

# The events of alerts, by the number of the state that each event leads to.
EVENTS = {
    # No event.
    0: None,
    # Two boards that share no handle first touch.
    2: "contact",
    # A link is at its dead point, square to the path at its front handle: the rest of the chain is pushed backwards.
    3: "stall",
    # A link is in a singular configuration, square to the path at its rear handle, which would need unbounded speed.
    4: "lock",
    # The head reaches the end of the path.
    5: "path_end",
    # A board reaches the keep-out of an obstacle, or leaves the boundary by its keep-out.
    6: "obstacle",
}

# The playback state: simulated time advances or stands still.
PLAYBACK = (
    # Simulated time advances.
    "playing",
    # Simulated time stands still until it is resumed.
    "paused",
    # Simulated time stands still until the hold is released.
    "held",
    # The show has ended.
    "ended",
)

# The values of `StageSegment.kind`.
SEGMENTS = (
    # Straight on.
    "line",
    # Part of a circle.
    "arc",
    # Inward along r = pitch theta / 2 pi.
    "inward_spiral",
    # Outward along that spiral, turned by half a turn about the centre.
    "outward_spiral",
)

# The values of `StageObstacle.kind`.
OBSTACLES = (
    # A disc.
    "circle",
    # A polygon with its interior.
    "polygon",
    # An open line: a barrier.
    "line",
    # The boundary: boards stay inside.
    "boundary",
)


class Message(ctypes.Structure):
    """A message in memory, or a part of one."""

    # The version of the layout.
    LAYOUT: ClassVar[int]
    # The names of the values of a field, for people.
    NAMES: ClassVar[dict[str, dict[int, Any]]] = {}

    @classmethod
    def type_name(cls) -> str:
        """Returns the name that iceoryx2 compares with the publisher's."""
        return f"bench_dragon/{cls.__name__}/{cls.LAYOUT}"

    def __repr__(self) -> str:
        """Returns fields and values, states and levels by name."""
        fields = [field[0] for field in self._fields_ if field[0] != "reserved"]
        return f"{type(self).__name__}({', '.join(f'{field}={self._shown(field)}' for field in fields)})"

    def _shown(self, field: str) -> str:
        value = getattr(self, field)
        if field in self.NAMES:
            return str(self.NAMES[field].get(value, value))
        if isinstance(value, ctypes.Array):
            # A name, which zeros follow, or a hash.
            text = bytes(value).rstrip(b"\0").decode(errors="replace")
            return repr(text) if text.isprintable() and "\ufffd" not in text else bytes(value).hex()
        return "NO_BENCH" if "bench" in field and value == NO_BENCH else repr(value)


def _list(element: type[Message], most: int) -> type[ctypes.Structure]:
    """Returns the type of a list with room for `most` elements. `len()`, an index and `for` see those in use."""

    class List(ctypes.Structure):
        ELEMENT = element
        length: int
        items: ctypes.Array[Any]
        _fields_ = [("length", ctypes.c_uint32), ("reserved", ctypes.c_uint32), ("items", element * most)]

        def __len__(self) -> int:
            return min(self.length, most)

        def __getitem__(self, index: int) -> Any:
            return self.items[: len(self)][index]

        def __repr__(self) -> str:
            return repr(self.items[: len(self)])

    return List


class HandlePose(Message):
    """The position and velocity of one handle.

    Over iceoryx2 the payload of `<name>/poses` is a slice of these, the head first.
    """

    LAYOUT = 1
    # Metres to the right of the centre, frame `stage`.
    x: float
    # Metres up from the centre, frame `stage`.
    y: float
    # Radians in (-pi, pi]: the direction of the bench this handle leads (from handle i+1 to handle i); the last handle
    # takes the last bench's.
    heading: float
    # Velocity along x in simulation, metres per simulated second; NaN if the scene requests no velocities.
    vx: float
    # Velocity along y in simulation, metres per simulated second; NaN if the scene requests no velocities.
    vy: float
    _fields_ = [
        ("x", ctypes.c_double),
        ("y", ctypes.c_double),
        ("heading", ctypes.c_double),
        ("vx", ctypes.c_double),
        ("vy", ctypes.c_double),
    ]


class HandlePose32(Message):
    """The position and velocity of one handle, in half the bytes: the numbers of `HandlePose`, each rounded to the
    nearest single-precision float. The error along each axis is at most 6e-8 of the distance from the centre (0.5 um at
    8 m, 0.06 mm at 1 km).

    Over iceoryx2 the payload of `<name>/poses32` is a slice of these, the head first: one handle in `every`, and the
    tail. A scene can request this service. The service's attribute `every` holds that number: the pose with the index
    `i` is of the handle `i * every`, the last pose of the last handle. Several dragons follow one another, each with
    its own head and tail.
    """

    LAYOUT = 1
    # Metres to the right of the centre, frame `stage`.
    x: float
    # Metres up from the centre, frame `stage`.
    y: float
    # Radians from -pi to pi, both rounded: the direction of the bench this handle leads, as `HandlePose.heading`.
    heading: float
    # Velocity along x in simulation, metres per simulated second; NaN if the scene requests no velocities.
    vx: float
    # Velocity along y in simulation, metres per simulated second; NaN if the scene requests no velocities.
    vy: float
    _fields_ = [
        ("x", ctypes.c_float),
        ("y", ctypes.c_float),
        ("heading", ctypes.c_float),
        ("vx", ctypes.c_float),
        ("vy", ctypes.c_float),
    ]


class FrameHeader(Message):
    """The facts of a whole frame.

    Over iceoryx2 the user header of `<name>/poses` and `<name>/poses32`.
    """

    LAYOUT = 2
    NAMES = {"state": dict(enumerate(STATES)), "playback": dict(enumerate(PLAYBACK))}
    # New for every start of a publisher: a change means that it was started again.
    run_id: int
    # Counts the frames published in this run from 0, without gaps: over iceoryx2 a gap means that frames were missed. A
    # topic with a lower rate leaves some out.
    sequence: int
    # The number of the period; jumps over periods that were skipped.
    tick: int
    # CLOCK_REALTIME in nanoseconds when the frame was begun: for people and for ROS.
    stamp_ns: int
    # CLOCK_MONOTONIC of the publisher's machine in nanoseconds just before the frame was sent: for latencies.
    sent_ns: int
    # CLOCK_MONOTONIC of the publisher's machine in nanoseconds at which this period should have begun: for lateness.
    deadline_ns: int
    # Simulated seconds since the start of the scene.
    sim_time: float
    # Simulated seconds per second of wall time, as in force; 0 while paused or held, unchanged after the end of the
    # show.
    time_scale: float
    # Metres between the nearest two boards that share no handle, negative when they overlap. In a scene with obstacles
    # it is the least clearance of boards and obstacles. NaN if the scene has no `[alerts]`, or fewer than three benches
    # and no obstacles.
    min_clearance: float
    # The number of handles in this message.
    handles: int
    # The state of the dragon: one of `STATES`.
    state: int
    # The playback state: one of `PLAYBACK`.
    playback: int
    # The latest cue passed, counted from 1; 0 before the first cue.
    cue: int
    # Grows by one at every jump of simulated time, such as the beginning of the next loop. No interpolation crosses a
    # jump.
    epoch: int
    # Always 0.
    reserved: int
    _fields_ = [
        ("run_id", ctypes.c_uint64),
        ("sequence", ctypes.c_uint64),
        ("tick", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("sent_ns", ctypes.c_uint64),
        ("deadline_ns", ctypes.c_uint64),
        ("sim_time", ctypes.c_double),
        ("time_scale", ctypes.c_double),
        ("min_clearance", ctypes.c_double),
        ("handles", ctypes.c_uint32),
        ("state", ctypes.c_uint32),
        ("playback", ctypes.c_uint32),
        ("cue", ctypes.c_uint32),
        ("epoch", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]


class CollisionAlert(Message):
    """A change of the alert level, or a step of the countdown towards an event.

    `bench_a`, `bench_b`, `clearance`, `x` and `y` are the nearest two boards of the frame, or a nearer board and
    obstacle, at every level. The fields that begin with `event` are the event that the alert is about. While the level
    is clear or approaching, this is the next contact, obstacle, stall or lock, else the event that has happened. For an
    obstacle, the field of the second bench has the number of the obstacle. This is the number of handles plus the
    obstacle's place in the scene, the boundary last.

    Over iceoryx2 the payload of `<name>/alerts`.
    """

    LAYOUT = 2
    NAMES = {"level": dict(enumerate(LEVELS)), "event": EVENTS}
    # The run this alert belongs to, as `FrameHeader.run_id`.
    run_id: int
    # The tick of the frame this alert goes with.
    tick: int
    # CLOCK_REALTIME in nanoseconds of that frame.
    stamp_ns: int
    # Simulated seconds of that frame.
    sim_time: float
    # Simulated seconds at which the event happens or happened; NaN if there is no event.
    event_time: float
    # `event_time - sim_time`, simulated seconds; negative once it has passed; NaN if there is no event.
    time_to_event: float
    # Metres between the nearest two boards in that frame, or between a board and the keep-out of an obstacle. Negative
    # when they overlap; NaN if there are neither.
    clearance: float
    # The midpoint between the nearest two boards, metres right of the centre; NaN if there are fewer than three
    # benches.
    x: float
    # The midpoint between the nearest two boards, metres up from the centre; NaN if there are fewer than three benches.
    y: float
    # The place of the event, metres right of the centre; NaN if there is no event. It is the touching point of a
    # contact, or the point of a board nearest to an obstacle. For a bench that stalls or locks, it is the rear handle.
    event_x: float
    # The place of the event, metres up from the centre; NaN if there is no event.
    event_y: float
    # The severity of the alert: one of `LEVELS`.
    level: int
    # The first of the nearest two benches, from 0, or `NO_BENCH`.
    bench_a: int
    # The second of the nearest two benches, or an obstacle's number, or `NO_BENCH`.
    bench_b: int
    # The kind of the event: one of `EVENTS`, with the number of the frame's state that it leads to; 0 if there is no
    # event.
    event: int
    # The bench that stalls, locks or reaches an obstacle, or the first of two that touch, or `NO_BENCH`.
    event_bench_a: int
    # The second of two benches that touch, or an obstacle's number, or `NO_BENCH`.
    event_bench_b: int
    _fields_ = [
        ("run_id", ctypes.c_uint64),
        ("tick", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("sim_time", ctypes.c_double),
        ("event_time", ctypes.c_double),
        ("time_to_event", ctypes.c_double),
        ("clearance", ctypes.c_double),
        ("x", ctypes.c_double),
        ("y", ctypes.c_double),
        ("event_x", ctypes.c_double),
        ("event_y", ctypes.c_double),
        ("level", ctypes.c_uint32),
        ("bench_a", ctypes.c_uint32),
        ("bench_b", ctypes.c_uint32),
        ("event", ctypes.c_uint32),
        ("event_bench_a", ctypes.c_uint32),
        ("event_bench_b", ctypes.c_uint32),
    ]


class LoopStatus(Message):
    """The status of the loop, once a second.

    Figures that end in `_second` are of the last second alone. Figures that end in `_total` are since the start of the
    run. All durations are in nanoseconds.

    Over iceoryx2 the payload of `<name>/status`. Layout 2 added the unforeseen contacts and the unsolved frames, layout
    3 the lost files.
    """

    LAYOUT = 3
    # The run, as `FrameHeader.run_id`.
    run_id: int
    # The tick of the latest frame.
    tick: int
    # The sequence of the latest frame.
    sequence: int
    # CLOCK_REALTIME in nanoseconds when this was written.
    stamp_ns: int
    # Simulated seconds of the latest frame.
    sim_time: float
    # The requested rate, frames per second.
    rate: float
    # Frames published in the last second, divided by its true length.
    measured_rate: float
    # Incidents in which at least one period was skipped, since the start.
    overruns: int
    # Periods skipped, since the start.
    skipped: int
    # Times the show has been played to its end and begun again.
    shows_played: int
    # Contacts that no search had found before the show, since the start: 0 unless a search is wrong or stopped early.
    unforeseen_contacts: int
    # Frames without a solution at their time, which repeated the frame before, since the start.
    unsolved_frames: int
    # Wake-up lateness of the last second: median, ns.
    lateness_p50_second: int
    # Wake-up lateness of the last second: 99th percentile, ns.
    lateness_p99_second: int
    # Wake-up lateness of the last second: maximum, ns.
    lateness_max_second: int
    # Wake-up lateness since the start: median, ns.
    lateness_p50_total: int
    # Wake-up lateness since the start: 99th percentile, ns.
    lateness_p99_total: int
    # Wake-up lateness since the start: 99.9th percentile, ns.
    lateness_p999_total: int
    # Wake-up lateness since the start: maximum, ns.
    lateness_max_total: int
    # Step cost of the last second: median, ns.
    step_p50_second: int
    # Step cost of the last second: 99th percentile, ns.
    step_p99_second: int
    # Step cost of the last second: maximum, ns.
    step_max_second: int
    # Step cost since the start: median, ns.
    step_p50_total: int
    # Step cost since the start: 99th percentile, ns.
    step_p99_total: int
    # Step cost since the start: 99.9th percentile, ns.
    step_p999_total: int
    # Step cost since the start: maximum, ns.
    step_max_total: int
    # Resident memory of the publisher, bytes.
    resident_bytes: int
    # Files of the publisher in shared memory that another program has removed; subscribers that come later do not find
    # the show then.
    lost_files: int
    # Subscribers of the frames that are connected over iceoryx2.
    subscribers: int
    # Open file descriptors of the publisher.
    file_descriptors: int
    # The scene's name.
    scene: ctypes.Array[ctypes.c_uint8]
    _fields_ = [
        ("run_id", ctypes.c_uint64),
        ("tick", ctypes.c_uint64),
        ("sequence", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("sim_time", ctypes.c_double),
        ("rate", ctypes.c_double),
        ("measured_rate", ctypes.c_double),
        ("overruns", ctypes.c_uint64),
        ("skipped", ctypes.c_uint64),
        ("shows_played", ctypes.c_uint64),
        ("unforeseen_contacts", ctypes.c_uint64),
        ("unsolved_frames", ctypes.c_uint64),
        ("lateness_p50_second", ctypes.c_uint64),
        ("lateness_p99_second", ctypes.c_uint64),
        ("lateness_max_second", ctypes.c_uint64),
        ("lateness_p50_total", ctypes.c_uint64),
        ("lateness_p99_total", ctypes.c_uint64),
        ("lateness_p999_total", ctypes.c_uint64),
        ("lateness_max_total", ctypes.c_uint64),
        ("step_p50_second", ctypes.c_uint64),
        ("step_p99_second", ctypes.c_uint64),
        ("step_max_second", ctypes.c_uint64),
        ("step_p50_total", ctypes.c_uint64),
        ("step_p99_total", ctypes.c_uint64),
        ("step_p999_total", ctypes.c_uint64),
        ("step_max_total", ctypes.c_uint64),
        ("resident_bytes", ctypes.c_uint64),
        ("lost_files", ctypes.c_uint64),
        ("subscribers", ctypes.c_uint32),
        ("file_descriptors", ctypes.c_uint32),
        ("scene", ctypes.c_uint8 * 64),
    ]


class ChaseStatus(Message):
    """The status of the process that makes a show follow an outside time, five times a second. Payload of
    `<name>/chase`.
    """

    LAYOUT = 1
    # The run that is chased, as `FrameHeader.run_id`.
    run_id: int
    # CLOCK_REALTIME in nanoseconds when this was written.
    stamp_ns: int
    # Readings of the source so far: frames of timecode, or positions of the tracker.
    readings: int
    # Messages from outside that were malformed, or of another sender or stream, so far.
    ignored: int
    # Jumps of the source so far.
    jumps: int
    # Published simulated time minus the time that the source requests, simulated seconds; NaN if either is not known.
    error: float
    # Simulated seconds per second that the source requests; NaN if not known.
    rate: float
    # Metres from the tracker to the path; NaN without a tracker.
    distance: float
    # 0 ArtTimeCode, 1 MIDI timecode, 2 LTC, 3 PosiStageNet.
    source: int
    # 0 silent, 1 locking, 2 locked, 3 freewheeling, 4 standing, 5 backward, 6 lost, 7 held, 8 paused, 9 sought, 10
    # ended. 7 to 9: the chase waits, because the show is held, or another client has paused it or sent it to another
    # time.
    state: int
    # The label of timecode now: hours. 0 without a label.
    hours: int
    # The label: minutes.
    minutes: int
    # The label: seconds.
    seconds: int
    # The label: frames.
    frames: int
    # The rate of the labels: 0 none, 1 24, 2 25, 3 29.97, 4 29.97 drop frame, 5 30, 6 23.976.
    frame_rate: int
    # The number of the tracker; 0 without a tracker.
    tracker: int
    _fields_ = [
        ("run_id", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("readings", ctypes.c_uint64),
        ("ignored", ctypes.c_uint64),
        ("jumps", ctypes.c_uint64),
        ("error", ctypes.c_double),
        ("rate", ctypes.c_double),
        ("distance", ctypes.c_double),
        ("source", ctypes.c_uint32),
        ("state", ctypes.c_uint32),
        ("hours", ctypes.c_uint32),
        ("minutes", ctypes.c_uint32),
        ("seconds", ctypes.c_uint32),
        ("frames", ctypes.c_uint32),
        ("frame_rate", ctypes.c_uint32),
        ("tracker", ctypes.c_uint32),
    ]


class Cue(Message):
    """A cue that the show has reached. Payload of `<name>/cues`.

    Each cue is sent once, with the frame at or after its time; a seek over cues sends none.
    """

    LAYOUT = 1
    # The run, as in `FrameHeader.run_id`.
    run_id: int
    # The tick of the frame this cue goes with.
    tick: int
    # CLOCK_REALTIME in nanoseconds of that frame.
    stamp_ns: int
    # Simulated seconds of that frame.
    sim_time: float
    # Simulated seconds of the cue itself.
    cue_time: float
    # Its number, from 1 in the order of the cues' times.
    number: int
    # 1 if the show waits there until the command `go`, else 0.
    pauses: int
    # Its name.
    name: ctypes.Array[ctypes.c_uint8]
    _fields_ = [
        ("run_id", ctypes.c_uint64),
        ("tick", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("sim_time", ctypes.c_double),
        ("cue_time", ctypes.c_double),
        ("number", ctypes.c_uint32),
        ("pauses", ctypes.c_uint32),
        ("name", ctypes.c_uint8 * 64),
    ]


class ControlRequest(Message):
    """A command to a running show. Request of `<name>/control`."""

    LAYOUT = 1
    # A number that the client chooses; the response repeats it.
    id: int
    # The value of a command that has one: simulated seconds per second, simulated seconds, or periods. With the command
    # state, 1 requests a response whose `time_scale` is the rate of the show when it plays, even while it is paused.
    value: float
    # 0 state, 1 pause, 2 resume, 3 rate, 4 seek, 5 step, 6 restart, 7 hold, 8 release, 9 go.
    command: int
    # Always 0.
    reserved: int
    _fields_ = [
        ("id", ctypes.c_uint64),
        ("value", ctypes.c_double),
        ("command", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]


class ControlResponse(Message):
    """The result of a command. Response of `<name>/control`."""

    LAYOUT = 1
    # The id of the request.
    id: int
    # The period at whose beginning the command was executed.
    tick: int
    # Simulated seconds of that period.
    sim_time: float
    # Simulated seconds per second, as in force; 0 while paused or held, unless the request is for another rate.
    time_scale: float
    # 0 done, 1 already so, 2 refused in this state, 3 value out of range, 4 not understood, 5 too many waiting.
    code: int
    # The playback state, as in `FrameHeader.playback`.
    playback: int
    # The latest cue passed, from 1; 0 before the first cue.
    cue: int
    # Always 0.
    reserved: int
    _fields_ = [
        ("id", ctypes.c_uint64),
        ("tick", ctypes.c_uint64),
        ("sim_time", ctypes.c_double),
        ("time_scale", ctypes.c_double),
        ("code", ctypes.c_uint32),
        ("playback", ctypes.c_uint32),
        ("cue", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]


class StageSegment(Message):
    """One segment of a path, or of an obstacle's outline. A circle is an arc of a full turn; a polygon's last line ends
    where the first begins.

    Over iceoryx2 the payload of `<name>/stage` is a slice of these. Layout 6 added the pitch.
    """

    LAYOUT = 6
    NAMES = {"kind": dict(enumerate(SEGMENTS))}
    # Its beginning, metres right of the centre.
    x: float
    # Its beginning, metres up from the centre.
    y: float
    # Direction of travel at its beginning, radians counter-clockwise from x.
    heading: float
    # Metres along it.
    length: float
    # The curvature of an arc, 1/m, positive if the arc turns left; 0 for a line. NaN for a spiral whose centre is the
    # stage's origin and whose turns begin on the x axis. For a spiral that the scene places elsewhere, the curvature at
    # its beginning: beginning, heading and the side of the curvature give its place.
    curvature: float
    # The polar angle at the beginning of a spiral, radians; else NaN. For an outward spiral this is the angle before
    # the spiral is turned, for a placed spiral the angle before the spiral is placed.
    theta_first: float
    # The polar angle at the end of a spiral, radians; else NaN.
    theta_last: float
    # Metres per turn of a spiral; else NaN.
    pitch: float
    # The kind of curve: one of `SEGMENTS`.
    kind: int
    # Always 0.
    reserved: int
    _fields_ = [
        ("x", ctypes.c_double),
        ("y", ctypes.c_double),
        ("heading", ctypes.c_double),
        ("length", ctypes.c_double),
        ("curvature", ctypes.c_double),
        ("theta_first", ctypes.c_double),
        ("theta_last", ctypes.c_double),
        ("pitch", ctypes.c_double),
        ("kind", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]


class SceneHeader(Message):
    """The header of a scene's text.

    Over iceoryx2 the user header of `<name>/scene`, whose payload is the text (UTF-8, TOML) as a slice of bytes. Sent
    at the start and kept for late subscribers. The text is empty if it is not known, as in the replay of a recording
    without it.
    """

    LAYOUT = 1
    # The run, as `FrameHeader.run_id`.
    run_id: int
    # BLAKE3 of the text of the show, as `Stage.scene_hash`.
    hash: ctypes.Array[ctypes.c_uint8]
    _fields_ = [
        ("run_id", ctypes.c_uint64),
        ("hash", ctypes.c_uint8 * 32),
    ]


class StageDragon(Message):
    """A dragon of the show in a `Stage`.

    The boards of the head, of the tail and of all benches between can differ in size. The tail is the last of two or
    more benches. The team may stand further back than the first segment begins, on the same spiral or line. Layout 7
    added the sizes of head and tail.
    """

    LAYOUT = 7
    # Metres along the head's board.
    head_length: float
    # Metres along every board between head and tail.
    body_length: float
    # Metres along the tail's board.
    tail_length: float
    # Metres across the head's board.
    head_width: float
    # Metres across every board between head and tail.
    width: float
    # Metres across the tail's board.
    tail_width: float
    # Metres from the centre of a handle's hole to the nearest end of the board.
    hole_inset: float
    # Metres per turn of the spiral on which the head starts, or else of the first one; NaN if the path has none.
    pitch: float
    # The turn on which the head starts (theta = 2 pi start_turn); NaN if it does not start on a spiral.
    start_turn: float
    # The number of its first handle. Bench i joins handles i and i + 1, so this is the head's number too.
    first_handle: int
    # The number of its benches; one less than the number of its handles.
    benches: int
    # The index of the first segment of its path in the list of segments. The segments are in the order of travel.
    first_segment: int
    # The number of segments of its path.
    segments: int
    # Its name; empty if it is the only dragon of the show.
    name: ctypes.Array[ctypes.c_uint8]
    _fields_ = [
        ("head_length", ctypes.c_double),
        ("body_length", ctypes.c_double),
        ("tail_length", ctypes.c_double),
        ("head_width", ctypes.c_double),
        ("width", ctypes.c_double),
        ("tail_width", ctypes.c_double),
        ("hole_inset", ctypes.c_double),
        ("pitch", ctypes.c_double),
        ("start_turn", ctypes.c_double),
        ("first_handle", ctypes.c_uint32),
        ("benches", ctypes.c_uint32),
        ("first_segment", ctypes.c_uint32),
        ("segments", ctypes.c_uint32),
        ("name", ctypes.c_uint8 * 64),
    ]


class StageObstacle(Message):
    """An obstacle of the show in a `Stage`, or its boundary."""

    LAYOUT = 6
    NAMES = {"kind": dict(enumerate(OBSTACLES))}
    # Metres that every board has to stay away.
    keep_out: float
    # The kind of shape: one of `OBSTACLES`.
    kind: int
    # The index of the first segment of its outline in the list of segments.
    first_segment: int
    # The number of segments of its outline.
    segments: int
    # Always 0.
    reserved: int
    # Its name.
    name: ctypes.Array[ctypes.c_uint8]
    _fields_ = [
        ("keep_out", ctypes.c_double),
        ("kind", ctypes.c_uint32),
        ("first_segment", ctypes.c_uint32),
        ("segments", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
        ("name", ctypes.c_uint8 * 64),
    ]


class StageEvent(Message):
    """An event of the show in a `Stage`."""

    LAYOUT = 6
    NAMES = {"state": dict(enumerate(STATES))}
    # Simulated seconds at which it happens.
    time: float
    # The event, as the state that it leads to: one of `STATES`.
    state: int
    # The first bench of the event, from 0; 4294967295 if it has none.
    bench_a: int
    # The second bench, or the number of an obstacle; 4294967295 if it has none.
    bench_b: int
    # Always 0.
    reserved: int
    _fields_ = [
        ("time", ctypes.c_double),
        ("state", ctypes.c_uint32),
        ("bench_a", ctypes.c_uint32),
        ("bench_b", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]


class StageCue(Message):
    """A cue of the show in a `Stage`."""

    LAYOUT = 4
    # Simulated seconds of the cue.
    time: float
    # Its number, from 1 in the order of the cues' times.
    number: int
    # 1 if the show waits there until the command `go`, else 0.
    pauses: int
    # Its name.
    name: ctypes.Array[ctypes.c_uint8]
    _fields_ = [
        ("time", ctypes.c_double),
        ("number", ctypes.c_uint32),
        ("pauses", ctypes.c_uint32),
        ("name", ctypes.c_uint8 * 64),
    ]


class Stage(Message):
    """The geometry and the time line of a show, for drawing them. Sent at the start and kept for late joiners.

    The segments of all paths and outlines stand in one list: first those of the dragons, then those of the obstacles.
    Handles are numbered through all dragons. In the bench fields of alerts and events the number of handles plus j is
    the obstacle j, from 0.

    Over iceoryx2 the user header of `<name>/stage`, whose payload is the list of segments. Layout 2 added the segments
    of the path, layout 3 gave them their name. Layout 4 added the time line: the end of the show, the events and the
    cues. Layout 5 added the hash of the scene's text. Layout 6 added the dragons, the obstacles and a path of any
    length.
    """

    LAYOUT = 7
    # The run, as `FrameHeader.run_id`.
    run_id: int
    # CLOCK_REALTIME in nanoseconds when this was written.
    stamp_ns: int
    # Simulated seconds at which the show ends: a seek reaches no later time.
    freeze_time: float
    # The number of cues in the show; the first 32 of them are listed.
    cues: int
    # Always 0.
    reserved: int
    # BLAKE3 of the scene's text, as `verify` prints it of a certificate: the proofs of that text hold for this show.
    # All zero if it is not known.
    scene_hash: ctypes.Array[ctypes.c_uint8]
    # The dragons in the order of their handles.
    dragons: Sequence[StageDragon]
    # The obstacles in the order of the scene; the boundary, if there is one, stands last.
    obstacles: Sequence[StageObstacle]
    # The events in order of time: the first of each kind of each dragon and of each obstacle. Events after the end of
    # the show are not reached. A scene without `[alerts]` has its last event only.
    events: Sequence[StageEvent]
    # The cues in order of time.
    cue_list: Sequence[StageCue]
    _fields_ = [
        ("run_id", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("freeze_time", ctypes.c_double),
        ("cues", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
        ("scene_hash", ctypes.c_uint8 * 32),
        ("dragons", _list(StageDragon, 16)),
        ("obstacles", _list(StageObstacle, 65)),
        ("events", _list(StageEvent, 160)),
        ("cue_list", _list(StageCue, 32)),
    ]


# The payloads and headers of all messages.
MESSAGES: tuple[type[Message], ...] = (
    HandlePose,
    HandlePose32,
    FrameHeader,
    CollisionAlert,
    LoopStatus,
    ChaseStatus,
    Cue,
    ControlRequest,
    ControlResponse,
    StageSegment,
    SceneHeader,
    Stage,
)
