/* An analog-to-digital converter: its sample times, and the digitised voltage. */
#ifndef VIBROIMPACT_CONVERTER_H
#define VIBROIMPACT_CONVERTER_H

#include <stdint.h>

enum { VI_FEWEST_BITS = 1, VI_MOST_BITS = 32 };

/* The edges of a sample clock. */
typedef struct {
    double rate;        /* 1/s, > 0, by the clock itself */
    double clock_error; /* relative error of the rate, ppm, > -1e6; positive: the clock is fast */
    double skew;        /* delay of this channel's samples after the edge, s */
} vi_sample_clock;

/* The instant of edge `k`, s. */
double vi_sample_time(const vi_sample_clock *clock, int64_t k);

/* The first edge that is later than `time`, s, by more than the rounding of both. */
int64_t vi_sample_after(const vi_sample_clock *clock, double time);

/* The level nearest to `volts` among the 2^bits levels -highest, -highest + step, ..., highest - step, with step = 2
 * highest / 2^bits. Voltages beyond are clipped; NaN stays NaN. */
double vi_digitised(double volts, double highest, int bits);

#endif
