"""Protocol of the control socket, version 1: one JSON object a line, in both directions, over a UNIX stream socket.

A client sends a `Request` and gets one `Reply` with the same `id`; the reply to `status` is followed by one
`Status` line. After `subscribe` the recorder also sends a `Status` line whenever it makes a new one (about four a
second). A line the recorder cannot read is answered with id 0, and the connection closed. `start` and `stop` are
idempotent: asking for what already is answers `ok` with the session it is about. Every line says its version.
"""

from __future__ import annotations

from typing import Literal

import msgspec

PROTOCOL_VERSION = 1


class Request(msgspec.Struct, frozen=True, tag="request"):
    """What a client asks. Unused fields stay empty."""

    command: Literal["hello", "status", "subscribe", "start", "stop", "mark", "validate"]
    id: int = 0
    version: int = PROTOCOL_VERSION
    mission: str = ""
    """start: the name of the mission, part of the session's folder."""
    operator: str = ""
    carrier: str = ""
    session: str = ""
    """stop: only if this is the session being recorded; empty means whichever is."""
    text: str = ""
    """mark: what happened here."""


class Reply(msgspec.Struct, frozen=True, tag="reply"):
    """The recorder's answer. `error` says what is wrong and what to do; empty when ok."""

    id: int
    ok: bool
    error: str = ""
    session: str = ""
    """The session the answer is about."""
    folder: str = ""
    version: int = PROTOCOL_VERSION
    software: str = ""


class Stream(msgspec.Struct, frozen=True):
    """One kind of message of a sensor, over the last second."""

    name: str
    rate_hz: float
    expected_hz: float
    received: int
    lost: int
    largest_gap_s: float


class Clock(msgspec.Struct, frozen=True):
    """How well a sensor's clock is known."""

    sigma_ms: float
    skew_ppm: float
    jitter_ms: float
    steps: int
    synchronised: str = ""


class Sensor(msgspec.Struct, frozen=True):
    """One sensor as the operator sees it. state: searching, starting, ok, degraded, failed."""

    name: str
    state: str
    streams: tuple[Stream, ...] = ()
    clock: Clock | None = None
    problem: str = ""
    advice: str = ""
    temperature_c: float | None = None
    battery_percent: float | None = None
    details: dict[str, str] = {}


class Gnss(msgspec.Struct, frozen=True):
    """The last fix in brief. quality as in GGA; age_s: seconds since it came."""

    quality: int
    quality_name: str
    satellites: int
    sigma_horizontal_m: float
    sigma_vertical_m: float
    age_s: float


class Recording(msgspec.Struct, frozen=True):
    """The session being written."""

    session: str
    folder: str
    mission: str
    elapsed_s: float
    bytes_written: int
    messages: int
    dropped: int
    """Messages the queue had no room for, since the start."""
    marks: int
    flush_ms: float
    """How long the last flush to the disk took."""
    split: int


class Host(msgspec.Struct, frozen=True):
    """The computer. None where this machine cannot tell."""

    cpu_percent: float
    memory_percent: float
    temperature_c: float | None
    throttled: bool
    disk_free_bytes: int
    disk_remaining_s: float | None
    """Recording time left on the card at the present rate."""
    battery_remaining_s: float | None
    queue_fill: float
    """0..1 of the recorder's queue."""
    clock_synchronised: bool
    clock_source: str


class Location(msgspec.Struct, frozen=True):
    """What the live pipeline says of where the payload is. state: starting, tracking, degenerate, lost."""

    state: str
    distance_m: float
    speed_m_s: float
    sigma_m: float
    """Horizontal, of the pose in `map` when georeferenced, else in `odom`."""
    position_m: tuple[float, float, float]
    georeferenced: bool
    dropped: int
    """Sweeps left out since the pipeline started, because it was behind."""
    thinned: float
    """Share of the points of a sweep that are used; below 1 when the computer is too slow or hot."""
    age_s: float
    """Since the last pose."""
    note: str = ""
    """What is wrong, in words."""


class Detecting(msgspec.Struct, frozen=True):
    """What the live detector says. state: starting, watching, slowed, waiting (for video), failed."""

    state: str
    model: str
    sha256: str = ""
    device: str = ""
    """That the model runs on: tensorrt, cuda, cpu."""
    rate_hz: float = 0.0
    """Images looked at, over the last seconds."""
    latency_ms: float = 0.0
    """From the exposure to the boxes, the last image's."""
    boxes: int = 0
    """In the images of the last second."""
    looked: int = 0
    """Images looked at since the pipeline started."""
    passed_over: int = 0
    """Images that came and were not: an older one is never looked at when a newer is there."""
    note: str = ""
    """What is wrong, in words."""


class Mapped(msgspec.Struct, frozen=True):
    """What the live grounding says; of the tree found last its range now, bearing clockwise from ahead, and sigma."""

    trees: int
    """Probable ones."""
    views: int
    """Images that were put on the map."""
    range_m: float | None = None
    bearing_deg: float = 0.0
    sigma_m: float = 0.0


class Verdict(msgspec.Struct, frozen=True):
    """The validator's word on the last session: PASS, WARN or FAIL, with the reasons, worst first."""

    session: str
    verdict: str
    reasons: tuple[str, ...] = ()
    running: bool = False
    """True while the validator is still at it."""


class Status(msgspec.Struct, frozen=True, tag="status"):
    """Everything a client shows. state: idle, recording, stopping."""

    stamp_ns: int
    """UTC, for display only."""
    state: str
    sensors: tuple[Sensor, ...]
    host: Host
    gnss: Gnss | None = None
    recording: Recording | None = None
    verdict: Verdict | None = None
    problems: tuple[str, ...] = ()
    """What is wrong with the recorder itself (disk nearly full, writer stalled), each with what to do."""
    version: int = PROTOCOL_VERSION
    location: Location | None = None
    """None without a live pipeline."""
    detecting: Detecting | None = None
    """None without a live detector."""
    mapped: Mapped | None = None
    """Likewise."""


Line = Request | Reply | Status
"""Anything that travels on the socket, told apart by its `type` field."""
