"""Make a device's description into operations to measure, by the rules and with the code of `roaas certify`."""
