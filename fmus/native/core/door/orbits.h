/* Periodic orbits of a body of N modes that hits restitution stops p times in q periods of the clock. Force and stops
 * are sums of sines of this period.
 *
 * The only unknowns are the phases of the impacts. Each impact is an impulse, and the response of a mode to a periodic
 * train of impulses has a closed form (equations.md 4.7). So p equations give the velocities from the phases. They are
 * linear where restitution is constant, and have one solution where it falls with speed.
 *
 * The remaining p equations put the contact at its stop at each impact. No equation divides by a velocity, so an orbit
 * may be followed to a graze and through it. Stability is that of the flow with the saltation matrices of 4.2.
 *
 * A mode without a spring has a position that nothing but the impacts tells. Its impulses must balance its constant
 * force over the train. The p equations hold both: see 4.7.
 */
#ifndef VIBROIMPACT_ORBITS_H
#define VIBROIMPACT_ORBITS_H

#include "door/door.h"
#include "door/orbit_response.h"

/* Find the approach speeds, relative to the stops, before the impacts, m/s, and the distances beyond the stops at the impacts, m, for given
 * phases. Distances are 0 for an orbit. *_slope: derivatives [impacts][impacts] over the phases. */
VI_DOOR int vi_door_orbit(const vi_orbit_body *body, const vi_orbit_train *train, double velocity[], double distance[],
                          double distance_slope[], double velocity_slope[]);

/* Distance of one impact beyond its stop over its phase, m: equations.md 4.3. */
typedef struct {
    double level;     /* without the impact, constant part */
    double answer[2]; /* distance and approach speed that a unit speed of equal impulse adds */
    /* distance at a constant restitution: level + the sum of cosine cos(order phase) + sine sin(order phase) */
    double cosine[VI_ORBIT_HARMONICS], sine[VI_ORBIT_HARMONICS];
    double steady_cosine[VI_ORBIT_HARMONICS], steady_sine[VI_ORBIT_HARMONICS]; /* the same of the steady motion */
} vi_orbit_wave;

/* Find the distance of one impact; `train` has this impact at any phase. An orbit has distance 0. */
VI_DOOR int vi_door_orbit_wave(const vi_orbit_body *body, const vi_orbit_train *train, vi_orbit_wave *wave);

/* Find the motion of an orbit: modal displacements and velocities after each impact, state[impact][2 modes].
 * monodromy[2 modes][2 modes]: derivative of the first state over that a train earlier; NaN where a speed is 0. */
VI_DOOR int vi_door_orbit_motion(const vi_orbit_body *body, const vi_orbit_train *train, const double velocity[],
                                 double state[], double monodromy[]);

#endif
