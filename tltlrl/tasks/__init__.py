"""What is simulated: the contract of a task, the tasks themselves, and their `dm_env` view.

Nothing here trains or judges.
"""

from tltlrl.tasks.headless import choose_renderer

choose_renderer()  # before anything imports dm_control
