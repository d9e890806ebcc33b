"""Conversion between ROS messages and JSON, XML and text: types of fields, strict reading, writing.

All conversions pass through *plain data*, as json.loads returns it: dicts by field name, lists, str, int, float, bool.
"""
