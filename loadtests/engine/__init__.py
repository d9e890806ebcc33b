"""One run from settings to the written result: addresses, plan, measurement, exit code."""
