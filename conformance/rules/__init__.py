"""The checks: plain pytest modules, each bound by a marker to the requirements that it judges."""
