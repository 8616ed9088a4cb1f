/* The Exciter component: the force of a voltage. */
#ifndef VIBROIMPACT_EXCITER_H
#define VIBROIMPACT_EXCITER_H

#include <stdint.h>

#include "measuring/magnet.h"

/* All of an Exciter's variables (variables.toml says what each is). */
typedef struct {
    double time;
    vi_magnet magnet;
    int64_t side;
    double input, displacement;
    double force;
} exciter;

#endif
