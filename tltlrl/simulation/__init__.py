"""Policy and task in, trajectories out: batches in closed loop, and trials of what was learned.

Nothing here learns or judges.
"""
