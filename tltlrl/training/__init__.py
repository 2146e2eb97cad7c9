"""One run: what is asked for (study), sample, score, tell, record (loop), go on (session).

A run is a pure function of its `Run`.
"""
