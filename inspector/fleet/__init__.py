"""Many drives: which they are, what was done already, who does the rest, and one table, page and catalogue of all."""
