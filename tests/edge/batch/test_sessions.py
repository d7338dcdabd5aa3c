"""Which folders and files are sessions."""

from __future__ import annotations

import pytest

from edge.batch.sessions import find_sessions
from edge.errors import UsageError


def made(root, *names):
    for name in names:
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()


def found(root):
    return [str(path.relative_to(root)) for path in find_sessions(root)]


def test_sessions_are_found_at_any_depth_and_files_that_belong_together_are_one(tmp_path):
    made(tmp_path, "card/a/a_0.mcap", "card/a/a_1.mcap.active", "b/session.json", "b/x.mcap", "b/y.mcap")
    made(tmp_path, "a/old.db3", "loose/one.mcap", "loose/two.mcap", "loose/one_products/map.laz", ".trash/c/c_0.mcap")
    assert found(tmp_path) == ["a/old.db3", "b", "card/a", "loose/one.mcap", "loose/two.mcap"]


def test_a_directory_that_is_a_session_is_a_batch_of_one(tmp_path):
    made(tmp_path, "walk_0.mcap", "walk_1.mcap", "products/work/odometry/x")
    assert find_sessions(tmp_path) == [tmp_path]


def test_a_directory_without_sessions_is_refused_with_a_word(tmp_path):
    with pytest.raises(UsageError, match="is empty; give the directory"):
        find_sessions(tmp_path)
    made(tmp_path, "photos/x.jpg")
    with pytest.raises(UsageError, match=r"holds no session: no folder below it has an \.mcap file"):
        find_sessions(tmp_path)
    with pytest.raises(UsageError, match="no directory; for one file there is `mapforest process`"):
        find_sessions(tmp_path / "photos" / "x.jpg")
    with pytest.raises(UsageError, match="cannot be looked into"):
        find_sessions(tmp_path / "nowhere")
