"""The index agrees with the mcap library, however a file came to be."""

from collections import Counter

import numpy as np
import pytest
from mcap.writer import IndexType

from edge.recording.recover import finish_in_place
from edge.validation.index import read_index
from tests.edge.recordings import CODECS, recording_bytes, streamed_messages

VARIANTS = {
    "closed": {},
    "without message index": {"index_types": IndexType.CHUNK},
    "without any index": {"index_types": IndexType.NONE, "repeat_channels": False, "repeat_schemas": False},
    "without statistics": {"use_statistics": False},
    "without chunks": {"use_chunking": False},
    "open": {"finish": False},
}


def times_by_topic(data):
    found = {}
    for topic, log_time, _ in streamed_messages(data):
        found.setdefault(topic, []).append(log_time)
    return found


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("variant", VARIANTS)
def test_times_of_every_message(tmp_path, codec, variant):
    data = recording_bytes(codec, **VARIANTS[variant])
    path = tmp_path / "one.mcap"
    path.write_bytes(data)
    index = read_index(path)
    expected = times_by_topic(data)
    assert {name: series.times_ns.tolist() for name, series in index.series.items()} == expected
    assert index.topics["/imu"].type_name == "sensor_msgs/msg/Imu"
    assert index.metadata["session"] == {"software": "test"}
    assert index.finished == (variant != "open")


def test_a_cut_file_is_indexed_as_it_will_be_recovered(tmp_path):
    data = recording_bytes("lz4")
    for cut in range(1000, len(data) - 100, len(data) // 7):
        path = tmp_path / f"{cut}.mcap"
        path.write_bytes(data[:cut])
        before = read_index(path)
        assert before.damages or not before.finished
        finish_in_place(path)
        after = read_index(path)
        assert after.finished
        assert not after.damages
        assert Counter({n: s.times_ns.size for n, s in before.series.items()}) == Counter(
            {n: s.times_ns.size for n, s in after.series.items()}
        )
        for name, series in after.series.items():
            assert np.array_equal(series.times_ns, before.series[name].times_ns)
