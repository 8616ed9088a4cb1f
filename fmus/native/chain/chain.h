/* The Chain component: masses in a row on springs and dashpots, with stops. */
#ifndef VIBROIMPACT_CHAIN_H
#define VIBROIMPACT_CHAIN_H

#include <stdint.h>

#include "body.h"
#include "modes/chain_modes.h"

/* All variables and state of a Chain, described in variables.toml; copying the struct copies the Chain. */
typedef struct {
    double time;
    /* parameters */
    int64_t masses, masses_described;
    int64_t modes;                       /* in use; 0: all */
    vi_chain parameter; /* masses, springs, dashpots; initialization adds the far spring and dashpot */
    double far_stiffness, far_damping;
    double forcing_amplitude[VI_MODES], forcing_base_acceleration;
    double displacement_start[VI_MODES], velocity_start[VI_MODES];
    int64_t observed_mass;
    int64_t contact_mass[VI_PORTS];
    /* inputs */
    double force[VI_MODES], force_rate[VI_MODES];
    /* outputs */
    double displacement[VI_MODES], velocity[VI_MODES], acceleration[VI_MODES], relative_acceleration[VI_MODES];
    double shape[VI_MODES][VI_MODES]; /* shape[i][j]: displacement of mass i for q_j = 1, kg^(-1/2) */
    vi_body body; /* last member: its record is saved as far as it is used, and nothing after it */
} chain;

#endif
