"""The SOAP interface: envelopes and faults (SOAP 1.1, WS-I Basic Profile 1.1), and the contract's two services."""
