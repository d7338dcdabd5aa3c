"""What a GoPro leaves on its card, from the bytes up: GPMF payloads, and MP4 files that hold nothing else."""

import struct
from pathlib import Path

import numpy as np

SCALE = 3755


def key(name: str, kind: str, size: int, count: int, data: bytes) -> bytes:
    """One key of GPMF, padded. kind: "" for nested keys."""
    letter = ord(kind) if kind else 0
    return struct.pack(">4sBBH", name.encode(), letter, size, count) + data + bytes(-len(data) % 4)


def nested(name: str, *inside: bytes) -> bytes:
    data = b"".join(inside)
    return key(name, "", 1, len(data), data)


def stream(name: str, body: bytes, first_us: int | None, total: int) -> bytes:
    clock = [] if first_us is None else [key("STMP", "J", 8, 1, struct.pack(">Q", first_us))]
    return nested(
        "STRM", *clock, key("TSMP", "L", 4, 1, struct.pack(">L", total)), key("STNM", "c", 4, 1, b"what"), body
    )


def gyro_payloads(at_s: np.ndarray, rate: np.ndarray, *, clock: bool = True, zero_us: int = 85_600) -> list[bytes]:
    """One a second, of samples at_s after the first frame, whose clock reading is zero_us."""
    made = []
    for second in range(int(np.ceil(at_s[-1]))):
        rows = np.flatnonzero((at_s >= second) & (at_s < second + 1))
        if not len(rows):
            continue
        words = np.rint(rate[rows] * SCALE).astype(">i2")
        first = round(at_s[rows[0]] * 1e6) + zero_us if clock else None
        body = key("SCAL", "s", 2, 1, struct.pack(">h", SCALE)) + key("GYRO", "s", 6, len(rows), words.tobytes())
        frame = round(second * 1e6) + zero_us if clock else None
        shutter = key("SHUT", "f", 4, 30, np.full(30, 0.01, ">f4").tobytes())
        device = key("DVID", "L", 4, 1, b"\0\0\0\1") + key("DVNM", "c", 1, 5, b"Hero8")
        streams = [stream("GYRO", body, first, int(rows[-1]) + 1), stream("SHUT", shutter, frame, 30 * (second + 1))]
        made.append(nested("DEVC", device, *streams))
    return made


def box(name: str, *inside: bytes) -> bytes:
    data = b"".join(inside)
    return struct.pack(">I4s", 8 + len(data), name.encode()) + data


def full(name: str, data: bytes) -> bytes:
    return box(name, bytes(4) + data)


def write_mp4(path: Path, payloads: list[bytes], handler: bytes = b"GoPro MET") -> Path:
    """An MP4 with one track of telemetry, a payload a second (ISO 14496-12)."""
    head = box("ftyp", b"mp41" + bytes(4) + b"mp41")
    count, scale = len(payloads), 1000
    length = count * scale
    matrix = struct.pack(">9I", 0x10000, 0, 0, 0, 0x10000, 0, 0, 0, 0x40000000)
    table = [
        full("stsd", struct.pack(">I", 1) + box("gpmd", bytes(6) + b"\0\1" + bytes(4))),
        full("stts", struct.pack(">III", 1, count, scale)),
        full("stsc", struct.pack(">IIII", 1, 1, count, 1)),
        full("stsz", struct.pack(f">II{count}I", 0, count, *map(len, payloads))),
        full("stco", struct.pack(">II", 1, len(head) + 8)),
    ]
    minf = box(
        "minf",
        full("nmhd", b""),
        box("dinf", full("dref", struct.pack(">I", 1) + full("url ", b""))),
        box("stbl", *table),
    )
    mdia = box(
        "mdia",
        full("mdhd", struct.pack(">IIIIHH", 0, 0, scale, length, 0x55C4, 0)),
        full("hdlr", bytes(4) + b"meta" + bytes(12) + handler + b"\0"),
        minf,
    )
    tkhd = full("tkhd", struct.pack(">IIIII8xHHHH", 0, 0, 1, 0, length, 0, 0, 0, 0) + matrix + bytes(8))
    mvhd = full(
        "mvhd",
        struct.pack(">IIII", 0, 0, scale, length)
        + struct.pack(">IH10x", 0x10000, 0x100)
        + matrix
        + bytes(24)
        + struct.pack(">I", 2),
    )
    media = box("mdat", *payloads)
    path.write_bytes(head + media + box("moov", mvhd, box("trak", tkhd, mdia)))
    return path
