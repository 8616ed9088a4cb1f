/* Slopes of the equations of a body over its parameters, and the derivatives of its motion over them. equations.md 6.17 */
#ifndef VIBROIMPACT_PARAMETER_H
#define VIBROIMPACT_PARAMETER_H

#include "body/modal/state.h"
#include "body/modal/variation.h"

enum { VI_KEYS = 16 }; /* most parameters of one body */

/* Slopes of the equations of a body over one parameter. All 0, port -1: they do not depend on it. */
typedef struct {
    double force[VI_MODES];            /* slopes of the modal amplitudes of the harmonic force */
    double base;                       /* slope of the amplitude of the harmonic base acceleration */
    double phase, frequency;           /* slopes of the harmonic force's phase: constant, and per second since time 0 */
    double row[VI_MODES];              /* the matrices of the body gain a factor times row row' */
    double mass, damping, stiffness;   /* these factors */
    int64_t port;                      /* contact of the next members, which are 1 for the parameter itself */
    double position, restitution, yield_velocity;
    double press_stiffness, press_damping, press_exponent;
} vi_parameter;

/* The derivatives of the motion over one parameter. */
typedef struct {
    double q[VI_MODES], p[VI_MODES];
    double shift;              /* of the instant of the present event, 0 between events */
    double largest;            /* of the terms of a contact's change so far, beside which smaller ones are rounding */
    double hit[VI_PORTS];      /* of the approach at the present impact */
    double last_time[VI_PORTS], last_velocity[VI_PORTS]; /* of these outputs of the contacts */
    int64_t undefined;         /* the motion has no derivative: 64 bits, to avoid padding */
} vi_sensitivity;

struct vi_sensitivities {
    int64_t count;             /* number of parameters */
    int64_t in_event;          /* the derivatives are those at the instant of an event, which shifts */
    double base_held, base_rate, base_amplitude; /* of the base's acceleration, m/s^2; set by the component */
    vi_instant base_since;     /* instant of `base_held` */
    double before_q[VI_MODES], before_p[VI_MODES]; /* of the motion, before the present segment */
    vi_parameter parameter[VI_KEYS];
    vi_sensitivity of[VI_KEYS];
};

/* Loads and contact forces that a parameter adds at the present instant, for vi_structure_carry; displacements and
 * velocities of the change are set already. */
void vi_parameter_source(const vi_structure *s, const vi_parameter *parameter, vi_variation *change);

#endif
