/* The Gain component: its output is a factor times its input, each in its own unit. */
#ifndef VIBROIMPACT_GAIN_H
#define VIBROIMPACT_GAIN_H

/* All variables of a Gain, described in variables.toml. */
typedef struct {
    double time;
    double factor;
    double input;
    double output;
} gain;

#endif
