"""The second publisher of a show's services, such as the end of a tunnel to other machines: silent, or with its own
run.

    second_publisher.py --name NAME

Prints a JSON line once it has all ports, with true if a third publisher was refused, and one for every stage it
receives. On SIGUSR1 it sends frames and alerts of run 7, on the next one it stops sending, which it prints; SIGTERM
ends it.
"""

import argparse
import json
import signal
import time

import bench_dragon as messages
import iceoryx2 as iox2

FOREIGN_RUN = 7


def refused(make):
    try:
        make()
    except iox2.PublisherCreateError:
        return True
    return False


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", required=True)
    name = parser.parse_args().name
    sending, told = [], []
    signal.signal(signal.SIGUSR1, lambda *_: sending.append(True))
    signal.signal(signal.SIGTERM, lambda *_: told.append(True))
    iox2.set_log_level(iox2.LogLevel.Fatal)
    node = iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
    kinds = {
        "status": messages.LoopStatus,
        "stage": iox2.Slice[messages.StageSegment],
        "alerts": messages.CollisionAlert,
        "poses": iox2.Slice[messages.HandlePose],
    }
    headers = {"poses": messages.FrameHeader, "stage": messages.Stage}
    services = {}
    while len(services) < len(kinds):
        for kind in kinds.keys() - services.keys():
            builder = node.service_builder(iox2.ServiceName.new(f"{name}/{kind}")).publish_subscribe(kinds[kind])
            try:
                services[kind] = (builder.user_header(headers[kind]) if kind in headers else builder).open()
            except iox2.PublishSubscribeOpenError:
                time.sleep(0.02)
    make = {kind: services[kind].publisher_builder for kind in ("status", "alerts")}
    make["stage"] = lambda: services["stage"].publisher_builder().initial_max_slice_len(1)
    make["poses"] = lambda: services["poses"].publisher_builder().initial_max_slice_len(224)
    ports = {kind: builder().create() for kind, builder in make.items()}
    stages = services["stage"].subscriber_builder().create()
    third = all(refused(lambda: builder().create()) for builder in make.values())
    print(json.dumps({"type": "ready", "third_refused": third}), flush=True)
    sequence = 0
    while not told:
        while (sample := stages.receive()) is not None:
            stage = sample.user_header().contents
            print(json.dumps({"type": "stage", "run_id": stage.run_id, "stamp_ns": stage.stamp_ns}), flush=True)
            sample.delete()
        if len(sending) > 1:
            sending.clear()
            print(json.dumps({"type": "silent"}), flush=True)
        if sending:
            sample = ports["poses"].loan_slice_uninit(224)
            header = sample.user_header().contents
            header.run_id, header.sequence, header.tick, header.handles = FOREIGN_RUN, sequence, sequence, 224
            sample.assume_init().send()
            if sequence % 20 == 0:
                ports["alerts"].send_copy(messages.CollisionAlert(run_id=FOREIGN_RUN, level=4))
            sequence += 9
            print(json.dumps({"type": "sent", "sequence": sequence}), flush=True)
        time.sleep(0.02)


if __name__ == "__main__":
    main()
