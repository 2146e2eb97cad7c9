"""How policies are learned: the contract of a learner, policies, REPS, CMA-ES.

This package needs only NumPy and SciPy, and knows no task, spec or file.
"""
