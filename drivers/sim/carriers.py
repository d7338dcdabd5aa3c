"""Who carries the payload, and how that moves it. Amplitudes are peaks, of `base_link`."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.errors import SimulationError


@dataclass(frozen=True, slots=True)
class Carrier:
    """Motion on top of the way along the route.

    Gait: bob up, sway left, surge ahead and rotations with the step (step_hz at cruise), only while moving.
    Shake: band-limited noise of hands or wind. Vibration: the same, with speed. gaze_deg: slow looking around.
    bank: share of the coordinated lean in turns. tilt: pitch (rad) a m/s^2 of forward acceleration.
    """

    name: str
    speed_m_s: float
    acceleration_m_s2: float
    sideways_m_s2: float
    height_m: float
    mount_pitch_deg: float = 0.0
    step_hz: float = 1.8
    bob_m: float = 0.0
    sway_m: float = 0.0
    surge_m: float = 0.0
    gait_roll_deg: float = 0.0
    gait_pitch_deg: float = 0.0
    gait_yaw_deg: float = 0.0
    shake_m: float = 0.0
    shake_deg: float = 0.0
    shake_hz: tuple[float, float] = (0.8, 6.0)
    vibration_m: float = 0.0
    vibration_deg: float = 0.0
    vibration_hz: tuple[float, float] = (10.0, 30.0)
    gaze_deg: float = 0.0
    bank: float = 0.0
    tilt: float = 0.0
    climb_m: float = 0.0


CARRIERS: dict[str, Carrier] = {
    "handheld": Carrier(
        name="handheld",
        speed_m_s=1.2,
        acceleration_m_s2=0.8,
        sideways_m_s2=0.9,
        height_m=1.35,
        mount_pitch_deg=6.0,
        bob_m=0.022,
        sway_m=0.022,
        surge_m=0.012,
        gait_roll_deg=1.8,
        gait_pitch_deg=1.5,
        gait_yaw_deg=2.2,
        shake_m=0.002,
        shake_deg=0.8,
        gaze_deg=14.0,
        bank=0.2,
    ),
    "backpack": Carrier(
        name="backpack",
        speed_m_s=1.3,
        acceleration_m_s2=0.8,
        sideways_m_s2=0.9,
        height_m=1.95,
        mount_pitch_deg=4.0,
        bob_m=0.028,
        sway_m=0.030,
        surge_m=0.015,
        gait_roll_deg=2.2,
        gait_pitch_deg=1.4,
        gait_yaw_deg=2.8,
        shake_m=0.001,
        shake_deg=0.2,
        gaze_deg=3.0,
        bank=0.3,
    ),
    "bicycle": Carrier(
        name="bicycle",
        speed_m_s=3.5,
        acceleration_m_s2=0.9,
        sideways_m_s2=2.2,
        height_m=1.15,
        step_hz=1.2,
        sway_m=0.02,
        gait_roll_deg=1.6,
        gait_yaw_deg=1.2,
        shake_m=0.015,
        shake_deg=1.2,
        shake_hz=(0.4, 2.0),
        vibration_m=0.0009,
        vibration_deg=0.25,
        vibration_hz=(6.0, 25.0),
        bank=1.0,
    ),
    "uav": Carrier(
        name="uav",
        speed_m_s=2.5,
        acceleration_m_s2=1.0,
        sideways_m_s2=1.8,
        height_m=0.30,
        shake_m=0.06,
        shake_deg=0.8,
        shake_hz=(0.1, 1.0),
        vibration_m=0.00004,
        vibration_deg=0.03,
        vibration_hz=(30.0, 60.0),
        bank=1.0,
        tilt=0.10,
        climb_m=3.2,
    ),
}


def carrier(name: str) -> Carrier:
    """The carrier of that name. SimulationError names the ones there are."""
    if name not in CARRIERS:
        raise SimulationError(f"carrier {name!r}: expected one of {', '.join(CARRIERS)}")
    return CARRIERS[name]
