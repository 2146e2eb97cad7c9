"""The files of a run and of an experiment: one layout, one lock, one digest, atomic writes.

Nothing here knows what the numbers mean.
"""
