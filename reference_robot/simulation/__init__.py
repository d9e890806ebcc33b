"""The robot itself: a differential-drive base, navigation and the delivery application, as ROS nodes.

Pure parts: ``office`` (the map), ``planner``, ``pursuit``, ``kinematics``, ``missions``. Nodes on top of
them: ``base``, ``sensors``, ``frames``, ``navigation``, ``planning``, ``delivery``. ``runner`` puts the nodes together.
Nothing here knows of the web.
"""
