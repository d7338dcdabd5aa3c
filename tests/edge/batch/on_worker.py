"""What the workers of the tests are given to do: the real thing with a small odometry, and a way to die."""

from __future__ import annotations

import os
import signal

from edge.batch import worker
from edge.process import process as module
from tests.edge.process.test_process import fakes

DIE = "die"
"""A file of this name in the session's folder: its worker is killed, once."""


def run(step, config, version, topic):
    module.process.__defaults__ = (None, fakes())
    fuse = step.session / DIE
    if fuse.exists():
        fuse.unlink()
        os.kill(os.getpid(), signal.SIGKILL)
    return worker.run(step, config, version, topic)
