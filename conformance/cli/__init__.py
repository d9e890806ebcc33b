"""The commands certify, contract, explain, judge and replay."""
