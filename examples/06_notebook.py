"""A flight examined cell by cell. Editors run `# %%` cells like those of a notebook."""

# %% Fly a mission. Each tick gives its listeners a record.
from pathlib import Path

import matplotlib.pyplot as plt

from uav_bt import app
from uav_bt.mission.runner import TickRecord


class Notes:
    """Keeps all ticks of a flight."""

    def __init__(self) -> None:
        self.ticks: list[TickRecord] = []

    def on_tick(self, record: TickRecord) -> None:
        self.ticks.append(record)


notes = Notes()
options = app.FlightOptions(scene="train-b", exact_masks=True, image_size_px=(320, 180))
# With video="flight.mp4" the flight is filmed as well.
report = app.fly("hover_and_look", options, listeners=[lambda _: [notes]])
print(report.outcome, f"in {report.duration_s:.0f} s, {len(notes.ticks)} ticks")

# %% Height: telemetry and truth.
times = [tick.time_s for tick in notes.ticks]
states = [tick.observation.state for tick in notes.ticks]
poses = [tick.truth.pose for tick in notes.ticks if tick.truth is not None]
figure, (heights, path) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
heights.plot(times, [state.height_above_carpet_m for state in states], label="telemetry")
heights.plot(times, [pose.z_m for pose in poses], label="true")
heights.set(xlabel="time, s", ylabel="height, m")
heights.legend()

# %% The path over the carpet, seen from above.
path.plot([pose.x_m for pose in poses], [pose.y_m for pose in poses])
path.set(xlabel="x, m", ylabel="y, m", aspect="equal")

# %% Save the figure.
out = Path("out")
out.mkdir(exist_ok=True)
figure.savefig(out / "hover_and_look.png", dpi=120)
