"""What to think of a solution: errors, findings, causes, and how well it is known."""
