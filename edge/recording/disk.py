"""The few disk operations a recording needs, in one place, so that tests can stall, fill and break the disk."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Space:
    """Room on a file system; `free_bytes` is what a normal user may take."""

    total_bytes: int
    free_bytes: int


class DiskFile:
    """A new file, written at its end only and without a buffer: what was written is the kernel's."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o640)
        self._size = 0

    def write(self, data: bytes) -> int:
        """Write all of `data`, or raise OSError."""
        left = memoryview(data)
        while left:
            count = os.write(self._descriptor, left)
            self._size += count
            left = left[count:]
        return len(data)

    def tell(self) -> int:
        return self._size

    def flush(self) -> None:
        """Nothing is held back here; the MCAP writer asks for it."""

    def sync(self) -> None:
        """Return when the bytes are on the medium (fdatasync: size included, times not)."""
        os.fdatasync(self._descriptor)

    def close(self) -> None:
        """Idempotent."""
        if self._descriptor >= 0:
            descriptor, self._descriptor = self._descriptor, -1
            os.close(descriptor)


class Disk:
    """The real one."""

    def create(self, path: Path) -> DiskFile:
        return DiskFile(path)

    def make_folder(self, folder: Path) -> None:
        """A folder that does not exist yet, parents as needed."""
        folder.mkdir(parents=True, exist_ok=False)
        self.sync_folder(folder.parent)

    def rename(self, old: Path, new: Path) -> None:
        """Rename, and return when the new name is on the medium."""
        old.rename(new)
        self.sync_folder(new.parent)

    def sync_folder(self, folder: Path) -> None:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def replace(self, path: Path, content: bytes) -> None:
        """Write a small file so that after a power cut either the old or the new one is there, whole."""
        temporary = path.with_name(path.name + ".new")
        temporary.unlink(missing_ok=True)
        file = self.create(temporary)
        try:
            file.write(content)
            file.sync()
        finally:
            file.close()
        self.rename(temporary, path)

    def allocate(self, path: Path, size_bytes: int) -> None:
        """A file that only holds its place."""
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o640)
        try:
            os.posix_fallocate(descriptor, 0, size_bytes)
        finally:
            os.close(descriptor)

    def remove(self, path: Path) -> None:
        """Remove a file if it can be removed."""
        with suppress(OSError):
            path.unlink(missing_ok=True)

    def space(self, folder: Path) -> Space:
        facts = os.statvfs(folder)
        return Space(facts.f_blocks * facts.f_frsize, facts.f_bavail * facts.f_frsize)

    def on_own_mount(self, folder: Path) -> bool:
        """Whether `folder` lies below a mount point other than the root (the card is there)."""
        resolved = folder.resolve()
        return any(place.is_mount() for place in (resolved, *resolved.parents) if place != Path(resolved.anchor))


def floor_bytes(space: Space, min_free_mib: int, min_free_percent: float) -> int:
    """Free room at which recording stops, so that the system and the end of the file have a place."""
    return max(min_free_mib << 20, int(space.total_bytes * min_free_percent / 100))
