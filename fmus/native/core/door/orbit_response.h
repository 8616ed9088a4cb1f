/* Responses of a body's modes to its force and to a periodic train of impacts. */
#ifndef VIBROIMPACT_ORBIT_RESPONSE_H
#define VIBROIMPACT_ORBIT_RESPONSE_H

#include <stddef.h>
#include <stdint.h>

#include "door/orbit_coupling.h"
#include "motion/flow.h"
#include "sizes.h"

/* Most impacts of an orbit and contacts of a body; states of a body. */
enum { VI_ORBIT_IMPACTS = 64, VI_ORBIT_CONTACTS = 32, VI_ORBIT_STATES = 2 * VI_MODES };

/* Results of a call. */
enum {
    VI_ORBIT_DONE = 0,
    VI_ORBIT_REFUSED = 1,  /* numbers outside their range */
    VI_ORBIT_RESONANT = 2, /* an undamped mode's response to the force, or to its impacts, is unbounded */
    VI_ORBIT_SINGULAR = 3, /* no velocities solve the equations for these phases */
    VI_ORBIT_CRITICAL = 4, /* coupled modes next to critical damping, and far more rates than the force: no series */
    VI_ORBIT_ADRIFT = 5,   /* no impact of the train tells the position of a mode without a spring */
    VI_ORBIT_UNSOLVED = 6  /* the search for the velocities, where restitution falls with speed, did not end */
};

/* A body of mass-normalised modes; shapes are [contact][mode]. Force and stops move periodically, as sums of sines. Each
 * sine turns `order` times in a period of the clock: cosine cos(order phase) + sine sin(order phase). */
typedef struct {
    int32_t modes, contacts, harmonics;
    double angular_frequency;     /* of the clock, rad/s */
    const double *natural;        /* [modes] rad/s; modes of 0 (no spring) come first; < 0: of a negative spring */
    const double *damping_ratio;  /* [modes]; from the diagonal of a damping that couples the modes; 0: no spring */
    const double *order;          /* [harmonics] whole numbers >= 1 */
    const double *cosine, *sine;  /* [harmonics][modes] modal force */
    const double *held;           /* [modes] constant modal force */
    const double *shape;          /* displacement of each contact */
    const double *impulse; /* modal velocities that take a unit of velocity from the contact: shape . impulse = 1 */
    const double *direction; /* [contacts] +1: the stop is above, -1: below */
    const double *position; /* [contacts] m, mean position of each stop */
    const double *stop_cosine, *stop_sine; /* [harmonics][contacts] m, motion of each stop about its position */
    const double *restitution; /* [contacts] */
    const double *yield_velocity; /* [contacts] m/s, above which restitution falls with speed; 0: constant */
    const vi_orbit_coupling *coupling; /* complex modes where damping couples the modes that have springs, else NULL */
} vi_orbit_body;

/* Impacts in their order: the contact and the phase of each, rad, 0 <= phase[0] < phase[1] < ... < 2 pi periods. */
typedef struct {
    int32_t impacts, periods;
    const int32_t *contact;
    const double *phase;
} vi_orbit_train;

typedef struct {
    const vi_orbit_body *body;
    const vi_orbit_train *train;
    double length; /* of the train, s */
    int32_t loose; /* modes without a spring */
    vi_mode mode[VI_MODES];
    double steady_cos[VI_ORBIT_HARMONICS][VI_MODES], steady_sin[VI_ORBIT_HARMONICS][VI_MODES], level[VI_MODES];
    double start[VI_MODES][2]; /* displacement and velocity just after a unit impulse that recurs in each train */
    vi_complex part[VI_ORBIT_CONTACTS][VI_TERMS]; /* coupled: terms just after such an impulse at each contact */
    double state[VI_ORBIT_CONTACTS][VI_ORBIT_STATES]; /* the same without terms: displacements and velocities */
} vi_orbit_response;

/* Find the modes and their steady responses only. Returns one of VI_ORBIT_*. */
int vi_orbit_modes(vi_orbit_response *response, const vi_orbit_body *body);

/* Find all members for a train of impacts. Returns one of VI_ORBIT_*. */
int vi_orbit_respond(vi_orbit_response *response, const vi_orbit_body *body, const vi_orbit_train *train);

/* Time from impact k to impact i, s; > 0, and a whole train from an impact to itself. */
double vi_orbit_since(const vi_orbit_response *response, int i, int k);

/* Response of all modes, `u` seconds after an impact at a contact that takes a unit of speed, once in each train. */
void vi_orbit_train_answer(const vi_orbit_response *response, int contact, double u, double x[], double v[]);

/* Constant acceleration of mode j in the response of vi_orbit_train_answer: it evens the impulses of a mode without a
 * spring out (equations.md 4.7). 0 for the other modes. */
double vi_orbit_evening(const vi_orbit_response *response, int contact, int j);

/* Accelerations that the damping takes from modal velocities v. */
void vi_orbit_drag(const vi_orbit_response *response, const double v[], double drag[]);

/* Speed whose impulse with the restitution below the yield velocity is that of an impact, (1 + r(V)) V / (1 + r), m/s:
 * equations.md 4.7. It is V itself up to the yield velocity. *slope: its derivative over V, at a kink from below. */
double vi_orbit_equal_speed(const vi_orbit_body *body, int contact, double velocity, double *slope);

/* Free motion of all modes for `u` seconds, without constant forces. */
void vi_orbit_free(const vi_orbit_response *response, double u, double x[], double v[]);

/* Steady response of all modes to the force; the constant force counts only for a mode with a spring. */
void vi_orbit_steady(const vi_orbit_response *response, double phase, double x[], double v[]);

/* Steady motion of a contact relative to its stop: level + cosine cos(order phase) + sine sin(order phase), m. */
typedef struct {
    double level; /* about the mean position of the stop, which is not subtracted */
    double cosine[VI_ORBIT_HARMONICS], sine[VI_ORBIT_HARMONICS];
} vi_orbit_gap;

void vi_orbit_steady_gap(const vi_orbit_response *response, int contact, vi_orbit_gap *gap);

/* Motion of a stop about its mean position at a phase of the clock, with its first two derivatives. */
void vi_orbit_stop(const vi_orbit_body *body, int contact, double phase, double at[3]);

/* Apply an impact to a change of the state before it, change[2 modes][columns]: equations.md 4.2. `velocity`: relative
 * to the stop and towards it, before the impact, m/s; `state`: of all modes after the impact. */
void vi_orbit_salt(const vi_orbit_response *response, int contact, double phase, double velocity, const double state[],
                   int columns, double change[][VI_ORBIT_STATES]);

/* Apply a flight of `u` seconds to a change of the state. */
void vi_orbit_carry(const vi_orbit_response *response, double u, int columns, double change[][VI_ORBIT_STATES]);

/* Steady response at the contact of impact i: distance beyond its moving stop, and the first two derivatives. */
void vi_orbit_steady_at(const vi_orbit_response *response, int i, double at[3]);

#endif
