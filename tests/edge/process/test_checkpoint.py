"""Finished stages are remembered with what they were made from."""

from __future__ import annotations

import os

import pytest

from edge.errors import EdgeError
from edge.process.ahead import ahead
from edge.process.checkpoint import Checkpoint, alone, fingerprint, key_of


def test_a_stage_is_done_for_its_key_only_while_its_outputs_are_there(tmp_path):
    first = Checkpoint(tmp_path)
    output = first.begin("odometry") / "track"
    output.write_text("poses")
    assert not first.done("odometry", "a")
    first.finish("odometry", "a")
    again = Checkpoint(tmp_path)
    assert again.done("odometry", "a", [output])
    assert not again.done("odometry", "b", [output])
    output.unlink()
    assert not again.done("odometry", "a", [output])


def test_a_stage_that_begins_again_is_not_done_and_finds_an_empty_folder(tmp_path):
    first = Checkpoint(tmp_path)
    (first.begin("odometry") / "track").write_text("half")
    first.finish("odometry", "a")
    assert list(first.begin("odometry").iterdir()) == []
    assert not Checkpoint(tmp_path).done("odometry", "a")


def test_a_state_nobody_can_read_means_nothing_is_done(tmp_path):
    (tmp_path / "state.json").write_bytes(os.urandom(50))
    assert not Checkpoint(tmp_path).done("odometry", "a")


def test_files_are_told_apart_by_their_ends(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(bytes(200_000))
    before = key_of(fingerprint([path]))
    assert before == key_of(fingerprint([path]))
    path.write_bytes(bytes(199_999) + b"x")
    assert before != key_of(fingerprint([path]))


def test_only_one_works_in_a_folder(tmp_path):
    with alone(tmp_path), pytest.raises(EdgeError, match="at work there"), alone(tmp_path):
        pass


def test_reading_ahead_changes_neither_items_nor_errors():
    assert list(ahead(range(100), 3)) == list(range(100))

    def broken():
        yield 1
        raise ValueError("torn")

    made = ahead(broken(), 2)
    assert next(made) == 1
    with pytest.raises(ValueError, match="torn"):
        next(made)


def test_reading_ahead_ends_when_nobody_reads_any_more():
    endless = iter(int, 1)
    made = ahead(endless, 2)
    assert next(made) == 0
    made.close()
