"""Whether a picture leans on one that never came: by `frame_num`, which counts reference pictures (ITU-T H.264, 7.4.3).

A decoder says nothing about such a hole; it goes on with the wrong reference, and smears.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.gopro.h264 import SLICE, SLICE_IDR, SPS, nals

_HEADER = 32
"""Bytes of a slice that hold the fields needed here."""
_CHROMA_PROFILES = frozenset({100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135})
_SEPARATE = 3
"""chroma_format_idc of 4:4:4."""


@dataclass(frozen=True, slots=True)
class _Sequence:
    """Of the sequence parameter set. bits: of frame_num. holes: the encoder leaves numbers out on purpose."""

    bits: int
    holes: bool
    planes_apart: bool


class References:
    """Follows one stream of access units in decoding order; starts, and starts again, at any of them."""

    def __init__(self) -> None:
        self._sequence: _Sequence | None = None
        self._last: int | None = None
        """frame_num of the last reference picture."""

    def miss(self, unit: bytes) -> bool:
        """Whether reference pictures are missing between the last unit and this one (Annex B). Never raises."""
        for nal in nals(unit):
            kind = nal[0] & 0x1F
            try:
                if kind == SPS:
                    self._sequence = _sequence(_Bits(nal[1:]))
                elif kind in (SLICE, SLICE_IDR):
                    return self._picture(nal, idr=kind == SLICE_IDR)
            except EOFError:
                return False  # the decoder will judge what is cut off
        return False

    def _picture(self, nal: bytes, *, idr: bool) -> bool:
        sequence, last = self._sequence, self._last
        if sequence is None:
            return False
        bits = _Bits(nal[1 : 1 + _HEADER])
        for _ in range(3):  # first_mb_in_slice, slice_type, pic_parameter_set_id
            bits.exp_golomb()
        if sequence.planes_apart:
            bits.take(2)
        number = bits.take(sequence.bits)
        if nal[0] & 0x60:  # nal_ref_idc: later pictures may lean on it
            self._last = number
        if idr or last is None or sequence.holes:
            return False
        return number not in (last, (last + 1) % (1 << sequence.bits))


def _sequence(bits: _Bits) -> _Sequence:
    """seq_parameter_set_data(), 7.3.2.1.1, up to gaps_in_frame_num_value_allowed_flag."""
    profile = bits.take(8)
    bits.take(16)  # constraints, level_idc
    bits.exp_golomb()
    apart = _chroma(bits) if profile in _CHROMA_PROFILES else False
    number_bits = bits.exp_golomb() + 4
    order = bits.exp_golomb()
    if order == 0:
        bits.exp_golomb()
    elif order == 1:
        bits.take(1)
        bits.exp_golomb()
        bits.exp_golomb()
        for _ in range(bits.exp_golomb()):
            bits.exp_golomb()
    bits.exp_golomb()  # max_num_ref_frames
    return _Sequence(number_bits, bits.take(1) == 1, apart)


def _chroma(bits: _Bits) -> bool:
    """Whether the colour planes are coded apart."""
    chroma = bits.exp_golomb()
    apart = chroma == _SEPARATE and bits.take(1) == 1
    bits.exp_golomb()
    bits.exp_golomb()
    bits.take(1)
    if bits.take(1):
        for index in range(12 if chroma == _SEPARATE else 8):
            if bits.take(1):
                _skip_scaling(bits, 16 if index < 6 else 64)
    return apart


def _skip_scaling(bits: _Bits, size: int) -> None:
    last = following = 8
    for _ in range(size):
        if following:
            code = bits.exp_golomb()
            following = (last + ((code + 1) // 2 if code % 2 else -(code // 2))) % 256
        last = following or last


class _Bits:
    """Bits of a NAL unit's payload, its emulation prevention taken out. EOFError past the end."""

    def __init__(self, payload: bytes) -> None:
        raw = payload.replace(b"\x00\x00\x03", b"\x00\x00")
        self._value = int.from_bytes(raw, "big")
        self._left = 8 * len(raw)

    def take(self, count: int) -> int:
        """An unsigned number."""
        if count > self._left:
            raise EOFError
        self._left -= count
        return (self._value >> self._left) & ((1 << count) - 1)

    def exp_golomb(self) -> int:
        """ue(v), 9.1."""
        zeros = 0
        while not self.take(1):
            zeros += 1
        return (1 << zeros) - 1 + self.take(zeros)
