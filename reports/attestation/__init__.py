"""Signed certificates: keys, the signed statement, its envelope, and the policy by which a relying party judges it."""
