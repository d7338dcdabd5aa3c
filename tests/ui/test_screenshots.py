"""Pictures for the documentation."""

from xml.etree import ElementTree

from ui import screenshots


def test_pictures_are_small_need_no_network_and_show_their_state(tmp_path, monkeypatch):
    monkeypatch.setattr(screenshots, "SCENES", {"gone": screenshots.SCENES["gone"]})
    assert screenshots.main([str(tmp_path)]) == 0
    svg = (tmp_path / "tui-gone.svg").read_text()
    ElementTree.fromstring(svg)
    assert len(svg) < 150_000
    assert "url(http" not in svg
    assert "systemctl" in svg
