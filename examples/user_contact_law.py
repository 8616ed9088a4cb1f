"""A contact law in Python: a harder blow rebounds less. This command makes the FMU for user_contact_law.toml:

vibroimpact fmu export user-contact-law --law examples/user_contact_law.py -o examples/user_contact_law.fmu
"""


def contact_law(displacement: float, velocity: float) -> float:
    """Return the coefficient of restitution for a speed of approach (m/s)."""
    return max(0.3, 0.9 - 0.25 * velocity)
