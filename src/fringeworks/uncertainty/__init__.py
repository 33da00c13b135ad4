"""How well points are known, and what from: random, systematic, by source and by depth."""
