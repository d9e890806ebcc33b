"""The proof for the paper's robot: mutants, independent robots, faulty bodies."""
