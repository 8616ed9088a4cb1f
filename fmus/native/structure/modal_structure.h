/* The Structure component: modes of any bodies that springs, dashpots and contacts join. */
#ifndef VIBROIMPACT_MODAL_STRUCTURE_H
#define VIBROIMPACT_MODAL_STRUCTURE_H

#include <stdint.h>

#include "body.h"
#include "structure_signals.h"

/* A force besides the forcing: a sine, or constant where the frequency is 0. */
typedef struct {
    double angular_frequency, amplitude, phase;
    int32_t of_base; /* an acceleration of the base */
} vi_structure_sine;

/* All variables and state of a Structure, described in variables.toml; copying the struct copies the Structure. The
 * model in `body` holds the shapes of contacts and observed point, and the damping matrix. */
typedef struct {
    double time;
    /* parameters; rows of one number for each mode */
    int64_t modes, modes_described;
    int64_t modes_of_file; /* 0: there is no file */
    int64_t further_points;
    int32_t coupled;       /* the damping matrix is read, not the damping ratios */
    double natural[VI_MODES], damping_ratio[VI_MODES];
    double forcing[VI_MODES], base[VI_MODES], force_shape[VI_MODES];
    double displacement_start[VI_MODES], velocity_start[VI_MODES];
    double forcing_amplitude, forcing_base_acceleration;
    vi_structure_sine sine[VI_SINES_ROOM];
    double sine_shape[VI_SINES_ROOM][VI_MODES];
    vi_structure_signals signals;
    int32_t sines_started, turns[VI_SINES_ROOM]; /* since the start: is a sine not constant? */
    /* inputs */
    double force, force_rate;
    vi_body body; /* last member: its record is saved as far as it is used, and nothing after it */
} modal_structure;

#endif
