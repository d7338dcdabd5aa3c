"""TOML text to a typed structure and back, with errors a person can act on.

The walk goes table by table, so that every message names the key as it is written in the file (`recording.split_s`).
"""

from __future__ import annotations

import difflib
import json
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

import msgspec

from edge.errors import ConfigError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

StructT = TypeVar("StructT", bound=msgspec.Struct)

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_WORDS = {
    "bool": "true or false",
    "int": "a whole number",
    "float": "a number",
    "str": "a text in quotes",
    "object": "a table",
    "array": "a list",
    "null": "nothing",
}
"""msgspec's names of types, for people."""


def read(path: Path) -> dict[str, Any]:
    """The tables of a file. ConfigError names the file, and the line where the grammar is broken."""
    try:
        return parse(path.read_text(encoding="utf-8"), str(path))
    except FileNotFoundError as error:
        raise ConfigError(f"{path}: no such configuration file; leave --config out to use the defaults") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror}); check its owner and mode") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: byte {error.start} is not UTF-8; save the file as UTF-8") from error


def parse(text: str, source: str) -> dict[str, Any]:
    """The tables of a text. ConfigError names the line where the grammar is broken."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{source}: not valid TOML: {error}") from error


def convert(table: dict[str, Any], kind: type[StructT], source: str, key: str = "") -> StructT:
    """The structure a table says. `source` and `key` say where the table stands, for ConfigError."""
    _check_struct(table, kind, source, key)
    return msgspec.convert(table, kind)


def nearest(name: str, known: Iterable[str]) -> str:
    """The end of a message about an unknown name: what it may have meant, and what there is."""
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    meant = f"did you mean {close[0]!r}? " if close else ""
    return f"{meant}known here: {', '.join(names) or 'nothing'}"


def render(table: dict[str, Any]) -> str:
    """TOML text of nested tables. None, which TOML cannot say, is left out."""
    lines: list[str] = []
    _render_table(table, (), lines)
    return "\n".join(lines).lstrip("\n") + "\n"


def _check_struct(table: object, kind: type[msgspec.Struct], source: str, key: str) -> None:
    if not isinstance(table, dict):
        raise _mismatch(source, key, table, "a table")
    fields = {field.encode_name: field.type for field in msgspec.structs.fields(kind)}
    for name, value in table.items():
        if name not in fields:
            raise ConfigError(f"{source}: unknown key {_join(key, name)!r}: {nearest(name, fields)}")
        _check(value, fields[name], source, _join(key, name))
    for field in msgspec.structs.fields(kind):
        if field.required and field.encode_name not in table:
            raise ConfigError(f"{source}: {_join(key, field.encode_name)} is missing; it has no default")
    try:
        msgspec.convert(table, kind)
    except msgspec.ValidationError as error:  # only what the structure itself refuses (__post_init__) is left
        raise ConfigError(f"{source}: {key or 'the file'}: {str(error).partition(' - at ')[0]}") from error


def _check(value: object, kind: Any, source: str, key: str) -> None:
    bare = get_args(kind)[0] if get_origin(kind) is Annotated else kind
    if isinstance(bare, type) and issubclass(bare, msgspec.Struct):
        _check_struct(value, bare, source, key)
    elif get_origin(bare) is dict and isinstance(value, dict):
        for name, item in value.items():
            _check(item, get_args(bare)[1], source, _join(key, name))
    else:
        _check_value(value, kind, source, key)


def _check_value(value: object, kind: Any, source: str, key: str) -> None:
    try:
        msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        raise _mismatch(source, key, value, _expected(str(error), kind)) from error


def _expected(text: str, kind: Any) -> str:
    if get_origin(kind) is Literal:
        return "one of " + ", ".join(_value(choice) for choice in get_args(kind))
    found = re.match(r"Expected `([a-z |]+)`(.*?)(, got `.*)?( - at .*)?$", text)
    if found is None:
        return text
    words = " or ".join(_WORDS.get(word.strip(), word.strip()) for word in found[1].split("|"))
    return words + found[2]


def _mismatch(source: str, key: str, value: object, expected: str) -> ConfigError:
    found = "a table" if isinstance(value, dict) else _value(value)
    return ConfigError(f"{source}: {key or 'the file'}: found {found}, expected {expected}")


def _join(key: str, name: str) -> str:
    written = name if _BARE_KEY.fullmatch(name) else _text(name)
    return f"{key}.{written}" if key else written


def _render_table(table: dict[str, Any], path: tuple[str, ...], lines: list[str]) -> None:
    plain = {name: value for name, value in table.items() if not isinstance(value, dict) and value is not None}
    if path and (plain or not table):
        lines += ["", "[" + ".".join(_join("", name) for name in path) + "]"]
    lines += [f"{_join('', name)} = {_value(value)}" for name, value in plain.items()]
    for name, value in table.items():
        if isinstance(value, dict):
            _render_table(value, (*path, name), lines)


def _value(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    if isinstance(value, dict):
        pairs = (f"{_join('', name)} = {_value(item)}" for name, item in value.items() if item is not None)
        return "{" + ", ".join(pairs) + "}"
    return str(value)


def _text(text: str) -> str:
    # A JSON string is a TOML basic string, but for DEL, which TOML wants escaped.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
