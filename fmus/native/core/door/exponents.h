/* Lyapunov exponents of a motion, from its impacts: equations.md 4.2, 4.11. */
#ifndef VIBROIMPACT_EXPONENTS_H
#define VIBROIMPACT_EXPONENTS_H

#include "door/door.h"
#include "door/orbit_response.h"

/* Impacts in their order. Between two of them the motion is that of the modes, and each takes (1 + restitution) velocity
 * off it: with these given the state follows from the past, and what was wrong of it decays. */
typedef struct {
    int64_t impacts;
    const int32_t *contact;
    const double *phase;    /* of the force, rad, in [0, 2 pi) */
    const double *elapsed;  /* from the impact before, s; of the first not read */
    const double *velocity; /* towards the stop, m/s, > 0 */
} vi_orbit_run;

/* Go on along impacts first to last - 1 (first >= 1). `state`: after impact first - 1, afterwards after the last one.
 * `directions`[2 modes][2 modes], columns, orthonormal: as `state`. `stretch`[2 modes]: logarithms of what the directions
 * are stretched by are added to it, the largest first. Returns one of VI_ORBIT_*. */
VI_DOOR int vi_door_exponents(const vi_orbit_body *body, const vi_orbit_run *run, int64_t first, int64_t last,
                              double state[], double directions[], double stretch[]);

#endif
