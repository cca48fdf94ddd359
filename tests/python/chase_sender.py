"""Sends timecode with faults to a chase, and compares the published frames with it.

    chase_sender.py --name NAME --result FILE --seconds S [--port PORT | --mtc | --ltc] [--fps 25] [--jump S] [--seed N]

`--port`: ArtTimeCode over UDP, this file's own bytes by the table of Art-Net 4, with jitter, skew, loss and a stall.
`--mtc`: quarter frames by the library mido, to standard output. `--ltc`: sound by Debian's libltc, to standard output,
on the second of two channels.
It begins when frames come and a chase reports its state. Writes a JSON object with the errors of the published
simulated time, from 3 s after the beginning.
"""

import argparse
import ctypes
import json
import pathlib
import random
import socket
import struct
import sys
import threading
import time

import iceoryx2 as iox2

from bench_dragon import ChaseStatus, FrameHeader, HandlePose


# Samples a second.
SOUND_RATE = 48_000


def wait_for_chase(name):
    """Returns when a chase of a show has opened its service."""
    node = iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
    while True:
        try:
            service = node.service_builder(iox2.ServiceName.new(f"{name}/chase")).publish_subscribe(ChaseStatus).open()
            if service.dynamic_config.number_of_publishers > 0:
                return
        except iox2.PublishSubscribeOpenError:
            pass
        time.sleep(0.02)


class Frames(threading.Thread):
    """Keeps the headers of all frames."""

    def __init__(self, name):
        super().__init__(daemon=True)
        self.name_of_show, self.headers, self.stop = name, [], False

    def run(self):
        iox2.set_log_level(iox2.LogLevel.Fatal)
        builder = iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled)
        node = builder.create(iox2.ServiceType.Ipc)
        service = None
        while service is None:
            builder = node.service_builder(iox2.ServiceName.new(f"{self.name_of_show}/poses"))
            try:
                service = builder.publish_subscribe(iox2.Slice[HandlePose]).user_header(FrameHeader).open()
            except iox2.PublishSubscribeOpenError:
                time.sleep(0.02)
        port = service.subscriber_builder().create()
        while not self.stop:
            while (sample := port.receive()) is not None:
                header = sample.user_header().contents
                fields = (header.deadline_ns, header.sim_time, header.time_scale, header.epoch, header.playback)
                self.headers.append(fields)
                sample.delete()
            time.sleep(0.005)


def packet(frame, fps):
    seconds, frames = divmod(frame, fps)
    minutes, seconds = divmod(seconds, 60)
    hours, minutes = divmod(minutes, 60)
    kind = {24: 0, 25: 1, 30: 3}[fps]
    return b"Art-Net\0" + bytes([0x00, 0x97, 0, 14, 0, 0, frames, seconds, minutes, hours, kind])


def percentile(values, share):
    return sorted(values)[int((len(values) - 1) * share)] if values else None


def send_artnet(arguments, started, jump_at):
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    fps, k = arguments.fps, 0
    while (moment := started + k / fps / (1 + arguments.skew)) < started + arguments.seconds:
        frame = 30 * fps + k + (round(arguments.jump * fps) if moment - started >= jump_at else 0)
        wanted = moment + random.gauss(0, 0.005)
        # A stall of the network of 300 ms: the packets wait, and come at once.
        if not arguments.jump and 5.0 <= wanted - started < 5.3:
            wanted = started + 5.3
        time.sleep(max(0, wanted - time.monotonic()))
        if random.random() >= 0.01:
            sock.sendto(packet(frame, fps), ("127.0.0.1", arguments.port))
        k += 1


def send_mtc(arguments, started, jump_at):
    import mido

    fps, k = arguments.fps, 0
    kind = {24: 0, 25: 1, 30: 3}[fps]
    while (moment := started + k / 4 / fps / (1 + arguments.skew)) < started + arguments.seconds:
        # A label every two frames, of the moment of its first quarter frame.
        first = started + k // 8 * 2 / fps / (1 + arguments.skew)
        frame = 30 * fps + k // 8 * 2 + (round(arguments.jump * fps) if first - started >= jump_at else 0)
        seconds, frames = divmod(frame, fps)
        minutes, seconds = divmod(seconds, 60)
        hours, minutes = divmod(minutes, 60)
        nibbles = [frames & 15, frames >> 4, seconds & 15, seconds >> 4, minutes & 15, minutes >> 4, hours & 15]
        nibbles.append(hours >> 4 | kind << 1)
        message = mido.Message("quarter_frame", frame_type=k % 8, frame_value=nibbles[k % 8])
        time.sleep(max(0, moment - time.monotonic()))
        sys.stdout.buffer.write(bytes(message.bytes()))
        sys.stdout.buffer.flush()
        k += 1


class Timecode(ctypes.Structure):
    """SMPTETimecode of ltc.h."""

    _fields_ = [("timezone", ctypes.c_char * 6)] + [
        (name, ctypes.c_ubyte) for name in ("years", "months", "days", "hours", "mins", "secs", "frame")
    ]


def send_ltc(arguments, started, jump_at):
    libltc = ctypes.CDLL("libltc.so.11")
    libltc.ltc_encoder_create.restype = ctypes.c_void_p
    libltc.ltc_encoder_create.argtypes = [ctypes.c_double, ctypes.c_double, ctypes.c_int, ctypes.c_int]
    rate, fps = SOUND_RATE, arguments.fps
    encoder = ctypes.c_void_p(libltc.ltc_encoder_create(rate, fps, {24: 3, 25: 1, 30: 0}[fps], 0))
    out = sys.stdout.buffer
    buffer, sound, k, sent = ctypes.create_string_buffer(8192), b"", 0, 0
    while (now := time.monotonic()) < started + arguments.seconds:
        while len(sound) < rate // 50:
            moment = started + k / fps / (1 + arguments.skew)
            frame = 30 * fps + k + (round(arguments.jump * fps) if moment - started >= jump_at else 0)
            timecode = Timecode(hours=0, mins=frame // fps // 60, secs=frame // fps % 60, frame=frame % fps)
            libltc.ltc_encoder_set_timecode(encoder, ctypes.byref(timecode))
            libltc.ltc_encoder_encode_frame(encoder)
            length = libltc.ltc_encoder_copy_buffer(encoder, buffer)
            sound += buffer.raw[:length]
            k += 1
        piece, sound = sound[: rate // 50], sound[rate // 50 :]
        sent += len(piece)
        # A piece of 20 ms is there when its last sample has been recorded.
        time.sleep(max(0, started + sent / rate / (1 + arguments.skew) - now))
        # The first channel is silent.
        out.write(bytes(byte for sample in piece for byte in (128, sample)))
        out.flush()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--name", required=True)
    parser.add_argument("--result", required=True)
    parser.add_argument("--port", type=int)
    parser.add_argument("--mtc", action="store_true")
    parser.add_argument("--ltc", action="store_true")
    parser.add_argument("--seconds", type=float, default=12)
    parser.add_argument("--fps", type=int, default=25)
    parser.add_argument("--skew", type=float, default=1e-4)
    parser.add_argument("--jump", type=float, help="seconds of timecode to jump by, in the middle")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    random.seed(arguments.seed)
    frames = Frames(arguments.name)
    frames.start()
    while not frames.headers:
        time.sleep(0.01)
    if arguments.ltc:
        # As arecord writes it into a pipe: the length is not known. The chase begins with it.
        sound = struct.pack("<IHHIIHH", 16, 1, 2, SOUND_RATE, 2 * SOUND_RATE, 2, 8)
        sys.stdout.buffer.write(b"RIFF\xff\xff\xff\xffWAVEfmt " + sound + b"data\xff\xff\xff\xff")
        sys.stdout.buffer.flush()
    wait_for_chase(arguments.name)
    started = time.monotonic() + 0.1
    jump_at = arguments.seconds / 2 if arguments.jump else float("inf")

    def timecode(moment):
        elapsed = (moment - started) * (1 + arguments.skew)
        return 30 + elapsed + (arguments.jump if moment - started >= jump_at else 0)

    send = send_mtc if arguments.mtc else send_ltc if arguments.ltc else send_artnet
    send(arguments, started, jump_at)
    frames.stop = True
    frames.join()

    errors, rates, epochs, followed = [], [], set(), None
    for deadline_ns, sim_time, rate, epoch, _ in frames.headers:
        moment = deadline_ns * 1e-9
        since = moment - started
        error = sim_time - timecode(moment)
        if jump_at <= since and followed is None and abs(error) < 0.02:
            followed = (since - jump_at) * arguments.fps
        if 3 <= since < min(jump_at, arguments.seconds) or since >= jump_at + 3 and since < arguments.seconds:
            errors.append(error)
            rates.append(abs(rate - (1 + arguments.skew)))
            epochs.add(epoch)
    result = {
        "frames": len(errors),
        "mean": sum(errors) / len(errors),
        "p99": percentile([abs(error) for error in errors], 0.99),
        "rate_off": max(rates),
        "epochs": len(epochs),
        "frames_to_follow": followed,
    }
    pathlib.Path(arguments.result).write_text(json.dumps(result))


if __name__ == "__main__":
    main()
