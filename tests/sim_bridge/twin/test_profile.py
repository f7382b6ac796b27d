"""Profiles: named sets of limits and imperfections."""

from __future__ import annotations

import math
from dataclasses import fields

import pytest

from sim_bridge.twin.profile import Profile
from uav_bt.errors import ValueRangeError


def test_the_ideal_profile_has_limits_but_no_delay_and_no_error() -> None:
    """All disturbances are zero."""
    ideal = Profile.named("ideal")
    for item in fields(Profile):
        zero = item.name.endswith(("latency_s", "period_s")) or item.name == "blur_sigma_px"
        if "_std" in item.name or zero:
            assert getattr(ideal, item.name) == 0.0
    assert ideal.max_speed_mps == Profile.named("lab").max_speed_mps


def test_harsh_is_at_least_as_bad_as_lab_everywhere() -> None:
    """No imperfection is smaller, most are larger."""
    lab, harsh = Profile.named("lab"), Profile.named("harsh")
    names = [item.name for item in fields(Profile) if "_std" in item.name or "latency" in item.name]
    assert all(getattr(harsh, name) >= getattr(lab, name) for name in names)
    assert sum(getattr(harsh, name) > getattr(lab, name) for name in names) > len(names) / 2


@pytest.mark.parametrize("name", ["lab", "harsh"])
def test_instant_telemetry_changes_telemetry_and_nothing_else(name: str) -> None:
    """The noise of telemetry and the delays of commands and video do not change."""
    usual, instant = Profile.named(name), Profile.named(f"{name}-instant")
    changed = {
        item.name
        for item in fields(Profile)
        if getattr(usual, item.name) != getattr(instant, item.name)
    }
    assert changed == {
        *(f"{quantity}_period_s" for quantity in ("attitude", "velocity", "altitude", "gimbal")),
        *(f"{each}_latency_s" for each in ("attitude", "velocity", "altitude", "gimbal", "event")),
        "climb_error_std_mps",
        "yaw_rate_noise_std_radps",
    }


def test_lab_is_the_default() -> None:
    """A profile without arguments is ``lab``."""
    assert Profile() == Profile.named("lab")


@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
def test_a_field_out_of_range_is_refused_by_name(value: float) -> None:
    """The error of a negative or non-finite number names the field."""
    with pytest.raises(ValueRangeError, match="wind_std_mps2"):
        Profile(wind_std_mps2=value)


def test_limits_must_not_be_zero() -> None:
    """A limit of zero would prevent all movements."""
    with pytest.raises(ValueRangeError, match="max_speed_mps must be a positive"):
        Profile(max_speed_mps=0.0)
