"""One HTML file, readable offline on anything with a browser: its style, its frame, and what stands in it."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from xml.sax.saxutils import escape

from pipeline.products.plots import NARROW, WIDE, Plot

_STYLE = """
:root{color-scheme:light dark;--ink:#1d2620;--soft:#5c6a60;--paper:#fbfcfa;--rule:#d9e0d8;
--a:#1f6f4a;--b:#c2571a;--c:#3b62b5;--band:#f3d9a4;--good:#1f6f4a;--warn:#8a5a00;--bad:#b3261e}
@media(prefers-color-scheme:dark){:root{--ink:#e4ebe4;--soft:#9aa89d;--paper:#151a16;--rule:#313b33;
--a:#5fc795;--b:#f0955a;--c:#8fb0f5;--band:#5a4518;--good:#5fc795;--warn:#e8b04a;--bad:#f28b82}
image{filter:brightness(.62)}}
body{margin:0 auto;max-width:1000px;padding:24px 20px 60px;background:var(--paper);color:var(--ink);
font:15px/1.5 system-ui,sans-serif}
h1{font-size:1.5rem;margin:0;overflow-wrap:anywhere}h2{font-size:1.2rem;margin:44px 0 4px;padding-top:12px;
border-top:1px solid var(--rule)}h3{font-size:1rem;margin:28px 0 4px}p{color:var(--soft);margin:0 0 6px;max-width:44em}
dl{display:grid;grid-template-columns:repeat(auto-fill,minmax(145px,1fr));gap:10px 20px;margin:18px 0}
dt{color:var(--soft);font-size:.82rem}dd{margin:0;font-size:1.15rem;font-variant-numeric:tabular-nums;
overflow-wrap:anywhere}
svg{width:100%;height:auto;display:block}svg.narrow{display:none}svg.store{position:absolute;width:0;height:0}
@media(max-width:640px){svg.narrow{display:block}svg.wide{display:none}h1{font-size:1.2rem}}
text{fill:var(--soft);font-size:11px}.grid{stroke:var(--rule);stroke-width:1}
text.label{fill:var(--ink);font-weight:600;paint-order:stroke;stroke:var(--paper);stroke-width:3px}
.line{fill:none;stroke-width:1.6;stroke-linejoin:round}.dots{fill:none;stroke-width:4;stroke-linecap:round}
.wide-table{overflow-x:auto}.wide-table table{width:auto}
.wide-table th,.wide-table td{text-align:right;white-space:nowrap}
.wide-table th:first-child,.wide-table td:first-child{text-align:left}
.dots.t{stroke-width:9}use~.line{stroke-width:2.2}use~.line.s{stroke-width:1.4;stroke-dasharray:5 4}
.a{stroke:var(--a)}.b,.t{stroke:var(--b)}.c{stroke:var(--c)}.s{stroke:var(--soft)}.band{fill:var(--band)}
pre{overflow-x:auto;padding:10px 14px;border:1px solid var(--rule);user-select:all}
ul{color:var(--soft);padding-left:1.2em}
.verdict{margin:16px 0;padding:10px 14px;border-left:5px solid;font-size:1.15rem}.verdict b{margin-right:.5em}
.good{color:var(--good)}.warn{color:var(--warn)}.bad{color:var(--bad)}
ol{padding-left:1.4em;max-width:48em}ol li{margin:0 0 8px}ol span{display:block;color:var(--soft)}
table{border-collapse:collapse;width:100%;margin:12px 0;font-size:.92rem;font-variant-numeric:tabular-nums}
th{text-align:left;color:var(--soft);font-weight:400;font-size:.82rem}
th,td{padding:6px 10px 6px 0;border-bottom:1px solid var(--rule);vertical-align:top;overflow-wrap:break-word}
td img{display:block;max-width:150px;max-height:130px;border-radius:4px}a{color:var(--c)}
@media(max-width:640px){thead{display:none}tr{display:block;padding:10px 0;border-bottom:1px solid var(--rule)}
td{display:flex;gap:10px;border:0;padding:2px 0}td:empty{display:none}
td::before{content:attr(data-label);flex:0 0 8.5em;color:var(--soft);font-size:.82rem}td.wide::before{display:none}
td img{max-width:100%;max-height:320px}}
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


def subtitle(title: str) -> str:
    """Where a part of it begins."""
    return f"<h3>{escape(title)}</h3>"


def text(plain: str) -> str:
    """For a cell of a table."""
    return escape(plain)


def words(text: str) -> str:
    """A paragraph."""
    return f"<p>{escape(text)}</p>"


def facts(shown: Mapping[str, str]) -> str:
    """Figures with their labels."""
    return "<dl>" + "".join(f"<div><dt>{escape(k)}</dt><dd>{escape(v)}</dd></div>" for k, v in shown.items()) + "</dl>"


def figure(title: str, plot: Plot, caption: str = "") -> str:
    """A plot, drawn for wide and for narrow screens: scaled down to a phone its letters would be 4 px high."""
    drawn = "\n".join(plot.svg(width, name) for name, width in (("wide", WIDE), ("narrow", NARROW)))
    return f"{subtitle(title) if title else ''}\n{words(caption) if caption else ''}{drawn}"


def picture(name: str, png: bytes) -> str:
    """An image that plots lay below their lines by its name: once in the file, however often it is drawn."""
    href = f"data:image/png;base64,{base64.b64encode(png).decode()}"
    image = f'<image id="{name}" width="1" height="1" preserveAspectRatio="none" href="{href}"/>'
    return f'<svg class="store" aria-hidden="true"><defs>{image}</defs></svg>'


def photo(jpeg: bytes, about: str) -> str:
    """For a cell of a table."""
    href = f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}"
    return f'<img src="{href}" alt="{escape(about, {chr(34): "&quot;"})}">'


def code(plain: str) -> str:
    """Lines to be copied."""
    return f"<pre>{escape(plain)}</pre>"


def verdict(word: str, tone: str, text: str) -> str:
    """What it comes to. tone: good, warn or bad."""
    return f'<div class="verdict {tone}"><b>{escape(word)}</b>{escape(text)}</div>'


def tasks(todo: Sequence[tuple[str, str, str]]) -> str:
    """(tone, what is wrong, what to do about it)."""
    items = (f'<li class="{tone}">{escape(text)}<span>{escape(advice)}</span></li>' for tone, text, advice in todo)
    return f"<ol>{''.join(items)}</ol>"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """rows: cells of HTML, made by `photo` or escaped by the caller. On a phone each row is a block with its labels."""
    top = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join(f"<tr>{''.join(map(_cell, head, row))}</tr>" for row in rows)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def _cell(label: str, html: str) -> str:
    named = f' data-label="{escape(label)}"' if label else ' class="wide"'
    return f"<td{named}>{html}</td>"


def figures(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "") -> str:
    """Figures in rows; the first column names them."""
    head = "".join(f"<th>{escape(column)}</th>" for column in columns)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    told = words(caption) if caption else ""
    return f'<h3>{escape(title)}</h3>\n{told}<div class="wide-table"><table><tr>{head}</tr>{body}</table></div>'


def notes(sentences: Sequence[str]) -> str:
    """What has to be said beside the figures."""
    return subtitle("Notes") + "<ul>" + "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences) + "</ul>"
