"""Policy and task in, trajectories out: batches in closed loop, and trials of what was learned.

Nothing here learns or judges.
"""

import tltlrl.tasks  # noqa: F401  # which chooses the renderer, before anything imports mujoco
