"""Show that the suite notices faulty devices and blames no good one: what `roaas selftest` runs."""
