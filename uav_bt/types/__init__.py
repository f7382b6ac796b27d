"""The vocabulary: immutable values that travel from the drone to the board, the leaves and back.

Conventions (see ``ARCHITECTURE.md``): metres, radians, seconds of the mission clock. The body frame
is Parrot's: x forward, y right, z down, yaw clockwise positive seen from above. Images are RGB.
"""

from uav_bt.types.camera import CameraModel as CameraModel
from uav_bt.types.camera import ClassMap as ClassMap
from uav_bt.types.camera import Corridor as Corridor
from uav_bt.types.camera import DepthMap as DepthMap
from uav_bt.types.camera import Frame as Frame
from uav_bt.types.commands import HOVER as HOVER
from uav_bt.types.commands import Command as Command
from uav_bt.types.commands import CutMotors as CutMotors
from uav_bt.types.commands import GimbalTo as GimbalTo
from uav_bt.types.commands import Hover as Hover
from uav_bt.types.commands import Land as Land
from uav_bt.types.commands import MissionPhase as MissionPhase
from uav_bt.types.commands import MoveBy as MoveBy
from uav_bt.types.commands import Movement as Movement
from uav_bt.types.commands import Release as Release
from uav_bt.types.commands import TakeOff as TakeOff
from uav_bt.types.commands import Velocity as Velocity
from uav_bt.types.drone_state import Attitude as Attitude
from uav_bt.types.drone_state import BodyVelocity as BodyVelocity
from uav_bt.types.drone_state import DroneFault as DroneFault
from uav_bt.types.drone_state import DroneState as DroneState
from uav_bt.types.drone_state import FlyingState as FlyingState
from uav_bt.types.drone_state import MeasurementTimes as MeasurementTimes
from uav_bt.types.drone_state import MovementState as MovementState
from uav_bt.types.drone_state import MovementStatus as MovementStatus
from uav_bt.types.observation import MoverState as MoverState
from uav_bt.types.observation import Observation as Observation
from uav_bt.types.observation import PastView as PastView
from uav_bt.types.observation import RecentViews as RecentViews
from uav_bt.types.observation import Truth as Truth
from uav_bt.types.pose import Pose as Pose
from uav_bt.types.pose import Pose2D as Pose2D
from uav_bt.types.pose import clamp as clamp
from uav_bt.types.pose import limit_length as limit_length
from uav_bt.types.pose import rotate as rotate
from uav_bt.types.pose import rotate_points as rotate_points
from uav_bt.types.pose import rotation as rotation
from uav_bt.types.pose import wrap_angle as wrap_angle
from uav_bt.types.pose import wrap_angles as wrap_angles
from uav_bt.types.site_map import MapMark as MapMark
from uav_bt.types.site_map import MapObject as MapObject
from uav_bt.types.site_map import SiteMap as SiteMap
from uav_bt.types.sizes import NARROWER_M as NARROWER_M
from uav_bt.types.sizes import Airframe as Airframe
from uav_bt.types.sizes import Clearances as Clearances
from uav_bt.types.sizes import LandingMark as LandingMark
from uav_bt.types.surroundings import MIN_VIEW_HEIGHT_M as MIN_VIEW_HEIGHT_M
from uav_bt.types.surroundings import HeldTurn as HeldTurn
from uav_bt.types.surroundings import MarkFix as MarkFix
from uav_bt.types.surroundings import NearObstacles as NearObstacles
