"""Receives the timecode of a show, and compares its labels with the published frames.

    timecode_peer.py --name NAME (--port PORT [--npm FOLDER] | --mtc | --ltc) [--fps 25] [--drop] [--offset S]

`--port`: ArtTimeCode over UDP, decoded by the table of Art-Net 4, or with `--npm` by npm's @arcanewizards/artnet.
`--mtc`: MIDI from standard input, decoded by the library mido. `--ltc`: a WAV stream from standard input, decoded by
Debian's libltc. Prints a JSON line for each label: `label`, `kind` (`running` or `located`), and `late`, the seconds by
which it came after the moment at which the show was there (null while the show stands). A label of sound has the moment
of its last sample. The clock of samples is that of the earliest piece of the last second, and begins with 0 in a file.
"""

import argparse
import collections
import ctypes
import json
import os
import socket
import stat
import struct
import subprocess
import sys
import threading
import time

from chase_sender import Frames, Timecode


class Show(Frames):
    """The simulated time of a show at each moment."""

    def at(self, moment):
        """Returns the time, or None while the show stands."""
        deadline_ns, sim_time, rate, _, playback = self.headers[-1]
        for header in reversed(self.headers[-500:]):
            if header[0] * 1e-9 <= moment:
                deadline_ns, sim_time, rate, _, playback = header
                break
        return sim_time + rate * (moment - deadline_ns * 1e-9) if playback == 0 else None


class Output:
    """Prints labels with their delays."""

    def __init__(self, arguments, show):
        self.show, self.drop, self.offset = show, arguments.drop, arguments.offset
        self.labels = {24: 24, 23.976: 24, 25: 25, 29.97: 30, 30: 30}[arguments.fps]
        self.per_second = {23.976: 24_000 / 1001, 29.97: 30_000 / 1001}.get(arguments.fps, arguments.fps)

    def seconds(self, hours, minutes, seconds, frames):
        count = ((60 * hours + minutes) * 60 + seconds) * self.labels + frames
        if self.drop:
            count -= 2 * (60 * hours + minutes - (60 * hours + minutes) // 10)
        return count / self.per_second

    def __call__(self, kind, parts, moment, age=0.0):
        label = ":".join(f"{part:02}" for part in parts)
        shown = self.show.at(moment)
        ideal = self.seconds(*parts) - self.offset + age / self.per_second
        late = None if shown is None else shown - ideal
        print(json.dumps({"kind": kind, "label": label, "moment": moment, "late": late}), flush=True)


def receive_artnet(arguments, output):
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", arguments.port))
    print("listening", flush=True)
    while (packet := sock.recv(2048)) != b"":
        moment = time.monotonic()
        assert len(packet) == 19 and packet[:14] == b"Art-Net\0\0\x97\0\x0e\0\0", packet
        frames, seconds, minutes, hours, kind = packet[14:]
        assert kind == (2 if arguments.drop else {24: 0, 23.976: 0, 25: 1}.get(arguments.fps, 3)), kind
        output("running", (hours, minutes, seconds, frames), moment)


def receive_npm(arguments, output):
    receiver = ["node", "tests/python/artnet_npm.mjs", arguments.npm, str(arguments.port), "receive"]
    with subprocess.Popen(receiver, stdout=subprocess.PIPE, text=True) as node:
        print(node.stdout.readline().strip(), flush=True)
        for line in node.stdout:
            parts = json.loads(line)
            output("running", tuple(parts), time.monotonic())


def receive_mtc(arguments, output):
    import mido

    parser, pieces = mido.Parser(), []
    while byte := sys.stdin.buffer.read(1):
        moment = time.monotonic()
        parser.feed(byte)
        for message in parser:
            if message.type == "quarter_frame":
                pieces = pieces if message.frame_type == len(pieces) else []
                if message.frame_type != len(pieces):
                    continue
                pieces.append(message.frame_value)
                if len(pieces) == 8:
                    low_high = [low | high << 4 for low, high in zip(pieces[::2], pieces[1::2])]
                    frames, seconds, minutes, hours = low_high
                    assert hours >> 5 == (2 if arguments.drop else {24: 0, 25: 1}.get(arguments.fps, 3))
                    pieces = []
                    output("running", (hours & 31, minutes, seconds, frames), moment, age=1.75)
            elif message.type == "sysex":
                assert message.data[:4] == (0x7F, 0x7F, 1, 1), message
                hours, minutes, seconds, frames = message.data[4:]
                output("located", (hours & 31, minutes, seconds, frames), moment)
            else:
                raise AssertionError(message)


class LtcFrame(ctypes.Structure):
    """LTCFrameExt of ltc.h: the frame, its first and last sample, and what else the decoder has measured."""

    _fields_ = [
        ("bits", ctypes.c_ubyte * 10),
        ("off_start", ctypes.c_longlong),
        ("off_end", ctypes.c_longlong),
        ("reverse", ctypes.c_int),
        ("biphase_tics", ctypes.c_float * 80),
        ("sample_min", ctypes.c_ubyte),
        ("sample_max", ctypes.c_ubyte),
        ("volume", ctypes.c_double),
    ]


def receive_ltc(arguments, output):
    libltc = ctypes.CDLL("libltc.so.11")
    libltc.ltc_decoder_create.restype = ctypes.c_void_p
    libltc.ltc_decoder_create.argtypes = [ctypes.c_int, ctypes.c_int]
    libltc.ltc_decoder_write_s16.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_longlong]
    libltc.ltc_decoder_read.argtypes = [ctypes.c_void_p, ctypes.POINTER(LtcFrame)]
    libltc.ltc_frame_to_time.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int]
    header = sys.stdin.buffer.read(44)
    assert header[:4] == b"RIFF" and header[8:16] == b"WAVEfmt " and header[36:40] == b"data", header
    form, channels, rate, _, block, bits = struct.unpack("<HHIIHH", header[20:36])
    assert (form, channels, block, bits) == (1, 1, 2, 16)
    decoder = libltc.ltc_decoder_create(int(rate / output.per_second), 64)
    samples, frame, parts = 0, LtcFrame(), Timecode()
    is_file = stat.S_ISREG(os.fstat(0).st_mode)
    began, pieces = 0.0, collections.deque()
    while piece := sys.stdin.buffer.read1(4096):
        moment = time.monotonic()
        assert len(piece) % 2 == 0
        libltc.ltc_decoder_write_s16(decoder, piece, len(piece) // 2, samples)
        samples += len(piece) // 2
        if not is_file:
            # Pieces that waited in the pipe until this process began to read came late.
            pieces.append((moment, moment - samples / rate))
            while pieces[0][0] < moment - 1.0:
                pieces.popleft()
            began = min(began for _, began in pieces)
        while libltc.ltc_decoder_read(decoder, ctypes.byref(frame)):
            assert frame.reverse == 0
            assert frame.bits[1] >> 2 & 1 == int(arguments.drop), "the flag of drop frame"
            libltc.ltc_frame_to_time(ctypes.byref(parts), ctypes.byref(frame), 0)
            label = (parts.hours, parts.mins, parts.secs, parts.frame)
            output("running", label, began + (frame.off_end + 1) / rate, age=1.0)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--name", required=True)
    parser.add_argument("--port", type=int)
    parser.add_argument("--npm")
    parser.add_argument("--mtc", action="store_true")
    parser.add_argument("--ltc", action="store_true")
    parser.add_argument("--fps", type=float, default=25)
    parser.add_argument("--drop", action="store_true")
    parser.add_argument("--offset", type=float, default=0.0, help="seconds of timecode at simulated time 0")
    arguments = parser.parse_args()
    show = Show(arguments.name)
    show.start()
    while not show.headers:
        time.sleep(0.01)
    receive = receive_npm if arguments.npm else receive_artnet
    receive = receive_mtc if arguments.mtc else receive_ltc if arguments.ltc else receive
    receive(arguments, Output(arguments, show))
    show.stop = True
    show.join()


if __name__ == "__main__":
    threading.excepthook = lambda hook: sys.exit(f"{hook.exc_value!r}")
    main()
