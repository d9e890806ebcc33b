"""Contract packs and their files: ledger, classes, requirement sets, sections."""
