/* Sines besides the clock's, at any frequencies. Phases are counted as the clock counts time. At the start of period n
 * the phase is the fraction of n times the turns in a period. So the 10^6th period is as exact as the first.
 */
#ifndef VIBROIMPACT_SINES_H
#define VIBROIMPACT_SINES_H

#include "motion/clock.h"
#include "motion/segment.h"

typedef struct {
    double angular_frequency; /* rad/s, > 0 */
    double turns, turns_low;  /* of this sine in a period of the clock; their sum has twice the digits */
    double start, start_low;  /* turns at the clock's origin, 0 <= start < 1 */
    int64_t harmonic;         /* turns, where they are a whole number to rounding; else 0. 64 bits, to avoid padding */
} vi_sine;

/* Start a sine of this phase, rad, at time 0. */
vi_sine vi_sine_start(const vi_clock *clock, double angular_frequency, double phase);

/* The sine of another frequency, or on a retuned clock, that has this phase, rad, at the instant. */
vi_sine vi_sine_from(const vi_clock *clock, double angular_frequency, vi_instant instant, double phase);

/* Phase at an instant, rad, with its cosine and sine. */
vi_phase vi_sine_phase(const vi_sine *sine, vi_instant instant);

#endif
