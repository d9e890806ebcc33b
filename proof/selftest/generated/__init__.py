"""Generated mutants: every operator applied to every field, status and header that the pack's descriptions name."""
