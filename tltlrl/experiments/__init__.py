"""Many runs in one folder: which are missing, where they are computed, who made them.

Experiments, engine, manifest, progress, `-m` and search.
"""
