#include "clock.h"

#include <float.h>
#include <math.h>

static const double TWO_PI = 6.283185307179586232;
static const double TWO_PI_LOW = 2.449293598294706414e-16;
static const double MOST_PERIODS = 9007199254740992.0; /* 2^53: beyond, a double cannot count them */

/* Rounding error of the sum `sum` = a + b (Knuth). */
static double sum_error(double a, double b, double sum)
{
    const double b_part = sum - a;
    return (a - (sum - b_part)) + (b - b_part);
}

static void start_forced(vi_clock *clock, double angular_frequency, double phase)
{
    clock->period = TWO_PI / angular_frequency;
    clock->period_low = (fma(-clock->period, angular_frequency, TWO_PI) + TWO_PI_LOW) / angular_frequency;
    double turn = remainder(phase, TWO_PI);
    if (turn < 0.0) {
        turn += TWO_PI;
    }
    clock->origin = turn / angular_frequency;
    clock->origin_low = fma(-clock->origin, angular_frequency, turn) / angular_frequency;
}

bool vi_clock_start(vi_clock *clock, double angular_frequency, double phase, double natural)
{
    clock->angular_frequency = angular_frequency;
    if (angular_frequency > 0.0) {
        start_forced(clock, angular_frequency, phase);
    } else {
        clock->period = natural > 0.0 ? exp2(rint(log2(TWO_PI / natural))) : 1.0;
        clock->period_low = clock->origin = clock->origin_low = 0.0;
    }
    return clock->period >= DBL_MIN && clock->period <= DBL_MAX;
}

/* Bring 0 <= rest < period; the numbers come from sums that may leave this range by one period. */
static vi_instant normalized(const vi_clock *clock, vi_instant instant)
{
    while (instant.rest >= clock->period) {
        instant.rest = (instant.rest - clock->period) - clock->period_low;
        instant.periods += 1;
    }
    while (instant.rest < 0.0) {
        instant.rest = (instant.rest + clock->period) + clock->period_low;
        if (instant.rest >= clock->period) { /* a negative rest below the rounding of one period */
            instant.rest = 0.0;
        } else {
            instant.periods -= 1;
        }
    }
    return instant;
}

bool vi_clock_instant(const vi_clock *clock, double high, double low, vi_instant *instant)
{
    const double count = floor((high + clock->origin) / clock->period);
    if (!(fabs(count) < MOST_PERIODS)) {
        return false;
    }
    double rest = fma(-count, clock->period, high);
    rest = (rest + clock->origin) + (low + clock->origin_low - count * clock->period_low);
    const double resolution = 2.0 * DBL_EPSILON * fabs(high);
    if (fabs(rest) <= resolution) {
        rest = 0.0;
    } else if (fabs(rest - clock->period) <= resolution) {
        rest = clock->period;
    }
    *instant = normalized(clock, (vi_instant){(int64_t)count, rest});
    return true;
}

double vi_clock_time(const vi_clock *clock, vi_instant instant)
{
    const double count = (double)instant.periods;
    const double whole = count * clock->period;
    double low = fma(count, clock->period, -whole) + count * clock->period_low - clock->origin_low;
    const double sum = whole + instant.rest;
    low += sum_error(whole, instant.rest, sum);
    const double shifted = sum - clock->origin;
    low += sum_error(sum, -clock->origin, shifted);
    return shifted + low;
}

double vi_clock_elapsed(const vi_clock *clock, vi_instant a, vi_instant b)
{
    const double count = (double)(b.periods - a.periods);
    return (count * clock->period + (b.rest - a.rest)) + count * clock->period_low;
}

vi_instant vi_clock_after(const vi_clock *clock, vi_instant instant, double seconds)
{
    if (seconds < 2.0 * clock->period) {
        return normalized(clock, (vi_instant){instant.periods, instant.rest + seconds});
    }
    const double count = floor(seconds / clock->period);
    const double rest = fma(-count, clock->period, seconds) - count * clock->period_low;
    return normalized(clock, (vi_instant){instant.periods + (int64_t)count, instant.rest + rest});
}

double vi_clock_phase(const vi_clock *clock, vi_instant instant)
{
    if (clock->angular_frequency == 0.0) {
        return NAN;
    }
    const double phase = clock->angular_frequency * instant.rest;
    return phase < TWO_PI ? phase : 0.0;
}
