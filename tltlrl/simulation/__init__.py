"""Policy and task => trajectories: batches in closed loop, and trials of learned policies.

Nothing here learns or judges.
"""

import tltlrl.tasks  # noqa: F401  # it chooses the renderer before anything imports mujoco
