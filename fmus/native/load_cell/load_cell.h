/* The LoadCell component: the voltage of the force on it. */
#ifndef VIBROIMPACT_LOAD_CELL_H
#define VIBROIMPACT_LOAD_CELL_H

#include "measuring/cell.h"

/* All variables of a LoadCell, described in variables.toml. */
typedef struct {
    double force, impulse, impact_time; /* inputs */
    double load, output;
    double counted; /* impulse up to the start of the step, N s */
    vi_cell cell;   /* last member: only the used part is saved with a state */
} load_cell;

#endif
