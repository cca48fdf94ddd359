"""Writes the parts of a recording that a replay needs into a bag, with the package rosbags: its chunks, its
definitions, its index.

    bag_writer.py RECORDING FOLDER
"""

import pathlib
import sys

from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Writer
from rosbags.rosbag2.writer import StoragePlugin
from rosbags.typesys import Stores, get_typestore

TOPICS = ("handles", "stage", "alerts", "cues", "status")


def main():
    recording, folder = map(pathlib.Path, sys.argv[1:])
    with AnyReader([recording], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            played = {
                connection.id: writer.add_connection(
                    connection.topic, connection.msgtype, typestore=reader.typestore, serialization_format="cdr"
                )
                for connection in reader.connections
                if connection.topic.rsplit("/", 1)[-1] in TOPICS
            }
            for connection, stamp, data in reader.messages():
                if connection.id in played:
                    writer.write(played[connection.id], stamp, data)


if __name__ == "__main__":
    main()
