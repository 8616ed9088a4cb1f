/* Distances and speeds that the impacts of a train cause at its contacts, and the place of modes without a spring. */
#ifndef VIBROIMPACT_ORBIT_PLACING_H
#define VIBROIMPACT_ORBIT_PLACING_H

#include <stdbool.h>

#include "door/orbit_response.h"

/* Displacements that the modes without a spring give to the contacts of the impacts: q r, with orthonormal columns q. */
typedef struct {
    double q[VI_MODES][VI_ORBIT_IMPACTS], r[VI_MODES][VI_MODES];
} vi_orbit_placing;

/* Displacement at the contact of impact i for a unit speed of impact k, with its first and second time derivatives. */
void vi_orbit_answer(const vi_orbit_response *response, int i, int k, double g[3]);

/* Find the displacements; false where no impact tells the position of a mode, or two modes move all contacts alike. */
bool vi_orbit_find_placing(const vi_orbit_response *response, vi_orbit_placing *found);

/* Put the modes where the squares of the distances[impact][stride] have their least sum. `place`: their displacements. */
void vi_orbit_put_in_place(const vi_orbit_response *response, const vi_orbit_placing *placed, double distance[],
                           int stride, double place[]);

/* Let the modes drift for one radian by the momentum that a train adds. The momentum follows from the
 * speeds[impact] of equal impulse, and from `held` times the constant forces. The drift is 0 for an orbit. */
void vi_orbit_drift(const vi_orbit_response *response, const double speed[], double held, double distance[],
                    int stride);

/* Put the modes without a spring where the impacts are at their stops; state[impact][2 modes]. */
void vi_orbit_place_states(const vi_orbit_response *response, const vi_orbit_placing *placed, double state[]);

#endif
