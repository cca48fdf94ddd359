"""Counts the submessages that come to UDP ports of this machine over the loopback interface, as root.

    ros2_wire.py --ports 7411,7413 --messages 20

Prints {"data": N, "data_frag": M} when that many submessages of either kind have come. DATA is a whole message, DATA_FRAG
a part of one (RTPS 2.5, sections 9.4.5.4 and 9.4.5.5). Writers of discovery do not count.
"""

import argparse
import json
import socket
import struct

DATA, DATA_FRAG = 0x15, 0x16


def submessages(datagram):
    """Yields the kind and the body of each submessage after the header of 20 bytes."""
    place = 20
    while place + 4 <= len(datagram):
        kind, _, length = struct.unpack_from("<BBH", datagram, place)
        body = datagram[place + 4 :][: length or None]
        yield kind, body
        place += 4 + len(body)


def udp(packet):
    """Returns the port and the payload of an IPv4 packet in an Ethernet frame; no port if it is not whole UDP."""
    header = 14 + (packet[14] & 15) * 4
    fragment = struct.unpack_from(">H", packet, 20)[0] & 0x3FFF
    if packet[12:14] != b"\x08\x00" or packet[23] != socket.IPPROTO_UDP or fragment:
        return None, b""
    return struct.unpack_from(">H", packet, header + 2)[0], packet[header + 8 :]


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--ports", type=lambda text: {int(port) for port in text.split(",")})
    arguments.add_argument("--messages", type=int)
    options = arguments.parse_args()
    # ETH_P_ALL.
    sniffer = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3))
    sniffer.bind(("lo", 0))
    counts = {DATA: 0, DATA_FRAG: 0}
    print("listening", flush=True)
    while sum(counts.values()) < options.messages:
        packet, address = sniffer.recvfrom(70_000)
        # The loopback interface shows each packet as outgoing, and again as incoming.
        if address[2] == socket.PACKET_OUTGOING:
            continue
        port, payload = udp(packet)
        if port not in options.ports or payload[:4] != b"RTPS":
            continue
        for kind, body in submessages(payload):
            # The last byte of the writer's number has its kind: user-defined, without a key.
            if kind in counts and body[11] == 0x03:
                counts[kind] += 1
    print(json.dumps({"data": counts[DATA], "data_frag": counts[DATA_FRAG]}), flush=True)


main()
