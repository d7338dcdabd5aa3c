"""An independent, deliberately plain reading of NMEA logs, and sentences for tests."""

import re
from functools import reduce
from pathlib import Path

LOGS = Path(__file__).parents[3] / "../shared/data/nmea"


def valid_sentences(data: bytes) -> list[str]:
    """Every sentence with a good checksum that stands on a line end, by one regular expression."""
    found = re.findall(rb"\$([\x20-\x23\x25-\x29\x2b-\x7e]{1,250})\*([0-9A-Fa-f]{2})(?=[\r\n])", data)
    good = [(b, c) for b, c in found if reduce(lambda x, y: x ^ y, b) == int(c, 16)]
    return [f"${body.decode()}*{check.decode()}" for body, check in good]


def ggas(sentences: list[str]) -> list[tuple[str, int, float, float]]:
    """(time text, quality, latitude, longitude) of every GGA, the position as stated."""
    epochs = []
    for sentence in sentences:
        fields = sentence[1:-3].split(",")
        if fields[0].endswith("GGA"):
            latitude = int(fields[2][:2]) + float(fields[2][2:]) / 60
            longitude = int(fields[4][:3]) + float(fields[4][3:]) / 60
            signs = (-1 if fields[3] == "S" else 1), (-1 if fields[5] == "W" else 1)
            epochs.append((fields[1], int(fields[6]), signs[0] * latitude, signs[1] * longitude))
    return epochs


def sentence(body: str) -> str:
    """With `$` and checksum."""
    return f"${body}*{reduce(lambda x, y: x ^ y, body.encode(), 0):02X}"
