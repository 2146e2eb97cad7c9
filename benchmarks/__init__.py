"""Measured speeds; run by `make bench`."""
