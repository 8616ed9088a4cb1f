/* The ImpactStop component: evaluates a contact law, resolves nothing. */
#ifndef VIBROIMPACT_IMPACT_STOP_H
#define VIBROIMPACT_IMPACT_STOP_H

#include "contact_law.h"

/* All of an ImpactStop's variables (variables.toml says what each is). */
typedef struct {
    double time;
    vi_contact_law law;
    double displacement, velocity;               /* inputs */
    double applied_restitution, applied_force; /* outputs */
} impact_stop;

#endif
