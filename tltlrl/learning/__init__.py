"""How policies are learned: the contract of a learner, policies, REPS.

Needs NumPy and SciPy alone; knows no task, spec or file.
"""
