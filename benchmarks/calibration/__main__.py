"""The table of docs/calibration.md: what each step finds on simulated scenes, against the truth.

    python -m benchmarks.calibration [time] [lens] [board] [scene] [--seeds 1 2 3 4 5] [--forests demo plantation]

in sigma: error over the sigma that was told; NEES: squared error over the covariance, 1 is honest.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.calibration import forest
from pipeline.calibration.board import Sighting, find
from pipeline.calibration.board_extrinsics import from_board
from pipeline.calibration.errors import CalibrationError
from pipeline.calibration.extrinsics import Extrinsics, Found
from pipeline.calibration.image_turning import turning_of
from pipeline.calibration.lens import fit_lens
from pipeline.calibration.offset import find_offset
from pipeline.calibration.scene_extrinsics import Stand, from_scene
from tests.pipeline.calibration import boards, rooms

LATE_S = 0.0834
SECONDS = 20.0
PLACES = 6


def time_offset(seed: int, name: str) -> Iterator[str]:
    """A walk; the camera is late."""
    pictures, gyro = forest.walk(forest.world(name, seed), 5.0, SECONDS, LATE_S)
    found = find_offset(turning_of(pictures, forest.LENS), gyro)
    error_s = -found.later_s - LATE_S
    mounted = Rotation.from_matrix(found.rotation @ forest.CAMERA.rotation)
    yield (
        f"| time | {name} {seed} | {1e3 * error_s:+.2f} ms | {1e3 * found.sigma_s:.2f} ms | "
        f"{abs(error_s) / found.sigma_s:.1f} in sigma, correlation {found.correlation:.3f} (else {found.rival:.2f}), "
        f"rotation in passing {np.degrees(mounted.magnitude()):.2f} deg | {found.refusal or 'told'} |"
    )


def lens(seed: int, _: str) -> Iterator[str]:
    """Thirty rendered photographs of a board."""
    for camera in (boards.PINHOLE, boards.FISHEYE):
        seen: list[Sighting] = []
        for turn, move in boards.poses(300, seed=seed):
            if camera.project(turn.apply(boards.CHESS.corners_m) + move)[1].all():
                photo = boards.photograph(boards.CHESS, camera, turn, move)
                seen += filter(None, [find(boards.CHESS, "", photo)])
            if len(seen) == 30:
                break
        found = fit_lens(seen, (camera.width_px, camera.height_px), camera.model)
        focal = max(abs(np.array(found.camera.focal_px) / camera.focal_px - 1.0))
        rays = camera.rays(np.stack(np.meshgrid([100.0, 424.0, 748.0], [60.0, 240.0, 420.0]), axis=-1).reshape(-1, 2))
        off = np.linalg.norm(found.camera.project(rays)[0] - camera.project(rays)[0], axis=1)
        yield (
            f"| lens | {camera.model} {seed} | focal {focal:.3%}, image {off.max():.2f} px at worst | halves apart "
            f"{found.focal_apart:.3%} | {found.rms_px:.3f} px RMS | {'; '.join(found.concerns) or 'told'} |"
        )


def board(seed: int, _: str) -> Iterator[str]:
    """Twelve poses in a room, with a hand in the way."""
    for camera in (boards.PINHOLE, boards.FISHEYE):
        found = from_board(rooms.holds(camera, 12, seed), rooms.BOARD, camera, rooms.guess(seed))
        yield _pose("board", f"{camera.model} {seed}", found, rooms.TRUE, f"{1e3 * found.residual_m:.1f} mm RMS")


def scene(seed: int, name: str) -> Iterator[str]:
    """Six places in a forest; the same with pictures of other places; and one place alone."""
    stands = forest.stands(forest.world(name, seed), PLACES)
    mixed = [Stand(stands[k - 1].image_bgr, stand.points_m) for k, stand in enumerate(stands)]
    for what, some in ((f"{PLACES} places", stands), ("1 place", stands[:1]), ("wrong pictures", mixed)):
        begin_s = time.process_time()
        try:
            found = from_scene(some, forest.LENS, forest.guess(seed))
        except CalibrationError as error:
            yield f"| scene | {name} {seed}, {what} | - | - | - | {error} |"
            continue
        more = f"contrast {found.standout:.1f}, {found.agreed:.0%} agree, {time.process_time() - begin_s:.0f} s of CPU"
        yield _pose("scene", f"{name} {seed}, {what}", found, forest.TRUE, more)


def _pose(step: str, what: str, found: Found, true: Extrinsics, more: str) -> str:
    error = found.extrinsics.step_from(true)
    away_m = np.linalg.norm(found.extrinsics.camera_m - true.camera_m)
    nees = error @ np.linalg.solve(found.covariance, error) / 6.0
    sure = f"{found.rotation_sigma_deg:.2f} deg, {100 * found.translation_sigma_m:.1f} cm | NEES {nees:.2f}, "
    if found.refusal:
        sure = "- | "
    away = f"{np.degrees(np.linalg.norm(error[:3])):.2f} deg, {100 * away_m:.1f} cm"
    return f"| {step} | {what} | {away} | {sure}{more} | {found.refusal.partition(':')[0] or 'told'} |"


STEPS = {"time": time_offset, "lens": lens, "board": board, "scene": scene}


def main() -> None:
    """Print the table, a row as soon as it is there."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.calibration")
    parser.add_argument("steps", nargs="*", choices=[*STEPS, []], help="default: all")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--forests", nargs="+", default=["demo"], help="scenarios, for time and scene")
    args = parser.parse_args()
    print("| step | scene | error | told | | verdict |\n| --- | --- | --- | --- | --- | --- |")
    for step in args.steps or STEPS:
        for name in args.forests if step in {"time", "scene"} else [""]:
            for seed in args.seeds:
                for row in STEPS[step](seed, name):
                    print(row, flush=True)


if __name__ == "__main__":
    main()
