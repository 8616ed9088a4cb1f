/* The Gain component: its output is a number times its input, in units of their own. */
#ifndef VIBROIMPACT_GAIN_H
#define VIBROIMPACT_GAIN_H

/* All of a Gain's variables (variables.toml says what each is). */
typedef struct {
    double time;
    double factor;
    double input;
    double output;
} gain;

#endif
