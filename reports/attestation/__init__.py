"""Signed certificates: keys, the signed statement, its envelope, the policy that a relying party checks it by."""
