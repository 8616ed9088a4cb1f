/* The Oscillator component: one mass, spring and dashpot, with up to two stops. */
#ifndef VIBROIMPACT_OSCILLATOR_H
#define VIBROIMPACT_OSCILLATOR_H

#include <stdint.h>

#include "body.h"

/* All of an Oscillator's variables and state (variables.toml says what each is); copying it copies the Oscillator. */
typedef struct {
    double time;
    /* parameters */
    double mass, damping, stiffness;
    double forcing_amplitude, forcing_angular_frequency, forcing_phase;
    double displacement_start, velocity_start;
    /* inputs */
    double force, force_rate, base_acceleration, base_acceleration_rate;
    int32_t inputs_changed; /* since they were last given to the body */
    /* outputs */
    double displacement, velocity, acceleration, energy_kinetic, energy_potential;
    vi_body body; /* last: its record is saved only as far as it is used */
} oscillator;

#endif
