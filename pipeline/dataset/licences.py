"""What may be done with a published photo: Creative Commons codes as iNaturalist writes them."""

from __future__ import annotations

ALL_RIGHTS_RESERVED = ""
_FREE = {"cc0", "pd"}


def licence_code(text: str | None) -> str:
    """`cc-by-nc` and the like, in small letters without version; ALL_RIGHTS_RESERVED for none, unknown or "C"."""
    words = (text or "").strip().lower().replace("_", "-").replace(" ", "-")
    if words in _FREE or words in {"cc-zero", "cc-0"}:
        return words if words in _FREE else "cc0"
    parts = words.split("-")
    if parts[:2] != ["cc", "by"]:
        return ALL_RIGHTS_RESERVED
    terms = [part for part in parts[2:] if not _version(part)]
    known = len(set(terms)) == len(terms) and set(terms) <= {"nc", "nd", "sa"}
    return "-".join(["cc", "by", *terms]) if known else ALL_RIGHTS_RESERVED


def non_commercial(code: str) -> bool:
    """Whether a licence forbids commercial use."""
    return "nc" in code.split("-")


def _version(part: str) -> bool:
    return part.replace(".", "").isdigit()
