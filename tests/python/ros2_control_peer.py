"""A client of the control services without ROS: Cyclone DDS calls them as rmw_cyclonedds_cpp does.

    ros2_control_peer.py --name NAME [--domain D] [--calls-of-input | --fresh N | --in-turn N | --flood N]
        [SERVICE[=VALUE] ...]

Before each request and response come the client (uint64) and the number of the call (int64). Prints a JSON line for
each response, or null if none came within some seconds. With --calls-of-input the calls are lines of standard input, and
the clients of all services stay. With --fresh, N clients, each with its own participant, make their first call to the
first service. With --in-turn, N clients, each the only one for its time, make four first calls at once; prints the
number of responses to each. With --flood, one client calls the first service N times without waiting for a response.
Without a call, prints the topics below NAME with their types, including those of services, and /clock and /tf.
"""

import argparse
import functools
import gc
import json
import resource
import sys
import threading
import time
import types
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct, annotations, types as idl
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

SERVICE = Qos(
    Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.Volatile, Policy.History.KeepLast(10)
)


def struct(typename, fields):
    def body(namespace):
        namespace["__annotations__"] = dict(fields)
        namespace["__module__"] = __name__

    name = typename.split("::")[-1]
    return dataclass(annotations.final(types.new_class(name, (IdlStruct,), {"typename": typename}, body)))


def message(package, name, fields):
    return struct(f"{package}::msg::dds_::{name}_", fields)


Time = message("builtin_interfaces", "Time", [("sec", idl.int32), ("nanosec", idl.uint32)])
Result = message("simulation_interfaces", "Result", [("result", idl.uint8), ("error_message", str)])
State = message("simulation_interfaces", "SimulationState", [("state", idl.uint8)])
Features = message(
    "simulation_interfaces",
    "SimulatorFeatures",
    [("features", idl.sequence[idl.uint16]), ("spawn_formats", idl.sequence[str]), ("custom_info", str)],
)
Value = message(
    "rcl_interfaces",
    "ParameterValue",
    [
        ("type", idl.uint8),
        ("bool_value", bool),
        ("integer_value", idl.int64),
        ("double_value", idl.float64),
        ("string_value", str),
        ("byte_array_value", idl.sequence[idl.uint8]),
        ("bool_array_value", idl.sequence[bool]),
        ("integer_array_value", idl.sequence[idl.int64]),
        ("double_array_value", idl.sequence[idl.float64]),
        ("string_array_value", idl.sequence[str]),
    ],
)
Parameter = message("rcl_interfaces", "Parameter", [("name", str), ("value", Value)])
Descriptor = message("rcl_interfaces", "ParameterDescriptor", [("name", str)])
SetResult = message("rcl_interfaces", "SetParametersResult", [("successful", bool), ("reason", str)])
Listed = message("rcl_interfaces", "ListParametersResult", [("names", idl.sequence[str]), ("prefixes", idl.sequence[str])])
NAMES = [("names", idl.sequence[str])]
PARAMETERS = [("parameters", idl.sequence[Parameter])]
EMPTY = [("structure_needs_at_least_one_member", idl.uint8)]
RESULT = [("result", Result)]
SUCCESS = [("success", bool)]
TRIGGER = ("std_srvs", "Trigger", EMPTY, [("success", bool), ("message", str)])


def simulation(name, request, response):
    return ("simulation_interfaces", name, request, response)


def player(name, request, response):
    return ("rosbag2_interfaces", name, request, response)


def parameters(name, request, response):
    return ("rcl_interfaces", name, request, response)


# Package, type, fields of the request, fields of the response: as the .srv files have them.
SERVICES = {
    "get_simulator_features": simulation("GetSimulatorFeatures", EMPTY, [("features", Features)]),
    "get_simulation_state": simulation("GetSimulationState", EMPTY, [("state", State), ("result", Result)]),
    "set_simulation_state": simulation("SetSimulationState", [("state", State)], RESULT),
    "step_simulation": simulation("StepSimulation", [("steps", idl.uint64)], RESULT),
    "reset_simulation": simulation("ResetSimulation", [("scope", idl.uint8)], RESULT),
    "pause": player("Pause", EMPTY, EMPTY),
    "resume": player("Resume", EMPTY, EMPTY),
    "toggle_paused": player("TogglePaused", EMPTY, EMPTY),
    "is_paused": player("IsPaused", EMPTY, [("paused", bool)]),
    "get_rate": player("GetRate", EMPTY, [("rate", idl.float64)]),
    "set_rate": player("SetRate", [("rate", idl.float64)], SUCCESS),
    "seek": player("Seek", [("time", Time)], SUCCESS),
    "play_next": player("PlayNext", EMPTY, SUCCESS),
    "list_parameters": parameters(
        "ListParameters", [("prefixes", idl.sequence[str]), ("depth", idl.uint64)], [("result", Listed)]
    ),
    "get_parameters": parameters("GetParameters", NAMES, [("values", idl.sequence[Value])]),
    "get_parameter_types": parameters("GetParameterTypes", NAMES, [("values", idl.sequence[idl.uint8])]),
    "describe_parameters": parameters("DescribeParameters", NAMES, [("descriptors", idl.sequence[Descriptor])]),
    "set_parameters": parameters("SetParameters", PARAMETERS, [("results", idl.sequence[SetResult])]),
    "set_parameters_atomically": parameters("SetParametersAtomically", PARAMETERS, [("result", SetResult)]),
    "hold": TRIGGER,
    "release": TRIGGER,
    "go": TRIGGER,
}
HEADER = [("client", idl.uint64), ("sequence", idl.int64)]


@functools.cache
def ends(service):
    """Returns the types of a service's request and response."""
    package, name, request, response = SERVICES[service]
    of = lambda direction, fields: struct(f"{package}::srv::dds_::{name}_{direction}_", HEADER + fields)
    return of("Request", request), of("Response", response)


def arguments_of(service, text):
    """Returns the fields of a request."""
    kinds = [kind for _, kind in SERVICES[service][2]]
    kind = kinds[0]
    if SERVICES[service][0] == "rcl_interfaces":
        names = [text] if text else []
        if kind == idl.sequence[Parameter]:
            return [[Parameter(name=name, value=Value(2, False, 7, 0.0, "", [], [], [], [], [])) for name in names]]
        return [names, 0] if len(kinds) == 2 else [names]
    if kind is State:
        return [State(state=int(text))]
    if kind is Time:
        return [Time(sec=int(float(text) // 1), nanosec=round(float(text) % 1 * 1e9))]
    return [float(text) if kind is idl.float64 else int(text or 0)]


def plain(value):
    if hasattr(value, "__dataclass_fields__"):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__}
    return [plain(item) for item in value] if isinstance(value, (list, tuple)) else value


class Client:
    """A client of one service."""

    lock = threading.Lock()
    numbers = 0

    def __init__(self, participant, name, service):
        self.service = service
        with Client.lock:
            Client.numbers += 1
            self.number = 1000 * Client.numbers + 7
        request, response = ends(service)
        self.request = request
        requests = Topic(participant, f"rq/{name}/{service}Request", request, qos=SERVICE)
        responses = Topic(participant, f"rr/{name}/{service}Reply", response, qos=SERVICE)
        self.reader = DataReader(participant, responses, qos=SERVICE)
        self.writer = DataWriter(participant, requests, qos=SERVICE)
        self.sequence = 0

    def ready(self, seconds):
        """Waits as rclpy's wait_for_service does: until this side has matched the other."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if self.writer.get_matched_subscriptions() and self.reader.get_matched_publications():
                return True
            time.sleep(0.001)
        return False

    def send(self, text):
        self.sequence += 1
        self.writer.write(self.request(self.number, self.sequence, *arguments_of(self.service, text)))

    def responses(self, seconds):
        """Yields the responses to this client that come within some seconds."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for sample in self.reader.take(N=10):
                # The notice that a publisher has gone comes as an empty sample.
                if hasattr(sample, "__dataclass_fields__") and sample.client == self.number:
                    yield sample
            time.sleep(0.001)

    def call(self, text, seconds):
        self.send(text)
        for sample in self.responses(seconds):
            if sample.sequence == self.sequence:
                names = (name for name in sample.__dataclass_fields__ if name not in dict(HEADER))
                return {name: plain(getattr(sample, name)) for name in names}
        return None

    def call_at_once(self, calls, seconds):
        """Returns the number of these calls that get a response."""
        for _ in range(calls):
            self.send("")
        answered = set()
        for sample in self.responses(seconds):
            answered.add(sample.sequence)
            if len(answered) == calls:
                break
        return len(answered)


def endpoints(participant, name, topics, seconds):
    """Returns the topics below a name with their types, by readers and writers, half a second after there are at least
    `topics` of them."""
    found = {"read": {}, "written": {}}
    kinds = [("read", BuiltinTopicDcpsSubscription), ("written", BuiltinTopicDcpsPublication)]
    readers = [(what, BuiltinDataReader(participant, kind)) for what, kind in kinds]
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for what, reader in readers:
            for sample in reader.take(N=1000):
                topic = getattr(sample, "topic_name", None)
                if topic and topic.startswith((f"rq/{name}/", f"rr/{name}/", f"rt/{name}/", "rt/clock", "rt/tf")):
                    found[what][topic] = sample.type_name
        if len(found["read"]) + len(found["written"]) >= topics:
            end = min(end, time.monotonic() + 0.5)
            topics = float("inf")
        time.sleep(0.01)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", required=True)
    parser.add_argument("--domain", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=300.0, help="greatest wait for a response")
    parser.add_argument("--calls-of-input", action="store_true")
    parser.add_argument("--fresh", type=int, default=0)
    parser.add_argument("--in-turn", type=int, default=0)
    parser.add_argument("--flood", type=int, default=0)
    parser.add_argument("--topics", type=int, default=1, help="topics to wait for if there is no call")
    parser.add_argument("calls", nargs="*")
    arguments = parser.parse_args()

    # A peer out of control must not take the machine's memory.
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
    if arguments.fresh:

        # No client is removed while others are created.
        clients = []
        creation = threading.Lock()

        def first_call(_):
            # Topics of one type that are created at once fail at times.
            with creation:
                client = Client(DomainParticipant(arguments.domain), arguments.name, arguments.calls[0])
            clients.append(client)
            if not client.ready(300):
                return {"response": "no service"}
            sent = time.monotonic()
            return {"response": client.call("", arguments.seconds), "seconds": time.monotonic() - sent}

        with ThreadPoolExecutor(10) as pool:
            for answer in pool.map(first_call, range(arguments.fresh)):
                print(json.dumps(answer), flush=True)
        return

    for _ in range(arguments.in_turn):
        client = Client(DomainParticipant(arguments.domain), arguments.name, arguments.calls[0])
        if not client.ready(300):
            sys.exit("no service")
        print(json.dumps(client.call_at_once(4, arguments.seconds)), flush=True)
        del client
        gc.collect()
    if arguments.in_turn:
        return

    participant = DomainParticipant(arguments.domain)
    if not arguments.calls and not arguments.calls_of_input:
        print(json.dumps(endpoints(participant, arguments.name, arguments.topics, arguments.seconds)))
        return
    if arguments.flood:
        client = Client(participant, arguments.name, arguments.calls[0])
        client.ready(300)
        for _ in range(arguments.flood):
            client.send("")
        print(json.dumps(client.sequence), flush=True)
        # Until it is killed: the process does not read its messages.
        time.sleep(arguments.seconds)
        return
    clients = {}
    for call in (line.strip() for line in sys.stdin) if arguments.calls_of_input else arguments.calls:
        service, _, text = call.partition("=")
        if service not in clients:
            clients[service] = Client(participant, arguments.name, service)
            if not clients[service].ready(300):
                sys.exit(f"no server for {service}")
        print(json.dumps({"call": call, "response": clients[service].call(text, arguments.seconds)}), flush=True)


if __name__ == "__main__":
    main()
