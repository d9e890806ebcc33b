"""When requests start: the plan of segments, arrivals, and the pacer that keeps to them."""
