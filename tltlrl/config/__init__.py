"""What the user wrote, checked: from overrides and YAML to what is asked for.

Keys, their meanings and their bounds; nothing is run here.
"""
