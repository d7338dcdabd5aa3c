"""What the pipeline hands back, as msgpack: poses and detections to be recorded, and its state for the operator."""

from __future__ import annotations

from typing import Any, TypeAlias

import msgspec

from edge.control.messages import Detecting, Location, Mapped
from edge.errors import FormatError
from edge.recording.messages import Detections, GnssPose, OdometryPose, Transforms

Result: TypeAlias = OdometryPose | GnssPose | Transforms | Detections | Location | Detecting | Mapped
_KINDS: dict[str, type[Any]] = {
    kind.__name__: kind for kind in (OdometryPose, GnssPose, Transforms, Detections, Location, Detecting, Mapped)
}


def packed(result: Result) -> list[bytes]:
    """Kind and content."""
    return [type(result).__name__.encode(), msgspec.msgpack.encode(result)]


def unpacked(parts: list[bytes]) -> Result:
    """FormatError for what is no result."""
    kind = _KINDS.get(parts[0].decode("ascii", "replace")) if len(parts) == 2 else None
    if kind is None:
        raise FormatError(f"not a result of the pipeline: {parts[0][:40]!r}")
    try:
        result: Result = msgspec.msgpack.decode(parts[1], type=kind)
    except msgspec.MsgspecError as error:
        raise FormatError(f"a {kind.__name__} of the pipeline cannot be read: {error}") from error
    return result
