"""As much of H.264 (ITU-T H.264, Annex B and 7.4.1) as a recorder needs: where NAL units start and what they are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

SLICE, SLICE_IDR, SPS, PPS = 1, 5, 7, 8
_START = b"\x00\x00\x01"


@dataclass(frozen=True, slots=True)
class UnitKind:
    """What an access unit begins with."""

    idr: bool
    sps: bool
    pps: bool

    @property
    def entry(self) -> bool:
        """A decoder can start here, knowing nothing."""
        return self.idr and self.sps and self.pps


def nal_types(data: bytes) -> Iterator[int]:
    """NAL unit types in order."""
    at = data.find(_START)
    while at >= 0 and at + 3 < len(data):
        yield data[at + 3] & 0x1F
        at = data.find(_START, at + 3)


def nals(data: bytes) -> Iterator[bytes]:
    """NAL units in order, without their start codes."""
    at = data.find(_START)
    while at >= 0:
        end = data.find(_START, at + 3)
        nal = data[at + 3 : end if end >= 0 else len(data)]
        if nal:
            yield nal
        at = end


def parameter_sets(data: bytes) -> bytes:
    """The SPS and PPS of an access unit, in Annex B."""
    return b"".join(_START + nal for nal in nals(data) if nal[0] & 0x1F in (SPS, PPS))


def kind(data: bytes) -> UnitKind:
    """Look at the NAL units up to the first slice: parameter sets stand before it (7.4.1.2.3)."""
    seen: set[int] = set()
    for nal in nal_types(data):
        seen.add(nal)
        if SLICE <= nal <= SLICE_IDR:
            break
    return UnitKind(SLICE_IDR in seen, SPS in seen, PPS in seen)
