"""A sensor as rows of a table: its state in a badge, a row for each stream, then what is wrong and what to do."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest

from edge.control.messages import Clock, Sensor, Stream
from ui import units
from ui.faults import sensor_tone
from ui.history import History, StreamHistory
from ui.pieces import Pieces, badge, fit, text_of
from ui.sparks import sparkline
from ui.tone import Tone

CLOCK_WARN_MS = 5.0
"""Past this the validator warns too."""
BATTERY_WARN_PERCENT = 20.0
QUIET = Tone.QUIET.text
NARROW = 66
"""All columns but the sparkline; narrower than this, some have to go."""
WIDEST_SPARK = 60


@dataclass(frozen=True)
class Columns:
    """Widths in cells; 0 leaves a column out."""

    name: int
    state: int
    stream: int
    rate: int
    spark: int
    lost: int
    gap: int
    clock: int


def columns(width: int) -> Columns:
    """Columns for a table `width` cells wide. What matters least goes first on a narrow screen."""
    if width < NARROW:
        return Columns(name=8, state=14, stream=6, rate=15, spark=0, lost=6 if width >= 50 else 0, gap=0, clock=0)
    spark = min(width - NARROW, WIDEST_SPARK)
    return Columns(name=8, state=14, stream=7, rate=15, spark=spark, lost=6, gap=7, clock=9)


def header(widths: Columns) -> Pieces:
    """The table's first line."""
    cells = (
        "SENSOR".ljust(widths.name),
        "STATE".ljust(widths.state),
        "STREAM".ljust(widths.stream),
        "  HZ / NOMINAL".ljust(widths.rate),
        fit("LAST SECONDS" if widths.spark > 12 else "TREND", widths.spark).rjust(widths.spark),
        "LOST".rjust(widths.lost) if widths.lost else "",
        "GAP".rjust(widths.gap) if widths.gap else "",
        "CLOCK".rjust(widths.clock) if widths.clock else "",
    )
    return (("".join(cells), QUIET),)


def rows(sensor: Sensor, history: History, widths: Columns, recording: bool) -> tuple[Pieces, ...]:
    """The table's lines for one sensor."""
    tone = sensor_tone(sensor, recording)
    leads = (badge(sensor.state.upper(), tone, widths.state - 1), extras(sensor))
    streams = tuple(_stream(stream, history.of(sensor.name, stream.name), widths) for stream in shown_streams(sensor))
    clocks = (_clock(sensor.clock, widths.clock),) if sensor.streams else ()
    lines = [
        (*_name(sensor.name if index == 0 else "", widths), *_filled(lead, widths.state), *stream, *clock)
        for index, (lead, stream, clock) in enumerate(zip_longest(leads, streams, clocks, fillvalue=()))
        if index == 0 or lead or stream
    ]
    if sensor.problem:
        lines.append(((f"{tone.symbol} {sensor.problem}", tone.text),))
    if sensor.advice:
        lines.append(((f"→ {sensor.advice}", ""),))
    return tuple(lines)


def shown_streams(sensor: Sensor) -> tuple[Stream, ...]:
    """All of them; of a sensor that sends nothing the first, since its line on what to do needs the room."""
    return sensor.streams if any(stream.rate_hz > 0 for stream in sensor.streams) else sensor.streams[:1]


def extras(sensor: Sensor) -> Pieces:
    """Temperature and battery of the sensor itself, below its badge."""
    parts: list[tuple[str, str]] = []
    if sensor.temperature_c is not None:
        parts.append((f"{units.celsius(sensor.temperature_c)} ", QUIET))
    if sensor.battery_percent is not None:
        low = sensor.battery_percent < BATTERY_WARN_PERCENT
        text = f"bat {sensor.battery_percent:.0f}%"
        parts.append((f"{Tone.WARN.symbol} {text}", Tone.WARN.text) if low else (text, QUIET))
    return tuple(parts)


def _name(name: str, widths: Columns) -> Pieces:
    return ((fit(name, widths.name - 1).ljust(widths.name), "bold"),)


def _filled(pieces: Pieces, width: int) -> Pieces:
    return (*pieces, (" " * (width - len(text_of(pieces))), ""))


def _stream(stream: Stream, past: StreamHistory, widths: Columns) -> Pieces:
    tone = rate_tone(stream)
    mark = tone.symbol if tone in (Tone.WARN, Tone.BAD) else " "
    nominal = f" / {units.nominal_hertz(stream.expected_hz)}" if stream.expected_hz > 0 else ""
    rate = f"{mark}{units.hertz(stream.rate_hz):>5}{nominal}"
    losing = Tone.WARN if past.losing else Tone.QUIET
    lost = f"{losing.symbol if past.losing else ''}{units.count(stream.lost)}"
    return (
        (fit(stream.name, widths.stream - 1).ljust(widths.stream), ""),
        (rate.ljust(widths.rate), "bold" if tone is Tone.GOOD else tone.text),
        (sparkline(tuple(past.ratios), widths.spark), tone.text),
        (lost.rjust(widths.lost) if widths.lost else "", losing.text if past.losing else ""),
        (units.seconds(stream.largest_gap_s).rjust(widths.gap) if widths.gap else "", ""),
    )


def rate_tone(stream: Stream) -> Tone:
    """Within 10 % of nominal is good, below half is bad. Without a nominal rate nothing can be said."""
    if stream.expected_hz <= 0:
        return Tone.QUIET
    ratio = stream.rate_hz / stream.expected_hz
    if ratio < 0.5:
        return Tone.BAD
    return Tone.GOOD if 0.9 <= ratio <= 1.1 else Tone.WARN


def _clock(clock: Clock | None, width: int) -> Pieces:
    if not width:
        return ()
    if clock is None:
        return ((units.NOTHING.rjust(width), QUIET),)
    text = f"±{units.millis(clock.sigma_ms)}"
    if clock.sigma_ms <= CLOCK_WARN_MS:
        return ((text.rjust(width), ""),)
    return ((f"{Tone.WARN.symbol}{text}".rjust(width), Tone.WARN.text),)
