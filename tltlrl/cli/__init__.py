"""The commands, one module each: arguments in, results and messages out.

Nothing is computed here. What is slow to import is imported where it is used, so that mistakes are reported at once.
"""
