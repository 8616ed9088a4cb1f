/* The Sensor component: a voltage for a measured value. */
#ifndef VIBROIMPACT_SENSOR_H
#define VIBROIMPACT_SENSOR_H

#include "measuring/reading.h"

/* All variables of a Sensor, described in variables.toml. */
typedef struct {
    double time;
    vi_reading reading;
    double input;
    double output;
} sensor;

#endif
