"""The verdict on a recording: ours or foreign, a session folder, one file or several splits."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from edge.config import Config
from edge.validation import clocks, expected, gnss, losses, structure
from edge.validation.checks import CHECKS, Facts
from edge.validation.expected import Expected
from edge.validation.index import FileIndex
from edge.validation.rates import Rates, rates_of
from edge.validation.recording import Recording
from edge.validation.report import (
    FileReport,
    Finding,
    GnssShare,
    Level,
    Report,
    TopicReport,
    reasons_of,
    verdict_of,
)
from edge.validation.sample import Sample, take

_EMPTY_ADVICE = "Check that the sensors are on before recording: `mapforest doctor`."


def validate(target: Path | Sequence[Path], config: Config | None = None) -> Report:
    """Judge a recording. FormatError when there is none to judge.

    A session of ours is judged by the sensors it was recorded with; `config` gives the limits and topics of its
    `[validation]`. In other recordings topics are recognised by their types.
    """
    started = time.monotonic()
    evidence = gather(Recording.read([target] if isinstance(target, Path) else list(target)), config or Config())
    report = _report(evidence, _ranked(_findings(evidence)))
    return msgspec.structs.replace(report, elapsed_s=time.monotonic() - started)


@dataclass(frozen=True, slots=True)
class Evidence:
    """Everything the checks look at. wanted: what is expected, by topic."""

    recording: Recording
    config: Config
    sample: Sample
    rates: dict[str, Rates]
    wanted: dict[str, Expected]
    fix_topic: str
    gnss: GnssShare | None


def gather(recording: Recording, config: Config) -> Evidence:
    """Reduce a recording to what the checks need."""
    config = recording.effective(config)
    sample = take(recording.files)
    rates = {name: rates_of(times, recording.span) for name, times in recording.times.items()}
    fix_topic = _fix_topic(recording, config)
    share = gnss.share_of(recording.files, fix_topic, recording.said) if fix_topic else None
    wanted = _wanted(recording, config, rates, sample)
    return Evidence(recording, config, sample, rates, wanted, fix_topic, share)


def _wanted(recording: Recording, config: Config, rates: dict[str, Rates], sample: Sample) -> dict[str, Expected]:
    if recording.facts is not None:
        return expected.of_session(config)
    typical = {name: _typical_hz(name, one, sample) for name, one in rates.items() if one.count >= 10}
    return expected.of_foreign(recording.topics, typical, config)


def _typical_hz(name: str, rates: Rates, sample: Sample) -> float:
    """By the sensor's own stamps where the sample has them: arrivals may come in bursts."""
    steps = np.concatenate([np.diff(stamps) for stamps in sample.stamps(name)] or [np.empty(0, np.int64)])
    steps = steps[steps > 0]
    return float(1e9 / np.median(steps)) if steps.size >= 5 else rates.median_hz


def _fix_topic(recording: Recording, config: Config) -> str:
    if recording.facts is not None:
        return config.topics.fix
    return next((name for name, topic in recording.topics.items() if topic.type_name.endswith("/NavSatFix")), "")


def _ranked(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Worst first; of equals, those about a topic before those about the whole."""
    return tuple(sorted(findings, key=lambda finding: (finding.level, bool(finding.topic)), reverse=True))


def _findings(evidence: Evidence) -> Iterator[Finding]:
    recording, said = evidence.recording, evidence.recording.said
    yield from structure.check(recording, evidence.sample)
    if not recording.times:
        yield Finding(Level.FAIL, "", "The recording holds no messages.", _EMPTY_ADVICE)
        return
    for name in evidence.wanted:
        facts = _facts(evidence, name)
        for check in CHECKS:
            yield from check(facts)
    counts = {name: one.count for name, one in evidence.rates.items()}
    yield from losses.check_dropped(losses.dropped(said), counts)
    yield from losses.check_lost(losses.lost(said))
    limits = evidence.config.validation
    yield from clocks.check(said, limits.max_clock_sigma_ms)
    yield from gnss.check(evidence.gnss, limits.min_fix_share, evidence.fix_topic)


def _facts(evidence: Evidence, name: str) -> Facts:
    recording, sample = evidence.recording, evidence.sample
    return Facts(
        name=name,
        expected=evidence.wanted[name],
        topic=recording.topics.get(name),
        rates=evidence.rates.get(name),
        span=recording.span,
        stamps_ns=tuple(sample.stamps(name)),
        latencies_s=sample.latencies_s(name),
    )


def _report(evidence: Evidence, findings: tuple[Finding, ...]) -> Report:
    recording, rates, wanted = evidence.recording, evidence.rates, evidence.wanted
    names = [*wanted, *sorted(set(recording.topics) - set(wanted))]
    return Report(
        target=recording.name,
        verdict=verdict_of(findings),
        reasons=reasons_of(findings),
        findings=findings,
        topics=tuple(_topic_report(name, evidence, findings) for name in names),
        files=tuple(map(_file_report, recording.files)),
        missing=tuple(name for name, one in wanted.items() if one.required and name not in rates),
        own=recording.facts is not None,
        start_ns=recording.span.start_ns,
        duration_s=recording.span.duration_s,
        size_bytes=sum(index.size for index in recording.files),
        messages=sum(one.count for one in rates.values()),
        gnss=evidence.gnss,
        clock_sigma_ms=clocks.sigmas_ms(recording.said),
        dropped=losses.dropped(recording.said),
        lost={name: count for name, (count, _) in losses.lost(recording.said).items()},
        elapsed_s=0.0,
    )


def _file_report(index: FileIndex) -> FileReport:
    messages = sum(series.times_ns.size for series in index.series.values())
    return FileReport(index.path.name, index.size, index.finished, messages)


def _topic_report(name: str, evidence: Evidence, findings: tuple[Finding, ...]) -> TopicReport:
    rates, one, topic = evidence.rates.get(name), evidence.wanted.get(name), evidence.recording.topics.get(name)
    return TopicReport(
        name=name,
        type_name=topic.type_name if topic else "",
        count=rates.count if rates else 0,
        expected_hz=one.nominal_hz or None if one else None,
        rate_hz=rates.rate_hz if rates else 0.0,
        largest_gap_s=rates.largest_gap_s if rates else 0.0,
        gap_at_s=rates.gap_at_s if rates else 0.0,
        starts_s=rates.starts_s if rates else 0.0,
        ends_before_s=rates.ends_before_s if rates else 0.0,
        required=bool(one and one.required),
        level=max((finding.level for finding in findings if finding.topic == name), default=Level.NOTE),
    )
