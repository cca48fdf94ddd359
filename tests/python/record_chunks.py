"""Lists the messages of an MCAP file by chunk, by the reference implementation.

    record_chunks.py FILE

Prints a JSON line for each chunk, or nothing for a file without chunks. The line has the byte after the chunk's record.
Of each message in the chunk it has the topic, the sequence, the log time and BLAKE3 of the message's data.
"""

import json
import struct
import sys

import blake3
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message
from mcap.stream_reader import breakup_chunk


def main():
    file = open(sys.argv[1], "rb")
    content = file.read()
    at, topics = 8, {}
    while at + 9 <= len(content):
        opcode, length = struct.unpack_from("<BQ", content, at)
        end = at + 9 + length
        if end > len(content) or opcode == Opcode.DATA_END:
            break
        if opcode == Opcode.CHUNK:
            file.seek(at + 9)
            messages = []
            for record in breakup_chunk(Chunk.read(ReadDataStream(file)), validate_crc=True):
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Message):
                    data = blake3.blake3(record.data).hexdigest()
                    messages.append([topics[record.channel_id], record.sequence, record.log_time, data])
            print(json.dumps({"end": end, "messages": messages}))
        at = end


if __name__ == "__main__":
    main()
