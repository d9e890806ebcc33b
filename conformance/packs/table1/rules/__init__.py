"""The checks that only the paper's robot is judged by, a folder for each conformance class."""
