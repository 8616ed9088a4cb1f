#include "contact_law.h"

double vi_contact_law_restitution(const vi_contact_law *law, double approach_velocity)
{
    (void)approach_velocity; /* Newton's law does not depend on it */
    return law->restitution;
}

bool vi_contact_law_known(int64_t law)
{
    return law == VI_LAW_RESTITUTION;
}

double vi_contact_direction(int64_t side)
{
    return side == VI_SIDE_LOWER ? -1.0 : 1.0;
}
