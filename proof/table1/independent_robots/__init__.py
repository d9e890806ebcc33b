"""Conforming robots that share no code with the reference robot or with the suite, and need no ROS.

Each takes other freedoms of the contract, so that the suite learns to allow them, on another server. Those in Python
share a body to move (body.py) and, but for `legacy`, the handlers of `plain`; `node` and `golang` share nothing.
"""
