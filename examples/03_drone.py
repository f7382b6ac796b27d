"""A drone: any class with these members. This one wraps another drone and keeps a logbook."""

from uav_bt import app
from uav_bt.protocols import Clock, Drone, Referee, Scene
from uav_bt.testing import ScriptedDrone
from uav_bt.types import Airframe, CameraModel, Command, MoveBy, Observation

MISSION = """
<root BTCPP_format="4">
  <BehaviorTree ID="LookRound">
    <Sequence>
      <Rules land_on="any"/>
      <TakeOff height_m="1.0"/>
      <Turn degrees="90"/>
      <Turn degrees="-90"/>
      <Land/>
    </Sequence>
  </BehaviorTree>
</root>
"""


class Logbook:
    """Flies as another drone does and records its movements."""

    live = False  # True: checked before it takes off, as a real drone is
    tick_s = None  # ticks at the mission's rate

    def __init__(self, drone: Drone) -> None:
        self._drone = drone
        self.movements: list[MoveBy] = []

    @property
    def clock(self) -> Clock:
        return self._drone.clock

    @property
    def camera(self) -> CameraModel:
        return self._drone.camera

    @property
    def airframe(self) -> Airframe:
        return self._drone.airframe

    @property
    def referee(self) -> Referee | None:
        return self._drone.referee

    @property
    def scene(self) -> Scene | None:
        return self._drone.scene

    def connect(self) -> None:
        self._drone.connect()

    def observe(self) -> Observation:
        return self._drone.observe()

    def send(self, command: Command) -> Command:
        move = command.movement
        if isinstance(move, MoveBy) and move not in self.movements:
            self.movements.append(move)
        return self._drone.send(command)

    def disconnect(self) -> None:
        self._drone.disconnect()


if __name__ == "__main__":
    drone = Logbook(ScriptedDrone())  # a drone in numbers only, for tests
    report = app.fly(MISSION, app.FlightOptions(drone=drone))
    # The last movement comes from Land: it moves the body to where the camera, mounted ahead, was.
    print(report.outcome, *drone.movements, sep="\n")
