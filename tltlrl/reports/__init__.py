"""Files of runs => tables, figures, pages and films.

Everything shown comes from the files of runs; motions are simulated again. Nothing is trained here.
"""
