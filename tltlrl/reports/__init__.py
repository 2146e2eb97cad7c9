"""Files of runs => tables, figures, pages and films.

Everything shown is computed here from the files of runs. Nothing is trained here.
"""
