"""The self-check of followed branches: index sums of the strobe map, equations.md 4.14. `index_check` is the way in."""
