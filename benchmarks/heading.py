"""Identify the twin's yaw response, print the heading loop's margins, and fly steps.

    python -m benchmarks.heading [--image docs/images/heading_step.png]

Needs the `design` extra.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from behaviours.fly.heading_control import HeadingGains
from benchmarks.heading_design import (
    StepResponse,
    YawResponse,
    identify,
    margins,
    step_metrics,
    step_response,
)
from benchmarks.heading_trial import fly_step, hover, record_yaw
from sim_bridge.twin import TwinConfig
from uav_bt.protocols import Drone

PROFILES = ("ideal", "lab", "harsh")
STEPS_DEG = (20.0, 90.0, 170.0)
PICTURED_DEG = 90.0
REPEATS = 6


def main() -> None:
    """Print the table and write the picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--image", type=Path, default=Path("docs/images/heading_step.png"))
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()

    gains = HeadingGains()
    print(
        f"gains: P {gains.proportional} /s, I {gains.integral} /s2, D {gains.derivative}, "
        f"limit {gains.max_yaw_rate_radps} rad/s"
    )
    flown = {profile: _try_profile(profile, arguments.seed, gains) for profile in PROFILES}
    arguments.image.parent.mkdir(parents=True, exist_ok=True)
    _draw(arguments.image, gains, flown)
    print(f"picture: {arguments.image}")


def _try_profile(profile: str, seed: int, gains: HeadingGains) -> tuple[YawResponse, StepResponse]:
    """Print a profile's figures; return its response and the step for the picture."""
    # Nothing looks at the video here, so it is small.
    drone = TwinConfig(profile=profile, seed=seed, image_size_px=(64, 36)).create()
    drone.connect()
    hover(drone)
    recording = record_yaw(drone)
    response = identify(recording.times_s, recording.commands_radps, recording.yaws_rad)
    modelled = response.turned(recording.times_s, recording.commands_radps)
    residual = np.unwrap(recording.yaws_rad) - modelled
    loop = margins(gains, response)
    print(
        f"\n{profile}: dead time {1000 * response.dead_time_s:.0f} ms, "
        f"lag {1000 * response.lag_s:.0f} ms, gain {response.gain:.2f} "
        f"(fits the heading to {math.degrees(residual.std()):.2f} deg rms)\n"
        f"  gain margin {loop.gain_margin_db:.1f} dB, "
        f"phase margin {math.degrees(loop.phase_margin_rad):.0f} deg, "
        f"crossover {loop.crossover_radps:.2f} rad/s\n"
        f"  {'step':>8} {'rise s':>8} {'overshoot %':>12} {'settling s':>11}"
        f"   (mean of {REPEATS} steps)"
    )
    for step_deg in STEPS_DEG:
        figures = step_metrics(_mean_step(drone, gains, step_deg), math.radians(step_deg))
        print(
            f"  {step_deg:>4.0f} deg {figures.rise_time_s:>8.2f} "
            f"{100 * figures.overshoot:>12.1f} {figures.settling_time_s:>11.2f}"
        )
    pictured = fly_step(drone, gains, step_rad=math.radians(PICTURED_DEG))
    drone.disconnect()
    return response, pictured


def _mean_step(drone: Drone, gains: HeadingGains, step_deg: float) -> StepResponse:
    """Return the mean of steps to either side, so that the compass's noise does not decide."""
    sides = [1.0 if repeat % 2 == 0 else -1.0 for repeat in range(REPEATS)]
    steps = [fly_step(drone, gains, step_rad=side * math.radians(step_deg)) for side in sides]
    return StepResponse(
        times_s=steps[0].times_s,
        yaws_rad=np.mean([s.yaws_rad * side for s, side in zip(steps, sides, strict=True)], axis=0),
        commands_radps=np.mean(
            [s.commands_radps * side for s, side in zip(steps, sides, strict=True)], axis=0
        ),
    )


def _draw(
    path: Path, gains: HeadingGains, flown: dict[str, tuple[YawResponse, StepResponse]]
) -> None:
    import matplotlib as mpl  # noqa: PLC0415 - slow to import

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415 - after the backend is chosen

    step_rad = math.radians(PICTURED_DEG)
    figure, (heading, rate) = plt.subplots(2, 1, figsize=(7, 5), sharex=True, layout="constrained")
    for colour, (profile, (response, flight)) in zip(
        ("tab:green", "tab:blue", "tab:red"), flown.items(), strict=True
    ):
        model = step_response(gains, response, step_rad=step_rad)
        heading.plot(flight.times_s, np.degrees(flight.yaws_rad), color=colour, label=profile)
        heading.plot(model.times_s, np.degrees(model.yaws_rad), color=colour, lw=0.8, ls=":")
        rate.step(flight.times_s, flight.commands_radps, where="post", color=colour)
    heading.axhline(PICTURED_DEG, color="0.6", lw=0.8)
    heading.set(ylabel="turned, degrees", title="Heading step in the twin (dotted: the model)")
    heading.legend(title="profile", loc="lower right")
    rate.set(xlabel="time, s", ylabel="commanded, rad/s")
    for axes in (heading, rate):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    main()
