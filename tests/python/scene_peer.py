"""A late subscriber of a show's scene.

    scene_peer.py --name NAME --seconds S

Prints one JSON line: run, hash and text of `<name>/scene`, and run and hash of `<name>/stage`. Ends with an error if
they do not come in time.
"""

import argparse
import ctypes
import json
import sys
import time

import iceoryx2 as iox2

import bench_dragon as messages


def received(node, name, payload, header, end):
    """Returns the first sample of a service."""
    service = port = None
    while time.monotonic() < end:
        if port is None:
            builder = node.service_builder(iox2.ServiceName.new(name)).publish_subscribe(payload)
            try:
                service = (builder.user_header(header) if header else builder).open()
                port = service.subscriber_builder().create()
            except iox2.PublishSubscribeOpenError:
                pass  # The service does not exist yet.
        elif (sample := port.receive()) is not None:
            return sample
        time.sleep(0.01)
    sys.exit(f"nothing came from {name}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", required=True)
    parser.add_argument("--seconds", type=float, required=True)
    arguments = parser.parse_args()
    iox2.set_log_level(iox2.LogLevel.Fatal)
    node = iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
    end = time.monotonic() + arguments.seconds
    name = arguments.name
    scene = received(node, f"{name}/scene", iox2.Slice[ctypes.c_uint8], messages.SceneHeader, end)
    header, length = scene.user_header().contents, scene.header.number_of_elements
    text = bytes((ctypes.c_uint8 * length).from_address(scene.payload_ptr)).decode()
    line = {"run_id": header.run_id, "hash": bytes(header.hash).hex(), "text": text}
    scene.delete()
    stage = received(node, f"{name}/stage", iox2.Slice[messages.StageSegment], messages.Stage, end)
    shown = stage.user_header().contents
    print(json.dumps(line | {"stage_run_id": shown.run_id, "stage_hash": bytes(shown.scene_hash).hex()}))
    stage.delete()


if __name__ == "__main__":
    main()
