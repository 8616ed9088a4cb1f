"""Pairs of bodies that hit each other. A body of another tool at a rigid stop is a pair whose second body stays.

`pair` is one pair, `all_pairs` all pairs of a run. `ends` are the contact points of a pair, `meeting` finds the
instant of contact. `force` is the mutual force in a contact. `rigid_stops` are pairs with one body that never moves.
"""
