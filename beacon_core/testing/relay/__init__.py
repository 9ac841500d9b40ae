"""Suites for what other people write for the relay: conduits, and topic sides."""
