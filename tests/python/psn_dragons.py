"""A lighting desk that lists its trackers: PosiStageNet as PyPI's pypsn decodes it.

    psn_dragons.py

Listens to a free UDP port and prints it as the first line. Ends when packets of names and of positions have come. Then
prints a JSON line with the names and the positions of all trackers, by their numbers.
"""

import json
import socket

import pypsn


def main():
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", 0))
    sock.settimeout(120)
    print(json.dumps({"port": sock.getsockname()[1]}), flush=True)
    names, positions = {}, {}
    while not (names and positions):
        decoded = pypsn.parse_psn_packet(sock.recv(65536))
        if isinstance(decoded, pypsn.psn_info_packet):
            names.update({tracker.tracker_id: tracker.tracker_name.decode() for tracker in decoded.trackers})
        else:
            positions.update({tracker.id: list(tuple(tracker.pos)) for tracker in decoded.trackers})
    print(json.dumps({"names": names, "positions": positions}), flush=True)


if __name__ == "__main__":
    main()
