"""One run: asked for (study, check), built (build, start), iterated (draw, loop), stopped, resumed (session, states),
judged (verdict) and made calm (calm). The results of a run are a pure function of its `Run`.
"""
