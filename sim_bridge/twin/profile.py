"""Limits, delays and disturbances of the twin, as fields of `Profile`."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

from uav_bt.errors import UnknownNameError


class Report(NamedTuple):
    """Transmission of one quantity of the telemetry."""

    period_s: float  # between two measurements that are sent; 0: every control step
    latency_s: float  # from measurement to arrival


# Parrot's firmware sends every state 5 times a second (AutonomyLab/bebop_autonomy, issues 22 and
# 73; the SDK's documentation says "regularly"). The delay is that of a command over the same radio.
_RADIO = Report(period_s=0.2, latency_s=0.06)
_WEAK_RADIO = Report(period_s=0.2, latency_s=0.12)
_AT_ONCE = Report(period_s=0.0, latency_s=0.0)


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Limits and imperfections of the simulated drone; the defaults are the ``lab`` profile.

    The limits are those of an ANAFI configured for indoor flight. The imperfections are estimates
    for a lab. None was fitted to a real drone, so each is a field.
    """

    # Motion.
    max_speed_mps: float = 1.0  # m/s, horizontal; indoor setting, the ANAFI reaches 15
    max_climb_mps: float = 0.6  # m/s, up and down
    max_acceleration_mps2: float = 1.2  # m/s2, reference, horizontal; about 7 deg of tilt
    max_climb_acceleration_mps2: float = 1.0  # m/s2, reference, vertical
    max_yaw_rate_radps: float = 1.4  # rad/s, 80 deg/s
    max_yaw_acceleration_radps2: float = 4.0  # rad/s2
    thrust_lag_s: float = 0.12  # s, first-order lag from demanded to real acceleration
    take_off_height_m: float = 1.0  # m above the take-off point, as the ANAFI
    spin_up_s: float = 1.0  # s from the arrival of the take-off command to leaving the ground
    gimbal_rate_radps: float = 1.6  # rad/s, slew limit of the camera's pitch
    gimbal_lag_s: float = 0.05  # s, first-order lag of the camera's pitch

    # Delays of computation, commands and video.
    compute_latency_s: float = 0.03  # s between a frame and the command computed from it
    command_latency_s: float = 0.06  # s from sending a command to its execution
    video_latency_s: float = 0.15  # s from capture to delivery
    video_rate_hz: float = 30.0  # frames a second

    # Rate and delay of telemetry.
    attitude: Report = _RADIO
    velocity: Report = _RADIO
    altitude: Report = _RADIO  # altitude and height
    gimbal: Report = _RADIO
    event_latency_s: float = 0.06  # s until a changed flying state or movement arrives

    # Disturbances of the motion.
    wind_std_mps2: float = 0.12  # m/s2, Ornstein-Uhlenbeck acceleration on each axis
    wind_time_s: float = 1.5  # s, correlation time of the wind: rotor wash in a closed room
    drift_std_mps: float = 0.008  # m/s, velocity error of the optical flow, each horizontal axis
    drift_time_s: float = 4.0  # s, correlation time of the drift: 0.25 m of wandering a minute
    yaw_drift_std_rad: float = 0.02  # rad, slow error of the heading estimate
    yaw_drift_time_s: float = 30.0  # s, correlation time of the heading error
    climb_error_std_mps: float = 0.01  # m/s, slow error of the estimated vertical speed; chosen
    climb_error_time_s: float = 2.0  # s, correlation time of this error; chosen
    yaw_rate_noise_std_radps: float = 0.005  # rad/s, white noise of the yaw rate; chosen

    # Errors of the telemetry.
    altimeter_bias_std_m: float = 0.02  # m, slow error of the altitude (pressure, air flow)
    altimeter_bias_time_s: float = 20.0  # s, correlation time of the altitude error
    altimeter_noise_std_m: float = 0.01  # m, white noise of the altitude
    height_noise_std_m: float = 0.015  # m, white noise of the ultrasound height
    velocity_noise_std_mps: float = 0.02  # m/s, white noise
    attitude_noise_std_rad: float = 0.003  # rad, white noise of roll and pitch
    yaw_noise_std_rad: float = 0.005  # rad, white noise
    battery_life_s: float = 1500.0  # s from full to empty: 25 minutes, as the ANAFI

    # Errors of the images.
    image_noise_std: float = 3.0  # grey levels, white noise of each channel
    blur_sigma_px: float = 0.5  # pixels at a width of 640, scaled with the size; 0: no blur
    exposure_std: float = 0.03  # relative brightness error of the automatic exposure
    exposure_time_s: float = 3.0  # s, correlation time of the exposure error

    @staticmethod
    def named(name: str) -> Profile:
        """Return a shipped profile: ``ideal`` (limits, but no delay and no error), lab or harsh."""
        try:
            return _NAMED[name]
        except KeyError:
            raise UnknownNameError("profile", name, _NAMED) from None

    def with_instant_telemetry(self) -> Profile:
        """Return the profile with telemetry at every control step, without delay.

        The estimates of vertical speed and yaw rate then have no error.
        """
        return replace(
            self,
            attitude=_AT_ONCE,
            velocity=_AT_ONCE,
            altitude=_AT_ONCE,
            gimbal=_AT_ONCE,
            event_latency_s=0.0,
            climb_error_std_mps=0.0,
            yaw_rate_noise_std_radps=0.0,
        )


_NO_DELAY_OR_ERROR: dict[str, Any] = {
    item.name: 0.0
    for item in fields(Profile)
    if item.name.endswith("latency_s") or "_std" in item.name or item.name == "blur_sigma_px"
}
_IDEAL = replace(Profile().with_instant_telemetry(), **_NO_DELAY_OR_ERROR)
_HARSH = replace(
    Profile(),
    compute_latency_s=0.05,
    command_latency_s=0.12,
    video_latency_s=0.28,
    attitude=_WEAK_RADIO,
    velocity=_WEAK_RADIO,
    altitude=_WEAK_RADIO,
    gimbal=_WEAK_RADIO,
    event_latency_s=0.12,
    wind_std_mps2=0.2,
    drift_std_mps=0.02,
    yaw_drift_std_rad=0.05,
    climb_error_std_mps=0.02,
    yaw_rate_noise_std_radps=0.015,
    altimeter_bias_std_m=0.05,
    altimeter_noise_std_m=0.03,
    height_noise_std_m=0.04,
    velocity_noise_std_mps=0.06,
    attitude_noise_std_rad=0.01,
    yaw_noise_std_rad=0.015,
    image_noise_std=7.0,
    blur_sigma_px=1.0,
    exposure_std=0.08,
)
_NAMED = {"ideal": _IDEAL, "lab": Profile(), "harsh": _HARSH}
