"""The suite's commands: certify, contract, selftest."""
