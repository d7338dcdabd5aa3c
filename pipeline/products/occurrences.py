"""The table of what was found, one row a tree, in the words that databases of invasive species import.

Names after NAISMA's mapping standards and Darwin Core (docs/products.md says what each means).
"""

from __future__ import annotations

import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.products.earth import Site
from pipeline.products.findings import Findings, Model
from pipeline.products.geoid import Geoid
from pipeline.trees import Tree

Array = npt.NDArray[np.float64]
Columns = dict[str, npt.NDArray[Any]]
RADIUS_95 = float(np.sqrt(-2.0 * np.log(0.05)))
"""Sigmas of the circle that holds 95 % of a round Gaussian (Rayleigh)."""
UNVERIFIED = (
    "Detections of a machine that nobody has verified. They are no occurrence reports: look at the picture, go there, "
    "and set verification_status before anything is reported or treated."
)
DEMONSTRATION = "demonstration model, made from simulated images: not evidence of anything real"
_PROTOCOL = "camera ray on a LiDAR map located by LiDAR-inertial odometry and GNSS"
_NAMESPACE = uuid.UUID("6f2bb1a2-4f6e-4f0b-9a55-0c8f0a6f2d11")
_AILANTHUS = {"ailanthus", "ailanthus altissima", "tree of heaven"}


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """What the session is to those who import findings.

    stamps_ns: (n,), positions_m: (n, 3) the way in the frame of the trees. site: None for a session that nobody could
    place on the Earth.
    """

    session: str
    observer: str
    organization: str
    stamps_ns: npt.NDArray[np.int64]
    positions_m: Array
    site: Site | None
    geoid: Geoid

    @property
    def start(self) -> str:
        """ISO 8601."""
        return utc(int(self.stamps_ns[0]))

    @property
    def end(self) -> str:
        """ISO 8601."""
        return utc(int(self.stamps_ns[-1]))


def occurrences(findings: Findings, survey: Survey) -> Columns:
    """Columns (n,), in order of the trees. Text is empty and numbers are NaN where nothing is known."""
    trees = findings.trees
    return {
        **_identity(trees, findings, survey),
        **_measures(trees),
        **_time(trees, survey),
        **_whereabouts(findings, survey),
        **_provenance(trees, findings, survey),
    }


def chip_name(tree: Tree, session: str) -> str:
    """Below DCIM: QField synchronises no other folder."""
    return f"DCIM/{session}_tree_{tree.tree_id:04d}.jpg"


def species(class_name: str) -> tuple[str, str]:
    """Scientific and common name. A class of another model keeps its own name, with no scientific one."""
    plain = class_name.lower().replace("_", " ").replace("-", " ").strip()
    return ("Ailanthus altissima", "tree-of-heaven") if plain in _AILANTHUS else ("", class_name)


def utc(stamp_ns: int) -> str:
    """ISO 8601 to the second."""
    return f"{datetime.fromtimestamp(stamp_ns // 1_000_000_000, timezone.utc):%Y-%m-%dT%H:%M:%SZ}"


def text(values: list[str]) -> npt.NDArray[Any]:
    """A column of text, also of none."""
    return np.array(values, dtype=object).reshape(len(values))


def _identity(trees: Sequence[Tree], findings: Findings, survey: Survey) -> Columns:
    # The first sighting belongs to the name: after another run the same number may be another tree.
    names = [f"{survey.session}/{tree.tree_id}/{tree.first_ns}" for tree in trees]
    return {
        "uuid": text([str(uuid.uuid5(_NAMESPACE, name)) for name in names]),
        "source_id": text([f"{survey.session}#{tree.tree_id}" for tree in trees]),
        "tree_id": np.array([tree.tree_id for tree in trees], np.int32),
        "scientific_name": text([species(tree.class_name)[0] for tree in trees]),
        "common_name": text([species(tree.class_name)[1] for tree in trees]),
        "occurrence_status": text(["present"] * len(trees)),
        "basis_of_record": text(["MachineObservation"] * len(trees)),
        "verification_status": text(["unverified"] * len(trees)),
        "crop": text([chip_name(tree, survey.session) if tree.tree_id in findings.chips else "" for tree in trees]),
    }


def _measures(trees: Sequence[Tree]) -> Columns:
    crown = np.array([tree.crown_m for tree in trees], np.float64)
    return {
        "probability": np.array([tree.probability for tree in trees], np.float64).round(4),
        "confidence_max": np.array([_best_confidence(tree) for tree in trees], np.float64).round(4),
        "n_views": np.array([tree.views for tree in trees], np.int32),
        "n_hits": np.array([tree.hits for tree in trees], np.int32),
        "n_points": np.array([tree.points for tree in trees], np.int32),
        "stem_seen": np.array([tree.stem_seen for tree in trees], bool),
        "height_m": np.array([tree.height_m for tree in trees], np.float64).round(1),
        "crown_m": crown.round(1),
        "infested_area_m2": (np.pi / 4.0 * crown**2).round(1),
        "organism_quantity": np.ones(len(trees), np.int32),
        "abundance": text(["Single plant"] * len(trees)),
    }


def _time(trees: Sequence[Tree], survey: Survey) -> Columns:
    return {
        "event_date": text([utc(tree.first_ns) for tree in trees]),
        "event_end": text([utc(tree.last_ns) for tree in trees]),
        "observer": text([survey.observer] * len(trees)),
        "organization": text([survey.organization] * len(trees)),
    }


def _whereabouts(findings: Findings, survey: Survey) -> Columns:
    positions = findings.positions_m
    sigma = np.array([tree.sigma_m for tree in findings.trees], np.float64)
    away, along = _from_the_way(positions, survey.positions_m)
    known = {
        "sigma_m": sigma.round(3),
        "coordinate_uncertainty_m": (RADIUS_95 * sigma).round(2),
        "from_track_m": away.round(1),
        "along_track_m": along.round(1),
    }
    site = survey.site
    if site is None:
        x, y, z = positions.T.round(3)
        return {"x_m": x, "y_m": y, "z_m": z, **known}
    longitude, latitude, height = site.geodetic(positions).T
    easting, northing, _ = site.utm(positions).T
    return {
        "latitude": latitude.round(8),
        "longitude": longitude.round(8),
        "ellipsoidal_height_m": height.round(2),
        "elevation_m": (height - survey.geoid.undulation_m).round(2),
        "easting": easting.round(3),
        "northing": northing.round(3),
        "epsg": np.full(len(positions), site.epsg, np.int32),
        **known,
    }


def _from_the_way(positions: Array, way: Array) -> tuple[Array, Array]:
    """(n,) metres from the nearest pose on the ground, and metres of way up to it."""
    if not len(way):
        return np.full(len(positions), np.nan), np.full(len(positions), np.nan)
    steps = np.linalg.norm(np.diff(way[:, :2], axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    nearest = [int(np.argmin(np.sum((way[:, :2] - position[:2]) ** 2, axis=1))) for position in positions]
    return np.linalg.norm(way[nearest, :2] - positions[:, :2], axis=1), travelled[nearest]


def _provenance(trees: Sequence[Tree], findings: Findings, survey: Survey) -> Columns:
    return {
        "georef_protocol": text([_PROTOCOL if survey.site else "none: local coordinates"] * len(trees)),
        "run_id": text([survey.session] * len(trees)),
        "model": text([findings.model.name] * len(trees)),
        "model_sha256": text([findings.model.sha256] * len(trees)),
        "comments": text([_comment(tree, findings.model) for tree in trees]),
    }


def _comment(tree: Tree, model: Model) -> str:
    said = [DEMONSTRATION] if model.demonstration else []
    if not tree.stem_seen:
        said.append("stem not seen: the position is below the middle of the crown")
    return "; ".join(said)


def _best_confidence(tree: Tree) -> float:
    return max((view.confidence for view in tree.best), default=np.nan)
