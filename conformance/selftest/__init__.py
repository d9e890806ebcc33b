"""Proof of the suite's quality: it catches mutants (faulty robots) and blames no conforming one."""
