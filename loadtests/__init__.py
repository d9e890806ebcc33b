"""Load tests: how fast a robot answers over SOAP and over REST, up to which load, and how sure we are.

Nothing here imports the conformance suite's checks or the reference robot; the contract's files are the only
thing shared. The modules read from bottom to top: `endpoint`, `wire` and `ordinary` talk HTTP; `payloads`
builds what they send; `plan` and `arrivals` say when; `pacer` starts it on time; `recorder` keeps what
happened; `resampling` and `summary` turn that into figures; `engine` runs it all on Locust.
"""
