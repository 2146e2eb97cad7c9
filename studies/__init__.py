"""Research scripts and the tables that they have measured: what the pages in docs/ rest on.

Run from a checkout as `python -m studies.NAME`; nothing in tltlrl imports them.
"""
