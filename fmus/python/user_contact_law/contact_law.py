"""A contact law of your own: copy this file, change the function, make it an FMU.

vibroimpact.fmus.packaging.python_fmus.build_user_contact_law("contact_law.py", "my_law.fmu")
"""


def contact_law(displacement: float, velocity: float) -> float:
    """Return the coefficient of restitution of an impact: 0 (dead) to 1 (elastic).

    Parameters
    ----------
    displacement : float
        Displacement of the contact point, m.
    velocity : float
        Speed of approach just before the impact, m/s, >= 0. Every speed needs an answer, 0 too.
    """
    # metals: slow impacts are elastic, fast ones lose more (W. Goldsmith, Impact, 1960)
    return 1.0 / (1.0 + 0.2 * float(velocity**0.25))
