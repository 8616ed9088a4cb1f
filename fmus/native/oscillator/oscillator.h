/* The Oscillator component: one mass, spring and dashpot, with up to two stops; a body of one mode. */
#ifndef VIBROIMPACT_OSCILLATOR_H
#define VIBROIMPACT_OSCILLATOR_H

#include "body.h"
#include "motion/amplitude.h"

/* All variables and state of an Oscillator, described in variables.toml; copying the struct copies the Oscillator. */
typedef struct {
    double time;
    /* parameters */
    double mass, damping, stiffness;
    double forcing_amplitude, forcing_base_acceleration;
    double displacement_start, velocity_start;
    vi_amplitude_law amplitude;
    /* inputs */
    double force, force_rate;
    /* outputs */
    double relative_acceleration;
    vi_body body; /* last member: its record is saved as far as it is used, and nothing after it */
} oscillator;

#endif
