/* Lyapunov exponents of a motion, from its impacts: equations.md 4.2, 4.11. */
#ifndef VIBROIMPACT_EXPONENTS_H
#define VIBROIMPACT_EXPONENTS_H

#include "door/door.h"
#include "door/orbit_response.h"

/* Impacts in their order. Between two impacts the modes move freely, and each impact takes (1 + restitution)
 * velocity, where restitution may fall with speed. With these impacts given, the state follows from the past, and its errors decay. */
typedef struct {
    int64_t impacts;
    const int32_t *contact;
    const double *phase;    /* of the force, rad, in [0, 2 pi) */
    const double *elapsed;  /* since the impact before, s; unused for the first impact */
    const double *velocity; /* relative to the stop, towards it, m/s, > 0 */
} vi_orbit_run;

/* Continue along impacts first to last - 1 (first >= 1). `state`: after impact first - 1 on entry, after the last
 * impact on return; likewise the orthonormal columns `directions`[2 modes][2 modes]. `stretch`[2 modes]: the logarithms
 * of the stretches of the directions are added to it, the largest first. Returns one of VI_ORBIT_*. */
VI_DOOR int vi_door_exponents(const vi_orbit_body *body, const vi_orbit_run *run, int64_t first, int64_t last,
                              double state[], double directions[], double stretch[]);

#endif
