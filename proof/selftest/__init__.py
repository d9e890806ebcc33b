"""The self-test shows that the suite kills mutants (faulty devices) and has no false positives on good devices."""
