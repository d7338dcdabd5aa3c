"""Runs in the peers' Python. `kiss_icp_loader.py FOLDER TOPIC`: scans its ROS bag loader gives, as JSON."""

import json
import sys
from pathlib import Path

from kiss_icp.datasets.rosbag import RosbagDataset

topic = sys.argv[2]
scans = RosbagDataset(Path(sys.argv[1]), topic)
given = sum(1 for index in range(len(scans)) if len(scans[index][0]))
print(json.dumps({topic: given}))
