/* The Sensor component: a voltage of what it measures. */
#ifndef VIBROIMPACT_SENSOR_H
#define VIBROIMPACT_SENSOR_H

#include "measuring/reading.h"

/* All of a Sensor's variables (variables.toml says what each is). */
typedef struct {
    double time;
    vi_reading reading;
    double input;
    double output;
} sensor;

#endif
