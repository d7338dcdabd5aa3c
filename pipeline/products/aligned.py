"""Everything that is handed out of an alignment."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from pipeline.alignment.cloud import Batch, batches
from pipeline.alignment.result import ALIGNED, FILE, Result, write_result
from pipeline.alignment.task import Done, Stage
from pipeline.products.alignment_page import alignment_page, views
from pipeline.products.merged_laz import Merged, write_merged
from pipeline.products.moved_tables import move_table

PAGE, MERGED = "alignment.html", "merged.laz"


def write_aligned(
    folder: Path, done: Done, found: Result, tables: Sequence[Path], stage: Stage, *, merge: bool
) -> dict[str, str]:
    """File -> what it is. What was moved by an earlier run is taken away first: it must not outlive its verdict."""
    folder.mkdir(parents=True, exist_ok=True)
    moved = {
        table: folder / f"{table.stem}_aligned{'.csv' if table.suffix.lower() == '.csv' else '.gpkg'}"
        for table in tables
    }
    for stale in (folder / MERGED, *moved.values()):
        stale.unlink(missing_ok=True)
    shown = views(done)
    files = {FILE: "transform, covariance and verdict", PAGE: "both maps over each other, before and after"}
    for view in shown:
        name = f"fields_{view.name}_{view.when}.png"
        (folder / name).write_bytes(view.png)
        files[name] = f"{view.title.lower()}, {view.when}"
    write_result(folder / FILE, found)
    (folder / PAGE).write_text(alignment_page(done, found, shown), encoding="utf-8")
    if found.verdict != ALIGNED:
        return files
    for table, into in moved.items():
        count = move_table(table, into, done.placed, done.alignment.transform)
        files[into.name] = f"{count:,} places of {table.name}, moved"
    if merge and done.placed.cloud.path.suffix.lower() not in {".csv", ".txt"}:
        count = write_merged(folder / MERGED, _merged(done, found), stage("merging"))
        files[MERGED] = f"both maps, {count:,} points with their source"
    return files


def _merged(done: Done, found: Result) -> Merged:
    about = (
        f"{done.aerial.path.name} and {done.placed.cloud.path.name}; the ground map moved by {found.x_m:+.3f} m, "
        f"{found.y_m:+.3f} m, {found.z_m or 0.0:+.3f} m and {found.yaw_deg:+.3f} degrees about {found.pivot_m}"
    )
    return Merged(
        aerial=batches(done.aerial),
        terrestrial=_moved(done),
        crs=done.placed.fixed_crs,
        near_m=done.fixed.grid.middle_m,
        count=done.aerial.count + done.placed.cloud.count,
        about=about,
    )


def _moved(done: Done) -> Iterator[Batch]:
    for batch in done.placed.batches():
        yield replace(batch, xyz_m=done.alignment.transform.apply(batch.xyz_m))
