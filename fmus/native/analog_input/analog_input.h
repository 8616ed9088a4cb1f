/* The AnalogInput component: samples of a voltage. */
#ifndef VIBROIMPACT_ANALOG_INPUT_H
#define VIBROIMPACT_ANALOG_INPUT_H

#include <stdint.h>

#include "measuring/converter.h"

/* All of an AnalogInput's variables (variables.toml says what each is). */
typedef struct {
    double time;
    vi_sample_clock clock;
    double highest;
    int64_t bits;
    double input;
    double output;
    int64_t sample;
    double event_time;
    int64_t next;    /* edge that comes */
    int32_t pending; /* an edge is here, and event mode has not sampled it */
} analog_input;

#endif
