"""The ways in which a scene can be simulated: by its own runner, by other couplings and integrators, as other models.

`way` is a way and how it is opened, `all_ways` lists those of a scene with their settings.
"""
