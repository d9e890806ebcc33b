"""The commands certify, replay, contract and selftest."""
