"""Conversion between ROS messages and JSON, XML and text: shapes, strict reading, writing.

All conversions pass through *plain data*: dicts by field name, lists, str, int, float and bool.
"""
