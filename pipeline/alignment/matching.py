"""Which layers two scenes share."""

from __future__ import annotations

import numpy as np

from pipeline.alignment.config import AlignmentConfig
from pipeline.alignment.fields import crown_field, stem_density
from pipeline.alignment.grid import Array
from pipeline.alignment.layers import Layer, layer
from pipeline.alignment.scene import Scene

STEMS, CANOPY, RELIEF = "stems", "canopy", "relief"
LEAST_CELLS = 400


def shared_layers(fixed: Scene, moved: Scene, config: AlignmentConfig) -> list[Layer]:
    """Stems against crown tops (or stems), canopy against canopy, ground against ground, where both have them."""
    cell, found = config.cell_m, []
    if moved.stems_m is not None and len(moved.stems_m):
        fixed_field, known = (
            answer_to_stems(fixed, config),
            fixed.looked if fixed.stems_m is not None else fixed.covered,
        )
        density = stems_field(moved, config)
        found.append(layer(STEMS, (fixed_field, known), (density, moved.looked), cell, same_scale=False))
    if fixed.canopy_m is not None and moved.canopy_m is not None:
        fields = (fixed.canopy_m, fixed.covered), (moved.canopy_m, moved.covered)
        found.append(layer(CANOPY, *fields, cell, same_scale=False))
    if fixed.terrain_m is not None and moved.terrain_m is not None:
        # The ground is filled in where nothing was seen: only where something was it may speak.
        fields = (fixed.terrain_m, fixed.covered), (moved.terrain_m, moved.looked)
        found.append(layer(RELIEF, *fields, cell, same_scale=True))
    return [one for one in found if one.seen.sum() >= LEAST_CELLS and one.known.any()]


def answer_to_stems(fixed: Scene, config: AlignmentConfig) -> Array:
    """Crown tops of an aerial scene, the stems themselves of a terrestrial one."""
    if fixed.stems_m is not None:
        return stems_field(fixed, config)
    assert fixed.canopy_m is not None
    return crown_field(fixed.canopy_m, config.cell_m, config.log_scales_m, config.lobe)


def stems_field(scene: Scene, config: AlignmentConfig) -> Array:
    """Equation 3, each stem with its weight."""
    assert scene.stems_m is not None
    assert scene.weights is not None
    return np.asarray(stem_density(scene.stems_m, scene.weights, scene.grid, config.kernel_m))
