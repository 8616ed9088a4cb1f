/* The Exciter component: the force of a voltage. */
#ifndef VIBROIMPACT_EXCITER_H
#define VIBROIMPACT_EXCITER_H

#include <stdint.h>

#include "measuring/magnet.h"

/* All variables of an Exciter, described in variables.toml. */
typedef struct {
    double time;
    vi_magnet magnet;
    int64_t side;
    double input, displacement;
    double force;
} exciter;

#endif
