"""Where the drone is: dead reckoning and visual odometry."""
