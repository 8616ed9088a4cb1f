"""The ways to simulate a scene: by its own runner, by other couplings and integrators, as other models.

`way` defines a way and its opening, `all_ways` lists the ways of a scene with their settings.
"""
