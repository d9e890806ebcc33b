"""The paper's robot: contract, descriptions, ledger, device model, checks, mutants, independent robots."""
