"""Load tests: how fast a robot responds over SOAP and over REST, up to which load, and how certain the figures are.

The packages from the lowest layer up; none imports a package above it:

- `clients` send requests and return the outcome;
- `schedule` decides when each request is due, and starts it then;
- `statistics` record outcomes and turn them into quantiles, intervals and verdicts;
- `settings` hold the options of a run;
- `measuring` carries plans out with Locust's users, on this machine or on others;
- `result` makes latency.json;
- `engine` runs a load test in its own process, which `cli` starts.

Locust loads `locustfile`, a scenario imports `scenario`, and its Kubernetes operator starts `node`.
"""
