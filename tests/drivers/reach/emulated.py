"""An emulated Reach at hand for tests, and what a driver makes of it."""

import threading
from contextlib import contextmanager

from drivers.sim.gnss_geodesy import Datum
from drivers.sim.sources import GnssEpoch
from tests.waiting import PATIENCE_S

DATUM = Datum()


class Circle:
    """A fix that moves: walk time can be read back from the position, 1 m/s to the east."""

    quality = 4

    def epoch(self, t_ns):
        latitude, longitude, height = DATUM.geodetic((t_ns / 1e9, 0.0, 0.0))
        return GnssEpoch(latitude, longitude, height, 48.1, self.quality, 20, 0.7, 1.2, (0.011, 0.012, 0.02), 1.0, 90.0)


@contextmanager
def in_thread(target, *args, **kwargs):
    """A thread that takes a stop event as its keyword `stop`."""
    stop = threading.Event()
    thread = threading.Thread(target=target, args=args, kwargs=kwargs | {"stop": stop}, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()
