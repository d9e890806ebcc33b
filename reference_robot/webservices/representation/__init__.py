"""ROS messages as JSON, XML and text, and back: shapes, strict reading, writing.

Between ROS and the wire stands *plain data*: dicts by field name, lists, str, int, float and bool.
"""
