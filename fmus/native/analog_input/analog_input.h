/* The AnalogInput component: samples of a voltage. */
#ifndef VIBROIMPACT_ANALOG_INPUT_H
#define VIBROIMPACT_ANALOG_INPUT_H

#include <stdint.h>

#include "measuring/converter.h"

/* All variables of an AnalogInput, described in variables.toml. */
typedef struct {
    double time;
    vi_sample_clock clock;
    double highest;
    int64_t bits;
    double input;
    double output;
    int64_t sample;
    double event_time;
    int64_t next;    /* next edge */
    int32_t pending; /* an edge is reached but not yet sampled in event mode */
} analog_input;

#endif
