"""One HTML file, readable offline on anything with a browser: its style, its frame, and what stands in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.sax.saxutils import escape

from pipeline.products.plots import NARROW, WIDE, Plot

_STYLE = """
:root{color-scheme:light dark;--ink:#1d2620;--soft:#5c6a60;--paper:#fbfcfa;--rule:#d9e0d8;
--a:#1f6f4a;--b:#c2571a;--c:#3b62b5;--band:#f3d9a4}
@media(prefers-color-scheme:dark){:root{--ink:#e4ebe4;--soft:#9aa89d;--paper:#151a16;--rule:#313b33;
--a:#5fc795;--b:#f0955a;--c:#8fb0f5;--band:#5a4518}}
body{margin:0 auto;max-width:1000px;padding:24px 20px 60px;background:var(--paper);color:var(--ink);
font:15px/1.5 system-ui,sans-serif}
h1{font-size:1.5rem;margin:0;overflow-wrap:anywhere}h2{font-size:1.2rem;margin:44px 0 4px;padding-top:12px;
border-top:1px solid var(--rule)}h3{font-size:1rem;margin:28px 0 4px}p{color:var(--soft);margin:0 0 6px;max-width:44em}
dl{display:grid;grid-template-columns:repeat(auto-fill,minmax(145px,1fr));gap:10px 20px;margin:18px 0}
dt{color:var(--soft);font-size:.82rem}dd{margin:0;font-size:1.15rem;font-variant-numeric:tabular-nums}
svg{width:100%;height:auto;display:block}svg.narrow{display:none}
@media(max-width:640px){svg.narrow{display:block}svg.wide{display:none}h1{font-size:1.2rem}}
text{fill:var(--soft);font-size:11px}.grid{stroke:var(--rule);stroke-width:1}
.line{fill:none;stroke-width:1.6;stroke-linejoin:round}.dots{fill:none;stroke-width:4;stroke-linecap:round}
table{border-collapse:collapse;margin:10px 0;font-variant-numeric:tabular-nums}.wide-table{overflow-x:auto}
th,td{padding:3px 14px 3px 0;text-align:right;border-bottom:1px solid var(--rule)}
th:first-child,td:first-child{text-align:left}th{color:var(--soft);font-weight:normal}
.a{stroke:var(--a)}.b{stroke:var(--b)}.c{stroke:var(--c)}.band{fill:var(--band)}ul{color:var(--soft);padding-left:1.2em}
"""


def sheet(title: str, parts: Sequence[str]) -> str:
    """The whole file."""
    body = "\n".join(parts)
    return (
        f'<!doctype html>\n<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style>\n<h1>{escape(title)}</h1>\n{body}\n</html>\n"
    )


def section(title: str) -> str:
    """Where another subject begins."""
    return f"<h2>{escape(title)}</h2>"


def words(text: str) -> str:
    """A paragraph."""
    return f"<p>{escape(text)}</p>"


def facts(shown: Mapping[str, str]) -> str:
    """Figures with their labels."""
    return "<dl>" + "".join(f"<div><dt>{escape(k)}</dt><dd>{escape(v)}</dd></div>" for k, v in shown.items()) + "</dl>"


def figure(title: str, plot: Plot, caption: str = "") -> str:
    """A plot, drawn for wide and for narrow screens: scaled down to a phone its letters would be 4 px high."""
    drawn = "\n".join(plot.svg(width, name) for name, width in (("wide", WIDE), ("narrow", NARROW)))
    return f"<h3>{escape(title)}</h3>\n{words(caption) if caption else ''}{drawn}"


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "") -> str:
    """Figures in rows; the first column names them."""
    head = "".join(f"<th>{escape(column)}</th>" for column in columns)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    told = words(caption) if caption else ""
    return f'<h3>{escape(title)}</h3>\n{told}<div class="wide-table"><table><tr>{head}</tr>{body}</table></div>'


def notes(sentences: Sequence[str]) -> str:
    """What has to be said beside the figures."""
    return "<h3>Notes</h3><ul>" + "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences) + "</ul>"
