"""A response found: `levels` from grey levels, `passive` from a reference, `periods` blind."""
