"""The recorder's own numbers: card, battery, queue, processor, clock."""

from __future__ import annotations

from dataclasses import dataclass

from edge.control.messages import Detecting, Gnss, Host, Location, Mapped, Status
from ui import units
from ui.faults import left_tone, queue_tone
from ui.pieces import Pieces, badge, fit
from ui.tone import Tone

OLD_FIX_S = 3.0
"""A receiver sends at 5-10 Hz; a fix older than this says that it no longer does."""
HOT_C = 85.0
"""The Orin Nano starts to throttle at about 97 °C on the die."""

BADGE = 13
"""As wide as the sensors' badges below it."""


@dataclass(frozen=True)
class Vital:
    """One cell. A tone other than quiet brings its symbol along."""

    label: str
    value: str
    tone: Tone = Tone.QUIET

    @property
    def shown(self) -> str:
        return self.value if self.tone is Tone.QUIET else f"{self.tone.symbol} {self.value}"


LABELS = ("SIZE", "CARD LEFT", "FREE", "BATTERY", "QUEUE", "CPU", "TEMP", "CLOCK")


def vitals(status: Status | None) -> tuple[Vital, ...]:
    """One cell for each of LABELS, in that order."""
    if status is None:
        return tuple(Vital(label, units.NOTHING) for label in LABELS)
    host = status.host
    written = units.size(status.recording.bytes_written) if status.recording else units.NOTHING
    return (
        Vital("SIZE", written),
        Vital("CARD LEFT", units.remaining(host.disk_remaining_s), left_tone(host.disk_remaining_s)),
        Vital("FREE", units.size(host.disk_free_bytes)),
        Vital("BATTERY", units.remaining(host.battery_remaining_s), left_tone(host.battery_remaining_s)),
        Vital("QUEUE", units.percent(host.queue_fill * 100), queue_tone(host.queue_fill)),
        Vital("CPU", units.percent(host.cpu_percent), Tone.WARN if host.cpu_percent >= 90 else Tone.QUIET),
        _temperature(host),
        _clock(host),
    )


def gnss_line(gnss: Gnss | None) -> Pieces:
    """Fix quality in a badge, then satellites and sigmas."""
    label = ("GNSS    ", "$quiet-text")
    if gnss is None:
        return (label, *badge("NO DATA", Tone.QUIET, BADGE))
    tone = gnss_tone(gnss)
    sigma = f"  ±{units.metres(gnss.sigma_horizontal_m)} across  ±{units.metres(gnss.sigma_vertical_m)} up"
    pieces = (
        label,
        *badge(gnss.quality_name.upper(), tone, BADGE),
        (f"  {gnss.satellites} satellites", ""),
        (sigma, "bold"),
    )
    if gnss.age_s > OLD_FIX_S:
        return (*pieces, (f"  {Tone.BAD.symbol} {units.age(gnss.age_s)} old", Tone.BAD.text))
    return pieces


def location_line(location: Location) -> Pieces:
    """What the live pipeline says: state in a badge, way, speed, sigma, what it had to leave out and what is wrong."""
    bad = location.state == "lost"
    tone = Tone.BAD if bad else Tone.GOOD if location.state == "tracking" else Tone.WARN
    label = ("POSE    ", "$quiet-text")
    start = (label, *badge(location.state.upper(), tone, BADGE))
    if location.state == "starting":
        return (*start, (f"  {location.note}", ""))
    east, north, up = location.position_m
    frame = "map" if location.georeferenced else "local"
    pieces: Pieces = (
        *start,
        (f"  {location.distance_m:.0f} m  {location.speed_m_s:.1f} m/s", ""),
        (f"  ±{units.metres(location.sigma_m)} {frame}", "bold"),
        (f"  {east:+.1f} {north:+.1f} {up:+.1f}", "$quiet-text"),
    )
    if location.dropped or location.thinned < 1.0:
        behind = f"  {Tone.WARN.symbol} {location.thinned:.0%} of the points, {location.dropped} sweeps left out"
        pieces = (*pieces, (behind, Tone.WARN.text))
    if location.note:
        pieces = (*pieces, (f"  {location.note}", tone.text if tone in (Tone.WARN, Tone.BAD) else "$quiet-text"))
    return pieces


def detecting_line(detecting: Detecting) -> Pieces:
    """What the live detector says: state in a badge, then boxes, pace, delay, model, and what is wrong."""
    tones = {"watching": Tone.GOOD, "failed": Tone.BAD}
    tone = tones.get(detecting.state, Tone.WARN)
    pieces: Pieces = (("DETECT  ", "$quiet-text"), *badge(detecting.state.upper(), tone, BADGE))
    if detecting.device:
        pieces = (
            *pieces,
            (f"  {detecting.boxes} boxes", "bold"),
            (f"  {detecting.rate_hz:.1f}/s  {detecting.latency_ms:.0f} ms", ""),
            (f"  {detecting.model} on {detecting.device}", "$quiet-text"),
        )
    if detecting.note:
        style = tone.text if tone in (Tone.WARN, Tone.BAD) else "$quiet-text"
        pieces = (*pieces, (f"  {detecting.note}", style))
    return pieces


def mapped_line(mapped: Mapped) -> Pieces:
    """What is on the map: how many trees, and where to look for the last one."""
    some = mapped.trees > 0
    words = f"{mapped.trees} FOUND" if some else "NONE YET"
    pieces: Pieces = (("TREES   ", "$quiet-text"), *badge(words, Tone.GOOD if some else Tone.QUIET, BADGE))
    if mapped.range_m is None:
        return (*pieces, (f"  {mapped.views} images", "$quiet-text"))
    hour = round(mapped.bearing_deg / 30.0) % 12 or 12
    last = f"  last {units.metres(mapped.range_m)} away at {hour} o'clock"
    return (*pieces, (last, "bold"), (f"  ±{units.metres(mapped.sigma_m)}  {mapped.views} images", "$quiet-text"))


def gnss_tone(gnss: Gnss) -> Tone:
    """Quality as in GGA: 4 and 5 are RTK, 0 is no fix."""
    if gnss.quality == 0 or gnss.age_s > OLD_FIX_S:
        return Tone.BAD
    return Tone.GOOD if gnss.quality in (4, 5) else Tone.WARN


def _temperature(host: Host) -> Vital:
    value = units.celsius(host.temperature_c)
    if host.throttled:
        return Vital("THROTTLED", value, Tone.WARN)
    hot = host.temperature_c is not None and host.temperature_c >= HOT_C
    return Vital("TEMP", value, Tone.WARN if hot else Tone.QUIET)


def _clock(host: Host) -> Vital:
    if host.clock_synchronised:
        return Vital("CLOCK", fit(host.clock_source or "set", 7), Tone.GOOD)
    return Vital("CLOCK", "no sync", Tone.WARN)
