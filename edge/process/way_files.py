"""Products of every session: the way, how well it is known, and the fixes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.messages import QUALITY_NAMES, GnssFix
from edge.process.product_facts import Shelf
from pipeline.gnss.geodesy import Datum
from pipeline.products.covariance import PoseTable, write_covariance
from pipeline.products.fixes import write_fixes
from pipeline.products.kml import write_kml
from pipeline.products.occurrences import Columns, Survey
from pipeline.products.page import Story, write_page
from pipeline.products.track import Placement
from pipeline.products.tum import write_tum
from pipeline.products.vector import add_styles, write_way


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """Where the session went. poses: in the frame of the placement, or in `odom`."""

    track: npt.NDArray[np.void]
    placement: Placement | None
    poses: PoseTable
    survey: Survey
    fixes: Sequence[GnssFix]


def write_way_files(shelf: Shelf, walk: Walk) -> None:
    """Everything but the map."""
    track, survey = walk.track, walk.survey
    with shelf.put("trajectory_odom.tum", "base_link in odom: smooth, drifts") as path:
        write_tum(path, track["stamp_ns"], track["position_m"], track["rotation"])
    if walk.placement is not None and survey.site is None:
        with shelf.put("trajectory_local.tum", "base_link in local: refined, metres from the start") as path:
            write_tum(path, track["stamp_ns"], *walk.placement.poses(track))
    if walk.placement is not None and survey.site is not None:
        with shelf.put("trajectory.tum", "base_link in map: ENU at the datum") as path:
            write_tum(path, track["stamp_ns"], *walk.placement.poses(track))
        with shelf.put("trajectory.gpkg", f"track and poses in EPSG:{survey.site.epsg}, for QGIS") as path:
            write_way(path, survey, pose_columns(walk.poses), way_facts(walk))
            add_styles(path)
        with shelf.put("trajectory.kml", "the way, for Google Earth") as path:
            write_kml(path, survey)
    with shelf.put("covariance.csv", f"sigmas of every pose in {walk.poses.frame}") as path:
        write_covariance(path, walk.poses)
    if walk.fixes:
        with shelf.put("gnss.csv", "every GNSS fix, WGS 84 with heights above the ellipsoid") as path:
            write_fixes(path, walk.fixes)
    with shelf.put("trajectory.html", "plots, readable offline") as path:
        write_page(path, _story(shelf, walk))


def pose_columns(poses: PoseTable) -> Columns:
    """Of the layer `poses`."""
    return {
        "travelled_m": poses.travelled_m,
        "speed_m_s": poses.speed_m_s,
        "sigma_horizontal_m": poses.horizontal_sigma_m,
        "sigma_vertical_m": poses.sigmas[:, 2],
        "degenerate": poses.degenerate,
    }


def way_facts(walk: Walk) -> dict[str, str | float]:
    """Of the layer `track`."""
    kinds = Counter(QUALITY_NAMES[fix.quality] for fix in walk.fixes)
    shares = ", ".join(f"{name} {count / len(walk.fixes):.0%}" for name, count in kinds.most_common())
    sigma = walk.poses.horizontal_sigma_m
    return {
        "fix_types": shares or "no fixes",
        "sigma_rms_m": float(np.sqrt(np.mean(sigma**2))),
        "sigma_worst_m": float(sigma.max()),
        "observer": walk.survey.observer,
        "heights": walk.survey.geoid.words,
    }


def _story(shelf: Shelf, walk: Walk) -> Story:
    facts = shelf.facts
    fixes_m = np.empty((0, 3))
    if walk.placement is not None and walk.placement.datum is not None:
        datum = Datum(*walk.placement.datum)
        fixes_m = np.array([datum.enu(fix.latitude_deg, fix.longitude_deg, fix.height_m) for fix in walk.fixes])
    shown = {
        "travelled": f"{facts.travelled_m:,.1f} m",
        "duration": f"{facts.duration_s:,.0f} s",
        "sweeps": f"{facts.estimates:,} of {facts.sweeps:,}",
        "degenerate": f"{facts.degenerate / max(facts.estimates, 1):.1%}",
        "sigma at the end": f"{facts.sigma_end_m:.2f} m",
        "frame": facts.crs,
    }
    title = f"Trajectory of {facts.session}"
    return Story(title, walk.poses, walk.fixes, fixes_m.reshape(-1, 3), shown, facts.notes)
