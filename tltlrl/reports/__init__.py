"""From files to tables, figures, pages and films.

What is shown is computed here from what runs have left, and nothing is trained.
"""
