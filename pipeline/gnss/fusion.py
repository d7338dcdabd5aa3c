"""`map` -> `odom`, live: odometry and fixes in, as they come; the odometry itself is never touched."""

from __future__ import annotations

from collections import deque

import numpy as np

from drivers.messages import GnssFix
from pipeline.estimates import Array, GlobalPose, MapToOdom, OdometryEstimate
from pipeline.gnss.bank import Bank
from pipeline.gnss.belief import YAW, turned
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.history import History
from pipeline.gnss.lateness import Lateness, lateness
from pipeline.gnss.sighting import Sighting, Sightings, measured_ns
from pipeline.gnss.yaw_search import YawSearch

MOST_WAITING = 100
LOOKED_AT = 1200
"""Sightings, when their lateness is looked for: 20 minutes."""
LOOK_EVERY = 60
UNKNOWN_YAW = np.pi
"""One sigma, rad."""


class GnssFusion:
    """One odometry, one receiver. Not thread-safe. Deterministic in the order of the calls."""

    def __init__(self, config: FusionConfig | None = None) -> None:
        self.config = config or FusionConfig()
        self._history = History(self.config)
        self._sightings = Sightings(self._history, self.config)
        self._waiting: deque[GnssFix] = deque(maxlen=MOST_WAITING)
        self._search = YawSearch(self.config)
        self._bank: Bank | None = None
        self._used = 0
        self._gated = 0
        self._seen: deque[Sighting] = deque(maxlen=LOOKED_AT)
        self._unlooked = 0
        self._lateness: Lateness | None = None

    def add_odometry(self, estimate: OdometryEstimate) -> None:
        """In order of time. Where its way begins anew, so does the search for the yaw; the datum stays."""
        if not self._history.add(estimate):
            self._search, self._bank = YawSearch(self.config), None
            self._seen.clear()
        due = [fix for fix in self._waiting if measured_ns(fix, self.config) <= estimate.stamp_ns]
        for fix in due:
            self._waiting.remove(fix)
            self._place(fix)

    def add_fix(self, fix: GnssFix) -> None:
        """Any fix, whenever it comes: it is compared with the odometry at its own stamp."""
        newest_ns = self._history.newest_ns
        if newest_ns is not None and measured_ns(fix, self.config) <= newest_ns:
            self._place(fix)
        else:
            self._waiting.append(fix)

    @property
    def note(self) -> str:
        """What the operator should know of the receiver; empty where nothing is wrong."""
        disputes = self._bank.disputes if self._bank is not None else []
        doubts = [*([self._lateness] if self._lateness is not None else []), *disputes[-1:]]
        return "; ".join(map(str, doubts))

    def state(self) -> MapToOdom | None:
        """None before the first fix in this `odom`."""
        datum = self._sightings.datum
        if datum is None or not self._search.sightings:
            return None
        place = (datum.latitude_deg, datum.longitude_deg, datum.height_m)
        counts = (place, self._used, self._gated + self._sightings.refused)
        if self._bank is None:
            last = self._search.sightings[-1]
            covariance = np.diag([*last.sigma_m**2, UNKNOWN_YAW**2])
            return MapToOdom(
                last.passage.stamp_ns,
                last.position_m - last.passage.antenna_m,
                0.0,
                covariance,
                *counts,
                observable=False,
            )
        belief, passage = self._bank.belief, self._bank.passage
        yaw = float(belief.mean[YAW])
        arm = turned(yaw, -passage.antenna_m)
        jacobian = _levered(arm)
        covariance = jacobian @ belief.covariance[:4, :4] @ jacobian.T
        return MapToOdom(passage.stamp_ns, belief.mean[:3] + arm, yaw, covariance, *counts, observable=True)

    def global_pose(self, estimate: OdometryEstimate) -> GlobalPose | None:
        """An estimate of the odometry in `map`; None while the yaw is not known."""
        if self._bank is None:
            return None
        passage = self._history.at(estimate.stamp_ns)
        way_m = 0.0 if passage is None else abs(passage.drift_way_m - self._bank.passage.drift_way_m)
        belief, seen_from = self._bank.belief, self._bank.passage.antenna_m
        return pose_from(estimate, belief.mean, belief.covariance, seen_from, way_m * self._bank.drift)

    def _place(self, fix: GnssFix) -> None:
        sighting = self._sightings.place(fix)
        if sighting is not None:
            used = self._take(sighting)
            self._used += used
            self._gated += not used
            self._look(sighting)

    def _look(self, sighting: Sighting) -> None:
        """Whether the fixes are late, once a minute."""
        self._seen.append(sighting)
        self._unlooked += 1
        if self._unlooked >= LOOK_EVERY:
            self._unlooked = 0
            found = lateness(self._seen, self.config)
            self._lateness = found if found is not None and found.sure else None

    def _take(self, sighting: Sighting) -> bool:
        if self._bank is not None:
            return self._bank.follow(sighting)
        alignment = self._search.add(sighting)
        if alignment is not None:
            self._bank = self._search.bank(alignment)
        return True


def pose_from(
    estimate: OdometryEstimate, mean: Array, covariance: Array, seen_from_m: Array, drifted: Array
) -> GlobalPose:
    """An estimate in `map` by a belief (mean, covariance) whose antenna was at `seen_from_m` (3,) in `odom`.

    drifted: (4,) variance of x, y, z, yaw that the odometry gathered in between.
    """
    yaw = float(mean[YAW])
    arm = turned(yaw, estimate.position_m - seen_from_m)
    turn = np.column_stack([turned(yaw, axis) for axis in np.eye(3)])
    jacobian = _levered(arm)
    placed = jacobian @ (covariance[:4, :4] + np.diag(drifted)) @ jacobian.T
    rotation = turn @ estimate.rotation
    full = np.zeros((6, 6))
    full[:3, :3] = placed[:3, :3]
    up = rotation[2]
    # The yaw turns about up, which the body sees along `up`; roll and pitch are as good as the odometry says.
    full[3:, 3:] = placed[3, 3] * np.outer(up, up) + _without(estimate.covariance[3:, 3:], up)
    full[:3, 3:] = np.outer(placed[:3, 3], up)
    full[3:, :3] = full[:3, 3:].T
    return GlobalPose(estimate.stamp_ns, mean[:3] + arm, rotation, full)


def _levered(arm: Array) -> Array:
    """(4, 4) Jacobian of a point at `arm` (in `map`) from one whose x, y, z, yaw are known."""
    jacobian = np.eye(4)
    jacobian[0, 3], jacobian[1, 3] = -arm[1], arm[0]
    return jacobian


def _without(covariance: Array, axis: Array) -> Array:
    """A covariance (3, 3) of rotation with what lies along `axis` (3,) taken out."""
    keep = np.eye(3) - np.outer(axis, axis)
    return np.asarray(keep @ covariance @ keep)
