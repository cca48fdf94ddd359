"""A lighting desk that receives OSC with PyPI's python-osc and prints a JSON line for each message, in the order of
arrival; or a controller that sends messages, each an address with numbers.

    osc_peer.py --port P [--send /seek,400.5 /go]
"""

import argparse
import json
import socket

from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_server import BlockingOSCUDPServer
from pythonosc.udp_client import SimpleUDPClient


def heard(address, *arguments):
    print(json.dumps({"address": address, "arguments": arguments}), flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--send", nargs="+")
    arguments = parser.parse_args()
    if arguments.send:
        client = SimpleUDPClient("127.0.0.1", arguments.port)
        for message in arguments.send:
            address, *numbers = message.split(",")
            client.send_message(address, [float(number) for number in numbers])
        return
    dispatcher = Dispatcher()
    dispatcher.set_default_handler(heard)
    server = BlockingOSCUDPServer(("127.0.0.1", arguments.port), dispatcher)
    server.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 23)
    print(json.dumps({"address": "listening"}), flush=True)
    server.serve_forever()


if __name__ == "__main__":
    main()
