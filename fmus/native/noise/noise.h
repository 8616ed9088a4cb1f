/* The Noise component: a signal with Gaussian noise. */
#ifndef VIBROIMPACT_NOISE_H
#define VIBROIMPACT_NOISE_H

#include <stdint.h>

/* All variables of a Noise, described in variables.toml. */
typedef struct {
    double time;
    double rms, rate;
    int64_t seed, channel;
    double input;
    double output;
} noise;

#endif
