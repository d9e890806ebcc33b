"""Load tests: how fast a robot responds over SOAP and over REST, up to which load, and how certain the figures are.

The rooms from the ground up; none imports what stands above it:

- `clients` send requests and return the outcome;
- `schedule` decides when each request is due, and starts it then;
- `statistics` record outcomes and turn them into quantiles, intervals and verdicts;
- `settings` hold what is asked for;
- `measuring` carries plans out with Locust's users, on this machine or on others;
- `result` makes latency.json;
- `engine` runs all this in a process of its own, which `cli` starts.

Locust loads `locustfile`, and its Kubernetes operator starts `node`.
"""
