"""A lighting desk that checks its input: PosiStageNet as PyPI's pypsn decodes it, compared with the shared memory.

    psn_peer.py --name NAME... --port P [--group 236.10.10.10] [--axes x,up,y] [--first-id N] [--id-step N] [--npm FOLDER]
                [--progress] [--samples]

Listens to UDP port P and subscribes to the publishers NAME, the first of which must be running. Ends with an empty
packet, or when no packet has come for two seconds after the first. With --progress, it waits two minutes. The numbers
of a frame's trackers, STEP apart, identify their publisher. Every frame must decode completely. Each is compared, every
tracker, to float32, with the frame of the shared memory that has the same head. Prints a line when it listens, and one
with the counts. With --npm, the decoder of that folder (npm's @jwetzell/posistagenet) gets the same packets and must
decode the same. With --progress, prints a line five times a second. The line has for each publisher the number of times
its trackers have `stopped`. The line also has the number of frames since then that were `equal`, judged by the head's
place. With --samples, the counts come with every 20th frame that was equal: its simulated time, and position, speed and
orientation of every tracker.
"""

import argparse
import base64
import json
import pathlib
import socket
import struct
import subprocess
import threading
import time

import numpy as np
import pypsn

import bench_dragon as messages
import iceoryx2 as iox2


def listen(port, group):
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    # Room for the delays of a slow machine; more room for root.
    for option in (socket.SO_RCVBUF, getattr(socket, "SO_RCVBUFFORCE", 33)):
        try:
            sock.setsockopt(socket.SOL_SOCKET, option, 1 << 26)
        except PermissionError:
            pass
    sock.bind((group or "127.0.0.1", port))
    if group:
        sock.setsockopt(
            socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(group) + socket.inet_aton("127.0.0.1")
        )
    return sock


class Memory(threading.Thread):
    """The frames of the shared memory, by the place of the head in float32."""

    def __init__(self, name):
        super().__init__(daemon=True)
        iox2.set_log_level(iox2.LogLevel.Fatal)
        self.name, self.frames, self.missed, self.stop = name, {}, 0, False

    def run(self):
        node = (
            iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
        )
        port = last = None
        while not self.stop:
            if port is None:
                last = None
                builder = node.service_builder(iox2.ServiceName.new(f"{self.name}/poses"))
                builder = builder.publish_subscribe(iox2.Slice[messages.HandlePose])
                try:
                    service = builder.user_header(messages.FrameHeader).open()
                    port = service.subscriber_builder().create()
                except iox2.PublishSubscribeOpenError:
                    time.sleep(0.01)
                    continue
            while (sample := port.receive()) is not None:
                header = sample.user_header().contents
                handles = messages.handles_of(sample).copy()
                self.missed += 0 if last is None else header.sequence - last - 1
                last, heard = header.sequence, time.monotonic()
                sample.delete()
                self.frames[np.float32([handles["x"][0], handles["y"][0]]).tobytes()] = (
                    handles,
                    header.time_scale,
                    header.sim_time,
                )
            # A publisher that has ended: its service is closed, so that the next publisher can create it again.
            if last is not None and time.monotonic() - heard > 0.5:
                port = service = None
            time.sleep(0.001)


def mapped(axes, vectors):
    """Returns vectors (x, y, up) of the stage in a desk's axes."""
    columns = {"x": vectors[:, 0], "y": vectors[:, 1], "up": vectors[:, 2]}
    chosen = [-columns[axis[1:]] if axis[0] == "-" else columns[axis] for axis in axes.split(",")]
    return np.stack(chosen, axis=1)


def turned(vector, orientations):
    """Rodrigues' formula: a vector turned by each of the orientations (axis times angle)."""
    angle = np.linalg.norm(orientations, axis=1, keepdims=True)
    axis = orientations / np.where(angle > 0, angle, 1)
    along = (axis @ vector)[:, None]
    return vector * np.cos(angle) + np.cross(axis, vector) * np.sin(angle) + axis * along * (1 - np.cos(angle))


def compare(trackers, handles, scale, axes, first_id):
    """Compares the trackers of a frame with all handles of the frame in shared memory."""
    assert [tracker.id for tracker in trackers] == list(range(first_id, first_id + len(handles)))
    zero = np.zeros(len(handles))
    vectors = lambda x, y: mapped(axes, np.stack([x, y, zero], axis=1))  # noqa: E731
    got = lambda field: np.array([tuple(getattr(tracker, field)) for tracker in trackers])  # noqa: E731
    assert (got("pos") == np.float32(vectors(handles["x"], handles["y"]))).all(), "positions"
    assert (got("speed") == np.float32(vectors(handles["vx"] * scale, handles["vy"] * scale))).all(), "speeds"
    forward = mapped(axes, np.array([[1.0, 0.0, 0.0]]))[0]
    benches = vectors(np.cos(handles["heading"]), np.sin(handles["heading"]))
    assert abs(turned(forward, got("ori")) - benches).max() < 1e-6, "orientations"
    assert {tracker.status for tracker in trackers} == {1.0}, "status"
    assert len({tracker.timestamp for tracker in trackers}) == 1, "timestamps"


def hold_against(trackers, memory, axes, first_id):
    """Returns the result for one publisher's trackers of a frame: `equal` to the shared memory's, `stopped`, or
    `unknown` to it."""
    if trackers[0].status == 0:
        assert {tracker.status for tracker in trackers} == {0.0}
        assert all(tuple(tracker.speed) == (0, 0, 0) for tracker in trackers), "it stands still"
        return "stopped"
    key = head_key(trackers[0].pos, axes)
    if key not in memory.frames:
        return "unknown"
    compare(trackers, *memory.frames[key][:2], axes, first_id)
    return "equal"


def chunks(part):
    """Returns the chunks of a part of a PosiStageNet packet: the number and the content of each."""
    at = 0
    while at + 4 <= len(part):
        number, length = struct.unpack_from("<HH", part, at)
        length &= 0x7FFF
        yield number, part[at + 4 : at + 4 + length]
        at += 4 + length


class Progress:
    """Counts so far, by the heads alone: decoding whole frames would delay the thread that reads the memory."""

    def __init__(self, memories, axes, first_id, id_step):
        self.memories, self.axes = memories, axes
        self.places = {first_id + place * id_step: place for place in range(len(memories))}
        self.stopped, self.heads, self.printed_at = [0] * len(memories), [[] for _ in memories], time.monotonic()

    def take(self, packet):
        [(kind, body)] = chunks(packet)
        # The lists of trackers of a packet of positions.
        lists = [part for number, part in chunks(body) if (kind, number) == (0x6755, 1)]
        for number, part in (tracker for trackers in lists for tracker in chunks(trackers)):
            if number in self.places:
                self.take_head(self.places[number], dict(chunks(part)))
        if time.monotonic() - self.printed_at > 0.2:
            self.printed_at = time.monotonic()
            # The memory may get a frame later than the network.
            equal = [sum(head in memory.frames for head in heads) for memory, heads in zip(self.memories, self.heads)]
            print(json.dumps({"type": "progress", "stopped": self.stopped, "equal": equal}), flush=True)

    def take_head(self, place, fields):
        if struct.unpack("<f", fields[3]) == (1.0,):
            self.heads[place].append(head_key(struct.unpack("<fff", fields[0]), self.axes))
        elif self.heads[place]:
            self.stopped[place] += 1
            self.heads[place] = []


def head_key(position, axes):
    """Returns a head's place in a desk's axes, the key of the shared memory's frames."""
    place = dict(zip([axis.strip("-") for axis in axes.split(",")], position))
    sign = {axis.strip("-"): -1 if axis[0] == "-" else 1 for axis in axes.split(",")}
    return np.float32([place["x"] * sign["x"], place["y"] * sign["y"]]).tobytes()


def decode_again(folder, packets, frames, names):
    """Decodes the same packets with npm's decoder: it must find the same trackers in every frame."""
    script = pathlib.Path(__file__).with_name("psn_npm.mjs")
    lines = b"\n".join(map(base64.b64encode, packets)) + b"\n"
    result = subprocess.run(["node", script, folder], input=lines, stdout=subprocess.PIPE, check=True)
    decoded = [json.loads(line) for line in result.stdout.splitlines()]
    assert len(decoded) == len(frames), f"{len(decoded)} of {len(frames)} frames"
    for trackers, (_, expected) in zip(decoded, frames):
        vectors = [[list(it.pos), list(it.speed), list(it.ori), it.status, it.timestamp] for it in expected]
        assert [it[1:6] for it in trackers] == vectors and [it[0] for it in trackers] == [it.id for it in expected]
    assert {str(it[0]): it[6] for it in decoded[-1]} == {str(number): name for number, name in names.items()}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--name", required=True, action="append")
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--group")
    parser.add_argument("--axes", default="x,up,y")
    parser.add_argument("--first-id", type=int, default=1)
    parser.add_argument("--id-step", type=int, default=1000)
    parser.add_argument("--npm")
    parser.add_argument("--progress", action="store_true")
    parser.add_argument("--samples", action="store_true")
    arguments = parser.parse_args()

    memories = [Memory(name) for name in arguments.name]
    for memory in memories:
        memory.start()
    while not memories[0].frames:
        time.sleep(0.01)
    sock, packets = listen(arguments.port, arguments.group), []
    print(json.dumps({"type": "listening"}), flush=True)
    sock.settimeout(120)
    progress = Progress(memories, arguments.axes, arguments.first_id, arguments.id_step) if arguments.progress else None
    try:
        while packet := sock.recv(65536):
            packets.append(packet)
            sock.settimeout(120 if progress else 2)
            if progress:
                progress.take(packet)
    except TimeoutError:
        pass
    assert packets, "nothing was sent"
    for memory in memories:
        memory.stop = True
        memory.join()

    frames, begun, names, systems, last_time = [], None, {}, set(), -1
    for packet in packets:
        decoded = pypsn.parse_psn_packet(packet)
        info = decoded.info
        assert (info.version_high, info.version_low) == (2, 3)
        assert info.timestamp >= last_time, "time runs on"
        last_time = info.timestamp
        if isinstance(decoded, pypsn.psn_info_packet):
            assert begun is None, "an INFO packet between those of a frame"
            systems.add(decoded.name.decode())
            names.update({tracker.tracker_id: tracker.tracker_name.decode() for tracker in decoded.trackers})
            continue
        if begun is None:
            begun = (info.frame_id, info.packet_count, [])
        assert begun[:2] == (info.frame_id, info.packet_count), "the packets of a frame come back to back"
        begun[2].append(decoded.trackers)
        if len(begun[2]) == info.packet_count:
            frames.append((info.frame_id, [tracker for part in begun[2] for tracker in part]))
            begun = None
    assert begun is None, "the last frame is whole"
    ids = [frame_id for frame_id, _ in frames]
    # npm's decoder reads a frame with the number 0 as a frame without a number.
    assert all(later == sooner % 255 + 1 for sooner, later in zip(ids, ids[1:])), "none is lost"

    samples, seen = [], [{"equal": 0, "unknown": 0, "stopped": 0, "changes": []} for _ in memories]
    for _, trackers in frames:
        for place, (memory, counts) in enumerate(zip(memories, seen)):
            first = arguments.first_id + place * arguments.id_step
            part = [one for one in trackers if first <= one.id and (one.id < first + arguments.id_step or len(seen) == 1)]
            what = hold_against(part, memory, arguments.axes, first) if part else "absent"
            if what != "absent":
                counts[what] += 1
            if what == "equal" and arguments.samples and counts[what] % 20 == 0:
                sim_time = memory.frames[head_key(part[0].pos, arguments.axes)][2]
                fields = [[tuple(one.pos), tuple(one.speed), tuple(one.ori)] for one in part]
                samples.append({"sim_time": sim_time, "trackers": fields})
            state = "moving" if what in ("equal", "unknown") else what
            if counts["changes"][-1:] != [state]:
                counts["changes"].append(state)
    equal, unknown, stopped = (seen[0][what] for what in ("equal", "unknown", "stopped"))
    memory = memories[0]
    if arguments.npm:
        decode_again(arguments.npm, packets, frames, names)
    print(
        json.dumps(
            {
                "type": "summary",
                "packets": len(packets),
                "largest": max(map(len, packets)),
                "frames": len(frames),
                "equal": equal,
                "unknown": unknown,
                "stopped": stopped,
                "memory_frames": len(memory.frames),
                "memory_missed": memory.missed,
                "trackers": len(frames[0][1]),
                "names": names,
                "publishers": seen,
                "systems": sorted(systems),
                "samples": samples,
            }
        )
    )


if __name__ == "__main__":
    main()
