"""Conforming robots that share no code with the reference robot or with the suite, and need no ROS.

Each takes other freedoms of the contract, so that the suite learns to allow them; each is built on another technology.
What they share among themselves is a body to move (body.py), which knows nothing of the web.
"""
