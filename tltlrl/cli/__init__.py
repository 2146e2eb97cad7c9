"""The commands, one module each: arguments in, results and messages out.

Nothing is computed here; only the dispatcher `main` imports late.
"""
