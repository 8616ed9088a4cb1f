/* The smallest bounces of a contact that can be followed. */
#ifndef VIBROIMPACT_STRUCTURE_RESOLUTION_H
#define VIBROIMPACT_STRUCTURE_RESOLUTION_H

#include "body/modal/state.h"

/* Largest difference of displacements that double precision cannot resolve at contact k, m. Its bounce begins at this
 * speed, m/s, and is pressed back with this acceleration, m/s^2. */
double vi_structure_resolution(const vi_structure *s, int k, double pressure, double speed);

/* Smallest resolved height of such a bounce, m: limited by rounding, or by the integrator of model exchange. */
double vi_structure_bounce_resolution(const vi_structure *s, int k, double pressure, double rebound);

#endif
