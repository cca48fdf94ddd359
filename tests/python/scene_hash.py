"""Reads the hash of a scene's text from a publisher's stage, knowing its name, its size and the offset of the hash.

    scene_hash.py --name NAME --scene FILE

Prints a JSON line: the hash that the stage has, and BLAKE3 of the file as computed here.
"""

import argparse
import json
import pathlib
import time

import blake3
import iceoryx2 as iox2
from by_design import opaque

# Three numbers of eight bytes and two of four come before the hash. After it stand four lists, each with its length and
# room for dragons, obstacles, events and cues.
HASH = slice(3 * 8 + 2 * 4, 3 * 8 + 2 * 4 + 32)
SIZE = HASH.stop + (8 + 16 * 152) + (8 + 65 * 88) + (8 + 160 * 24) + (8 + 32 * 80)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", required=True)
    parser.add_argument("--scene", required=True)
    arguments = parser.parse_args()
    iox2.set_log_level(iox2.LogLevel.Fatal)
    node = iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
    service = node.service_builder(iox2.ServiceName.new(f"{arguments.name}/stage"))
    service = service.publish_subscribe(iox2.Slice[opaque("StageSegment", 6, 72)]).user_header(opaque("Stage", 7, SIZE))
    deadline = time.monotonic() + 60
    while True:
        try:
            stages = service.open().subscriber_builder().create()
            break
        except iox2.PublishSubscribeOpenError as error:
            # If the disk is busy a service is incomplete for seconds.
            if not any(reason in str(error) for reason in ("DoesNotExist", "HangsInCreation")) or time.monotonic() > deadline:
                raise
            time.sleep(0.02)
    while (sample := stages.receive()) is None:
        assert time.monotonic() < deadline, "no stage came"
        time.sleep(0.02)
    published = bytes(sample.user_header().contents)[HASH].hex()
    sample.delete()
    computed = blake3.blake3(pathlib.Path(arguments.scene).read_bytes()).hexdigest()
    print(json.dumps({"published": published, "computed": computed}))


if __name__ == "__main__":
    main()
