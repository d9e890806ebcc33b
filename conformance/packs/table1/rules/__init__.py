"""The checks that only the paper's robot is judged by, in a folder for each conformance class."""
