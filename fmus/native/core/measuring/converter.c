#include "measuring/converter.h"

#include <math.h>

/* Distance of two instants, s, in units of 1 + |time|, below which they are one, as for the importer. */
static const double SAME_INSTANT = 1e-13;

double vi_sample_time(const vi_sample_clock *clock, int64_t k)
{
    return (double)k / (clock->rate * (1.0 + 1e-6 * clock->clock_error)) + clock->skew;
}

int64_t vi_sample_after(const vi_sample_clock *clock, double time)
{
    const double now = time + SAME_INSTANT * (1.0 + fabs(time));
    const double place = floor((now - clock->skew) * clock->rate * (1.0 + 1e-6 * clock->clock_error));
    int64_t k = (int64_t)fmin(fmax(place - 1.0, -0x1p62), 0x1p62);
    while (vi_sample_time(clock, k) <= now && k < INT64_MAX / 2) { /* at most three times: rounding */
        k += 1;
    }
    return k;
}

double vi_digitised(double volts, double highest, int bits)
{
    const double half = ldexp(1.0, bits - 1), step = highest / half;
    const double code = nearbyint(volts / step);
    return step * (code > half - 1.0 ? half - 1.0 : code < -half ? -half : code);
}
