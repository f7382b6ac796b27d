"""The removed module of class constants; importing it names the successors."""

raise ImportError(
    "uav_bt.classes is gone, because classes belong to a lab: use `class_map.is_ground`, "
    "`class_map.roles` with the constants of uav_bt.lab.roles, and "
    "`class_map.classes.id_of('box_1')` for the id of a class"
)
