/* What the modes of a body answer to its force and to a periodic train of impacts. */
#ifndef VIBROIMPACT_ORBIT_RESPONSE_H
#define VIBROIMPACT_ORBIT_RESPONSE_H

#include <stddef.h>

#include "door/orbits.h"
#include "motion/flow.h"

typedef struct {
    const vi_orbit_body *body;
    const vi_orbit_train *train;
    double length; /* of the train, s */
    vi_mode mode[VI_MODES];
    double steady_cos[VI_MODES], steady_sin[VI_MODES], level[VI_MODES];
    double start[VI_MODES][2]; /* displacement and velocity just after an impact, of a unit impulse in each train */
} vi_orbit_response;

/* Returns one of VI_ORBIT_*. */
int vi_orbit_respond(vi_orbit_response *response, const vi_orbit_body *body, const vi_orbit_train *train);

/* Time from impact k to impact i, s: above 0, and a whole train from an impact to itself. */
double vi_orbit_since(const vi_orbit_response *response, int i, int k);

/* Answer of mode j, `u` after the impact, to unit speeds taken off it, once in each train. */
void vi_orbit_train_answer(const vi_orbit_response *response, int j, double u, double *x, double *v);

/* Steady answer of mode j to the force. */
void vi_orbit_steady(const vi_orbit_response *response, int j, double phase, double *x, double *v);

/* Steady answer at the contact of impact i, in its direction: beyond the stop, and its first two derivatives. */
void vi_orbit_steady_at(const vi_orbit_response *response, int i, double at[3]);

#endif
