"""Computes the hashes of a log from the frames of another process, knowing only the layout of bytes.

    log_hash.py --name NAME --rate HZ --seconds S

Prints a JSON line for each second with every frame. The line has the number of the second, its first and last tick, its
frames, and BLAKE3. The hash is over bytes 8 to 23 and 48 to 95 of each header and all bytes of its poses.
"""

import argparse
import ctypes
import json
import struct
import time

import blake3
import iceoryx2 as iox2
from by_design import opaque


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", required=True)
    parser.add_argument("--rate", type=float, required=True)
    parser.add_argument("--seconds", type=int, required=True)
    arguments = parser.parse_args()
    iox2.set_log_level(iox2.LogLevel.Fatal)
    node = iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
    service = node.service_builder(iox2.ServiceName.new(f"{arguments.name}/poses"))
    service = service.publish_subscribe(iox2.Slice[opaque("HandlePose", 1, 40)])
    service = service.user_header(opaque("FrameHeader", 2, 96))
    deadline = time.monotonic() + 60
    while True:
        try:
            frames = service.open().subscriber_builder().create()
            break
        except iox2.PublishSubscribeOpenError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.02)
    print(json.dumps({"type": "ready"}), flush=True)
    hasher, second, ticks, latest, printed = None, None, [], None, 0
    while printed < arguments.seconds and time.monotonic() < deadline:
        time.sleep(0.002)
        while (sample := frames.receive()) is not None:
            header = bytes(sample.user_header().contents)
            sequence, tick = struct.unpack_from("<2Q", header, 8)
            count = sample.header.number_of_elements
            handles = (ctypes.c_char * (40 * count)).from_address(sample.payload_ptr).raw
            sample.delete()
            if int(tick / arguments.rate) != second:
                if hasher is not None:
                    line = {"type": "second", "second": second, "from": ticks[0], "to": ticks[-1]}
                    print(json.dumps(line | {"frames": len(ticks), "hash": hasher.hexdigest()}), flush=True)
                    printed += 1
                # The first second may have begun before this program had subscribed.
                hasher = blake3.blake3() if latest is not None or sequence == 0 else None
                second, ticks = int(tick / arguments.rate), []
            if latest is not None and sequence != latest + 1:
                hasher = None
            latest = sequence
            ticks.append(tick)
            if hasher is not None:
                hasher.update(header[8:24] + header[48:96] + handles)


if __name__ == "__main__":
    main()
