/* The Oscillator component: one mass, spring and dashpot, with up to two stops. */
#ifndef VIBROIMPACT_OSCILLATOR_H
#define VIBROIMPACT_OSCILLATOR_H

#include <stdint.h>

#include "body/modal/pressed_flow.h"
#include "body/modal/structure.h"
#include "body/one_mass/body.h"
#include "motion/amplitude.h"

/* All of an Oscillator's variables and state (variables.toml says what each is); copying it copies the Oscillator. */
typedef struct {
    double time;
    /* parameters */
    double mass, damping, stiffness;
    double forcing_amplitude, forcing_angular_frequency, forcing_phase;
    double displacement_start, velocity_start;
    vi_amplitude_law amplitude;
    double contact_tolerance;
    /* inputs */
    double force, force_rate, base_acceleration, base_acceleration_rate;
    int32_t inputs_changed; /* since they were last given to the body */
    int32_t forcing_changed; /* likewise the tunable parameters of the forcing */
    /* outputs */
    double displacement, velocity, relative_acceleration, acceleration, energy_kinetic, energy_potential;
    /* A stop that yields (a law of force) is met on the engine of structure.h, with one mode; the impulsive laws alone
     * on the faster one of body.h, unless the importer integrates the motion. Contacts and record are those of `body` either way. */
    int32_t yields;
    int32_t contacts_described; /* ports of the model description */
    vi_structure_model model;
    vi_structure_state state;
    vi_body body;       /* its record, its last part, is saved only as far as it is used, and nothing after it */
    vi_pressed pressed; /* what follows from the rest */
} oscillator;

#endif
