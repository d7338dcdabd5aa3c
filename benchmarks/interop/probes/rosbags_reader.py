"""Runs in the peers' Python. `rosbags_reader.py FILE_OR_FOLDER...`: every message decoded, counts by topic as JSON."""

import json
import sys
from collections import Counter
from pathlib import Path

import rosbags.highlevel

counts = Counter()
for place in sys.argv[1:]:
    with rosbags.highlevel.AnyReader([Path(place)]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
            counts[connection.topic] += 1
print(json.dumps(counts))
