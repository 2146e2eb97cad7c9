"""Many runs in one folder: which are missing, where they are computed, what they were made with.

Experiments, engine, manifest, progress, `-m` and search are here.
"""
