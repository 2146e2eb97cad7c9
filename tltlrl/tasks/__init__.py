"""What is simulated: the contract of a task, planar_arm, toast, and the views of a task for others.

Nothing here trains or judges.
"""

from tltlrl.tasks.headless import choose_renderer

choose_renderer()  # before anything imports dm_control
