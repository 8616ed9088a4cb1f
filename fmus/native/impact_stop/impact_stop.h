/* The ImpactStop component: evaluates a contact law, resolves nothing. */
#ifndef VIBROIMPACT_IMPACT_STOP_H
#define VIBROIMPACT_IMPACT_STOP_H

#include "contact/contact_law.h"

/* All variables of an ImpactStop, described in variables.toml. */
typedef struct {
    double time;
    vi_contact_law law;
    double position;
    int64_t side;
    double displacement, velocity; /* inputs */
    double applied_restitution;    /* outputs */
    vi_contact_force applied;
} impact_stop;

#endif
