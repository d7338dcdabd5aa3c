"""How well the session knows where it was."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from edge.report.made import Made
from edge.validation.report import GnssShare
from pipeline.evaluation.trajectory import Trajectory
from pipeline.products import sheet
from pipeline.products.page import TIME, certainty, movement, quality
from pipeline.products.plots import Line, Plot

Array = npt.NDArray[np.float64]


def gnss_parts(made: Made | None, share: GnssShare | None, start_ns: int) -> Iterator[str]:
    """The receiver over time."""
    yield sheet.section("GNSS")
    if share is None:
        yield sheet.words("There is no GNSS in the recording.")
        return
    kinds = ", ".join(f"{name} {count / share.epochs:.0%}" for name, count in share.qualities.items())
    yield sheet.words(f"{share.epochs:,} epochs: {kinds} ({share.source}).")
    fixes = made.fixes if made is not None else []
    if not fixes:
        return
    seconds = np.array([(fix.stamp_ns - start_ns) / 1e9 for fix in fixes])
    sigma = np.array([fix.sigma_enu_m for fix in fixes]).reshape(-1, 3)
    claimed = [
        Line(seconds, np.hypot(sigma[:, 0], sigma[:, 1]), "horizontal"),
        Line(seconds, sigma[:, 2], "vertical", "c"),
    ]
    satellites = Line(seconds, np.array([float(fix.satellites) for fix in fixes]), "")
    yield sheet.figure("Quality of the fixes", quality(fixes, start_ns))
    plot = Plot(TIME, "sigma, m", claimed, from_zero=True, height=150)
    yield sheet.figure("What the receiver says of its errors (one sigma, m)", plot, "Under trees it says too little.")
    if satellites.y.any():
        yield sheet.figure("Satellites", Plot(TIME, "satellites", [satellites], from_zero=True, height=130))


def location_parts(made: Made | None, start_ns: int) -> Iterator[str]:
    """What odometry and fusion say of themselves."""
    if made is None:
        return
    yield sheet.section("Where it was, and how well that is known")
    for title, plot in certainty(made.poses, start_ns):
        yield sheet.figure(title, plot)
    if made.placed is not None and len(made.placed.stamps_ns) == len(made.odom.stamps_ns):
        seconds = (made.odom.stamps_ns - start_ns) / 1e9
        across, up = drift(made.odom, made.placed)
        lines = [Line(seconds, across, "horizontal"), Line(seconds, up, "vertical", "c")]
        yield sheet.figure(
            "Drift of the odometry, m",
            Plot(TIME, "m", lines),
            "The way by LiDAR and IMU alone, laid over the map at its start: how far GNSS had to take it back.",
        )
    for title, plot in movement(made.poses, start_ns):
        yield sheet.figure(title, plot)


def drift(odom: Trajectory, placed: Trajectory) -> tuple[Array, Array]:
    """(n,) horizontal distance, and (n,) height of the one above the other, when the first poses are laid together."""
    turn = placed.rotations[0] @ odom.rotations[0].T
    yaw = np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
    level = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    laid = odom.moved(level, placed.positions_m[0] - level @ odom.positions_m[0])
    away = laid.positions_m - placed.positions_m
    return np.hypot(away[:, 0], away[:, 1]), away[:, 2]
