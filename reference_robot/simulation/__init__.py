"""The simulated robot: a differential-drive base, navigation and the delivery application, as ROS nodes.

Modules without ROS: ``office`` (the map), ``planner``, ``pursuit``, ``kinematics``, ``missions``. Modules with ROS
nodes: ``base``, ``sensors``, ``frames``, ``navigation``, ``planning``, ``delivery``. ``runner`` creates all nodes.
Nothing in this package depends on the web services.
"""
