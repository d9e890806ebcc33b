"""Load tests: how fast a robot answers over SOAP and over REST, up to which load, and how sure we are.

Of the other rooms only the contract is imported. From the ground up, none importing what stands above it: `clients`
send requests and tell what came of them; `schedule` says when each is due and starts it then; `statistics` record what
happened and turn it into quantiles, intervals and verdicts; `settings` say what is asked for; `measuring` carries plans
out with Locust's users, here or on other machines; `result` makes latency.json of it; `engine` runs all this in a
process of its own, which `cli` starts. `locustfile` and `node` are for Locust and its Kubernetes operator to call.
"""
