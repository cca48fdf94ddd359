"""A subscriber of either transport, which prints its messages in one form, whatever the transport.

    transport_peer.py --transport iceoryx2|ros2 --name NAME --seconds S [--until KIND ...]

Prints a JSON line for every frame, alert, stage and status, in the order of reading, and one at the end. The subscriber
may be started before the publisher, and stays while publishers come and go. After SIGTERM it stays until the last of
them has gone and all its messages are read. With --until it ends a second after a message of each of these kinds has
come.
"""

import argparse
import json
import math
import signal
import time



class Iceoryx2:
    """The services in shared memory, opened when they appear."""

    def __init__(self, name):
        import bench_dragon as messages
        import iceoryx2 as iox2

        iox2.set_log_level(iox2.LogLevel.Fatal)
        self.iox2, self.messages, self.name = iox2, messages, name
        self.node = (
            iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
        )
        self.services, self.ports = {}, {}

    def open(self):
        iox2, messages = self.iox2, self.messages
        kinds = {
            "stage": (iox2.Slice[messages.StageSegment], messages.Stage),
            "alerts": (messages.CollisionAlert, None),
            "status": (messages.LoopStatus, None),
            "poses": (iox2.Slice[messages.HandlePose], messages.FrameHeader),
        }
        for kind, (payload, header) in kinds.items():
            if kind in self.ports:
                continue
            builder = self.node.service_builder(iox2.ServiceName.new(f"{self.name}/{kind}")).publish_subscribe(payload)
            try:
                self.services[kind] = (builder.user_header(header) if header else builder).open()
                self.ports[kind] = self.services[kind].subscriber_builder().create()
            except iox2.PublishSubscribeOpenError:
                pass  # The service does not exist yet.

    def take(self):
        self.open()
        for kind, port in self.ports.items():
            while (sample := port.receive()) is not None:
                if kind == "poses":
                    handles = self.messages.handles_of(sample)
                    yield "frame", sample.user_header().contents, [(h["x"], h["y"]) for h in handles[:2]], len(handles)
                elif kind == "stage":
                    yield kind, sample.user_header().contents, None, None
                else:
                    yield {"alerts": "alert"}.get(kind, kind), sample.payload().contents, None, None
                sample.delete()

    def publishers(self):
        return self.services["poses"].dynamic_config.number_of_publishers if self.services else 0


class Ros2:
    """The topics, read through Cyclone DDS."""

    KINDS = {"stage": "stage", "alerts": "alert", "status": "status", "handles": "frame"}

    def __init__(self, name):
        import ros2_peer as peer
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        participant = DomainParticipant(0)
        self.peer, self.readers = peer, {}
        for topic in self.KINDS:
            durability = "transient_local" if topic in ("stage", "alerts") else "volatile"
            # All messages of a run: this process may stand still for seconds on a busy machine.
            qos = peer.quality("reliable", durability, 4000)
            described = Topic(participant, f"rt/{name}/{topic}", peer.TOPICS[topic])
            self.readers[topic] = DataReader(participant, described, qos=qos)

    def take(self):
        for topic, reader in self.readers.items():
            for sample in reader.take(N=100):
                if not isinstance(sample, self.peer.TOPICS[topic]):
                    continue  # The notice that a publisher has gone.
                frame = topic == "handles"
                handles = [(pose.x, pose.y) for pose in sample.poses[:2]] if frame else None
                yield self.KINDS[topic], sample, handles, len(sample.poses) if frame else None

    def publishers(self):
        return len(self.readers["handles"].get_matched_publications())


FIELDS = {
    "frame": ("run_id", "sequence", "tick", "sim_time", "state", "epoch", "handles"),
    "alert": ("run_id", "tick", "level", "event", "event_time", "event_bench_a", "event_bench_b"),
    "stage": ("run_id", "freeze_time", "cues"),
    "status": ("run_id", "sequence", "tick", "rate", "skipped"),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--transport", choices=["iceoryx2", "ros2"], required=True)
    parser.add_argument("--name", required=True)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--until", nargs="+", default=[])
    arguments = parser.parse_args()
    told = []
    signal.signal(signal.SIGTERM, lambda *_: told.append(True))
    peer = {"iceoryx2": Iceoryx2, "ros2": Ros2}[arguments.transport](arguments.name)
    print(json.dumps({"type": "ready"}), flush=True)
    end = time.monotonic() + arguments.seconds
    awaited = set(arguments.until)
    gone = taken = False
    # A slow machine can leave more messages than one reading takes.
    while time.monotonic() < end and (taken or not gone):
        # Tested before the remaining messages are read.
        gone, taken = bool(told) and peer.publishers() == 0, False
        for kind, message, handles, count in peer.take():
            taken = True
            line = {"type": kind} | {field: getattr(message, field) for field in FIELDS[kind]}
            if kind == "stage":
                dragon = message.dragons[0]
                line |= {field: getattr(dragon, field) for field in ("benches", "segments", "body_length")}
            if kind == "frame":
                line |= {"count": count, "link": math.dist(*map(lambda xy: tuple(map(float, xy)), handles))}
            print(json.dumps(line))
            if awaited == {kind}:
                end = min(end, time.monotonic() + 1.0)
            awaited.discard(kind)
        time.sleep(0.002)
    print(json.dumps({"type": "end", "publishers": peer.publishers()}), flush=True)


if __name__ == "__main__":
    main()
