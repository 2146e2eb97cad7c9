"""A task and a learner for tltlrl, in a package of their own: task.py and cem.py."""
