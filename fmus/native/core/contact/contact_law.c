#include "contact/contact_law.h"

#include <math.h>

double vi_contact_law_restitution(const vi_contact_law *law, double approach_velocity)
{
    if (law->yield_velocity > 0.0 && approach_velocity > law->yield_velocity) {
        return law->restitution / sqrt(sqrt(approach_velocity / law->yield_velocity));
    }
    return law->restitution;
}

vi_contact_force vi_contact_law_force(const vi_contact_law *law, double penetration, double rate)
{
    vi_contact_force f = {0.0, 0.0, 0.0};
    if (!(penetration > 0.0)) {
        return f;
    }
    if (law->law == VI_LAW_KELVIN_VOIGT) {
        f = (vi_contact_force){law->stiffness * penetration + law->damping * rate, law->stiffness, law->damping};
    } else if (law->law == VI_LAW_HERTZ) {
        const double root = sqrt(penetration);
        f = (vi_contact_force){law->stiffness * penetration * root, 1.5 * law->stiffness * root, 0.0};
    } else if (law->law == VI_LAW_HUNT_CROSSLEY) {
        const double spring = law->stiffness * pow(penetration, law->exponent);
        const double drag = 1.0 + law->damping * rate;
        f = (vi_contact_force){spring * drag, law->exponent * spring / penetration * drag, spring * law->damping};
    }
    return f.force > 0.0 ? f : (vi_contact_force){0.0, 0.0, 0.0};
}

bool vi_contact_law_known(int64_t law)
{
    return law == VI_LAW_RESTITUTION || vi_contact_law_is_compliant(law);
}
