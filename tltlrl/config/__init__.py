"""Reads and checks what the user wrote: overrides and YAML => a study.

Keys, their meanings and their bounds are here. Nothing is run here.
"""
