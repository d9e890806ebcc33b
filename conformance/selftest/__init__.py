"""Proof of the suite's quality: it catches faulty robots and blames no conforming one."""
