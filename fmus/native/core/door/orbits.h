/* Periodic orbits of a body of N modes that hits restitution stops p times in q forcing periods.
 *
 * The unknowns are the phases of the impacts alone. Each impact is an impulse, and the response of a mode to a periodic
 * train of impulses is closed (equations.md 4.7): the velocities follow from the phases by p linear equations, and what
 * is left is that the contact is at its stop at each impact. None of it divides by a velocity, so an orbit may be
 * followed to a graze and through it. Stability is that of the flow with the saltation matrices of 4.2.
 */
#ifndef VIBROIMPACT_ORBITS_H
#define VIBROIMPACT_ORBITS_H

#include <stdint.h>

#include "door/door.h"
#include "sizes.h"

enum { VI_ORBIT_IMPACTS = 64, VI_ORBIT_STATES = 2 * VI_MODES };

/* What a call ends with. */
enum {
    VI_ORBIT_DONE = 0,
    VI_ORBIT_REFUSED = 1,  /* numbers out of their range */
    VI_ORBIT_RESONANT = 2, /* an undamped mode answers the force, or its impacts, without bound */
    VI_ORBIT_SINGULAR = 3  /* no velocities belong to these phases */
};

/* A body of mass-normalised modes; shapes are [contact][mode]. */
typedef struct {
    int32_t modes, contacts;
    double angular_frequency;     /* of the force, rad/s */
    const double *natural;        /* [modes] rad/s, > 0 */
    const double *damping_ratio;  /* [modes] */
    const double *cosine, *sine;  /* [modes] modal force = cosine cos(phase) + sine sin(phase) */
    const double *held;           /* [modes] constant modal force */
    const double *shape;          /* displacement of each contact */
    const double *impulse;        /* modal velocities that a unit of velocity at the contact takes: shape . impulse = 1 */
    const double *direction;      /* [contacts] +1: the stop is above, -1: below */
    const double *position;       /* [contacts] m */
    const double *restitution;    /* [contacts] */
} vi_orbit_body;

/* Impacts in their order: of which contact, and at which phase, rad, 0 <= phase[0] < phase[1] < ... < 2 pi periods. */
typedef struct {
    int32_t impacts, periods;
    const int32_t *contact;
    const double *phase;
} vi_orbit_train;

/* What belongs to the phases: approach speeds before the impacts, m/s; distances beyond the stops at the impacts, m, 0 of
 * an orbit; and their derivatives [impacts][impacts] over the phases. */
VI_DOOR int vi_door_orbit(const vi_orbit_body *body, const vi_orbit_train *train, double velocity[], double distance[],
                          double distance_slope[], double velocity_slope[]);

/* The motion of an orbit: modal displacements and velocities after each impact, state[impact][2 modes]; derivative of the
 * state after the first impact over the one a train before, monodromy[2 modes][2 modes], NaN where a speed is 0. */
VI_DOOR int vi_door_orbit_motion(const vi_orbit_body *body, const vi_orbit_train *train, const double velocity[],
                                 double state[], double monodromy[]);

/* Largest displacement beyond a stop (m, negative: clearance) among all maxima inside the flights of an orbit, kinks at
 * impacts of other contacts included: what[0], its phase what[1], its contact what[2]; -infinity, 0, -1 without any. All
 * maxima are found: pieces are bounded by the third derivative. */
VI_DOOR int vi_door_orbit_maximum(const vi_orbit_body *body, const vi_orbit_train *train, const double state[],
                                  double what[3]);

#endif
