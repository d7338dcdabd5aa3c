"""The computer, read from a made-up /proc and /sys."""

from pathlib import Path

import pytest

from edge.service.host import HostProbe


def write(root: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)


def test_a_jetson_that_is_hot_and_slowed_down(tmp_path: Path) -> None:
    write(
        tmp_path,
        {
            "proc/stat": "cpu  100 0 100 700 100 0 0 0 0 0\ncpu0 1 1 1 1\n",
            "proc/meminfo": "MemTotal: 8000 kB\nMemFree: 100 kB\nMemAvailable: 2000 kB\n",
            "sys/class/thermal/thermal_zone0/temp": "71500\n",
            "sys/class/thermal/thermal_zone1/temp": "-256000\n",
            "sys/class/thermal/cooling_device0/type": "pwm-fan\n",
            "sys/class/thermal/cooling_device0/cur_state": "3\n",
            "sys/class/thermal/cooling_device1/type": "cpufreq-cpu0\n",
            "sys/class/thermal/cooling_device1/cur_state": "2\n",
            "sys/class/hwmon/hwmon1/oc3_event_cnt": "4\n",
            "sys/class/power_supply/bat/type": "Battery\n",
            "sys/class/power_supply/bat/status": "Discharging\n",
            "sys/class/power_supply/bat/energy_now": "30000000\n",
            "sys/class/power_supply/bat/power_now": "15000000\n",
        },
    )
    probe = HostProbe(tmp_path)
    write(tmp_path, {"proc/stat": "cpu  140 0 110 730 120 0 0 0 0 0\n", "sys/class/hwmon/hwmon1/oc3_event_cnt": "5\n"})
    sample = probe.sample()
    assert sample.cpu_percent == pytest.approx(50.0)
    assert sample.memory_percent == pytest.approx(75.0)
    assert sample.temperature_c == 71.5
    assert sample.throttled_by == "cpufreq-cpu0, over-current (oc3)"
    assert sample.battery_remaining_s == 7200.0
    write(tmp_path, {"sys/class/thermal/cooling_device1/cur_state": "0\n"})
    assert not probe.sample().throttled


def test_a_computer_that_tells_nothing(tmp_path: Path) -> None:
    sample = HostProbe(tmp_path).sample()
    assert (sample.cpu_percent, sample.temperature_c, sample.battery_remaining_s) == (0.0, None, None)
    assert not sample.throttled


def test_this_computer_tells_its_memory() -> None:
    assert 0.0 < HostProbe().sample().memory_percent < 100.0
