"""Pairs of bodies that hit each other, and bodies of other tools at rigid stops, which are pairs of one that stays.

`pair` is a pair, `all_pairs` all of a run, `ends` are their contact points, `meeting` finds where these meet.
`force` is what they hold on each other, `rigid_stops` are those of which one never moves.
"""
