"""What the session comes to, what was done in it, and what to do now."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from edge.recording.folder import SessionRecord
from edge.report.made import Made
from edge.validation.report import Finding, Level, Report
from edge.words import date, duration, size
from pipeline.products import sheet

_TONES = {"PASS": "good", "WARN": "warn", "FAIL": "bad"}
_LEVELS = {Level.NOTE: "", Level.WARN: "warn", Level.FAIL: "bad"}
_SAYS = {
    "PASS": "every required topic was there, at its rate, to the end",
    "WARN": "usable, and weaker than it should be",
    "FAIL": "something needed is missing: walk again if you can",
}


def verdict_parts(
    judged: Report, record: SessionRecord | None, made: Made | None, advice: Sequence[Finding]
) -> Iterator[str]:
    """The verdict of the field where there is one: the validator's own after the stop."""
    said = record.verdict.verdict if record is not None and record.verdict is not None else judged.verdict
    yield sheet.verdict(said, _TONES.get(said, ""), _SAYS.get(said, ""))
    if said != judged.verdict:
        yield sheet.words(f"That is what was said after the stop. Judged again now, it is {judged.verdict}.")
    yield sheet.facts(_facts(judged, record, made))
    todo = [one for one in (*judged.findings, *advice) if one.level is not Level.NOTE or one.advice]
    if todo:
        yield sheet.section("What to do")
        ranked = sorted(todo, key=lambda one: one.level, reverse=True)
        yield sheet.tasks([(_LEVELS[one.level], one.text, one.advice) for one in ranked])


def marks(record: SessionRecord | None) -> str:
    """The operator's notes, or nothing."""
    if record is None or not record.marks:
        return ""
    rows = [
        (f"{(mark.stamp_ns - record.anchor_utc_ns) / 1e9:.0f} s", sheet.text(mark.text or "(without words)"))
        for mark in record.marks
    ]
    return sheet.subtitle("Marks of the operator") + sheet.table(("after", "what"), rows)


def _facts(judged: Report, record: SessionRecord | None, made: Made | None) -> dict[str, str]:
    shown = {
        "recorded": date(judged.start_ns),
        "duration": duration(judged.duration_s),
        "size": size(judged.size_bytes),
    }
    if record is not None:
        told = {"mission": record.about.mission, "operator": record.about.operator, "carrier": record.about.carrier}
        shown |= {name: value for name, value in told.items() if value}
    if made is not None:
        shown["walked"] = f"{made.facts.travelled_m:,.0f} m"
        shown["position known to"] = f"{made.facts.sigma_end_m:.2f} m at the end"
        if made.facts.findings is not None:
            shown["trees found"] = f"{made.facts.findings.trees}, {made.unverified} unverified"
            shown["searched"] = f"{made.facts.findings.searched_m2:,.0f} m²"
    return shown
