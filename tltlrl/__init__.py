"""Learn robot behaviour from truncated linear temporal logic (TLTL) specifications."""
