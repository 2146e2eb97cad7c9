"""One run: what is asked for (study), one iteration (loop), all of them, stopped and resumed (session).

The results of a run are a pure function of its `Run`.
"""
