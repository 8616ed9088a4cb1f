/* Periodic orbits of a body of N modes that hits restitution stops p times in q forcing periods.
 *
 * The unknowns are the phases of the impacts alone. Each impact is an impulse, and the response of a mode to a periodic
 * train of impulses is closed (equations.md 4.7): the velocities follow from the phases by p linear equations, and what
 * is left is that the contact is at its stop at each impact. None of it divides by a velocity, so an orbit may be
 * followed to a graze and through it. Stability is that of the flow with the saltation matrices of 4.2.
 */
#ifndef VIBROIMPACT_ORBITS_H
#define VIBROIMPACT_ORBITS_H

#include "door/door.h"
#include "door/orbit_response.h"

/* What belongs to the phases: approach speeds before the impacts, m/s; distances beyond the stops at the impacts, m, 0 of
 * an orbit; and their derivatives [impacts][impacts] over the phases. */
VI_DOOR int vi_door_orbit(const vi_orbit_body *body, const vi_orbit_train *train, double velocity[], double distance[],
                          double distance_slope[], double velocity_slope[]);

/* The motion of an orbit: modal displacements and velocities after each impact, state[impact][2 modes]; derivative of the
 * state after the first impact over the one a train before, monodromy[2 modes][2 modes], NaN where a speed is 0. */
VI_DOOR int vi_door_orbit_motion(const vi_orbit_body *body, const vi_orbit_train *train, const double velocity[],
                                 double state[], double monodromy[]);

#endif
