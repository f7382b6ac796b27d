"""The mission board: typed keys, ages, proposals, and the context of leaves."""

from uav_bt.board.blackboard import Blackboard as Blackboard
from uav_bt.board.blackboard import Key as Key
from uav_bt.board.context import MissionContext as MissionContext
from uav_bt.board.keys import ADVICE as ADVICE
from uav_bt.board.keys import CAMERA as CAMERA
from uav_bt.board.keys import CLASS_MAP as CLASS_MAP
from uav_bt.board.keys import CORRIDOR as CORRIDOR
from uav_bt.board.keys import ELAPSED as ELAPSED
from uav_bt.board.keys import FLIGHT_HEIGHT as FLIGHT_HEIGHT
from uav_bt.board.keys import FLIGHT_PITCH as FLIGHT_PITCH
from uav_bt.board.keys import FRAME as FRAME
from uav_bt.board.keys import HEIGHT as HEIGHT
from uav_bt.board.keys import HELD_TURN as HELD_TURN
from uav_bt.board.keys import MARK as MARK
from uav_bt.board.keys import METRIC_DEPTH as METRIC_DEPTH
from uav_bt.board.keys import MISSION_KEYS as MISSION_KEYS
from uav_bt.board.keys import ODOMETRY as ODOMETRY
from uav_bt.board.keys import PERCEIVED_KEYS as PERCEIVED_KEYS
from uav_bt.board.keys import PHASE as PHASE
from uav_bt.board.keys import RAISED as RAISED
from uav_bt.board.keys import RECENT_VIEWS as RECENT_VIEWS
from uav_bt.board.keys import RELATIVE_DEPTH as RELATIVE_DEPTH
from uav_bt.board.keys import SITE_MAP as SITE_MAP
from uav_bt.board.keys import STATE as STATE
