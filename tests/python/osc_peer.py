"""A lighting desk that receives OSC with PyPI's python-osc and prints a JSON line for each message, in the order of
arrival.

    osc_peer.py --port P
"""

import argparse
import json
import socket

from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_server import BlockingOSCUDPServer


def heard(address, *arguments):
    print(json.dumps({"address": address, "arguments": arguments}), flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, required=True)
    dispatcher = Dispatcher()
    dispatcher.set_default_handler(heard)
    server = BlockingOSCUDPServer(("127.0.0.1", parser.parse_args().port), dispatcher)
    server.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 23)
    print(json.dumps({"address": "listening"}), flush=True)
    server.serve_forever()


if __name__ == "__main__":
    main()
