"""Mutants by rule: every operator at every field, status, header and operation that the contract's files name."""
