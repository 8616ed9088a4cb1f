#include "motion/clock.h"

#include <float.h>
#include <math.h>

#include "motion/magnitude.h"

static const double TWO_PI = 6.283185307179586232;
static const double TWO_PI_LOW = 2.449293598294706414e-16;
static const double MOST_PERIODS = 9007199254740992.0; /* 2^53: a double cannot count periods beyond */

/* Rounding error of the sum `sum` = a + b (Knuth). */
static double sum_error(double a, double b, double sum)
{
    const double b_part = sum - a;
    return (a - (sum - b_part)) + (b - b_part);
}

static void take_period(vi_clock *clock, double angular_frequency)
{
    clock->angular_frequency = angular_frequency;
    clock->period = TWO_PI / angular_frequency;
    clock->period_low = (fma(-clock->period, angular_frequency, TWO_PI) + TWO_PI_LOW) / angular_frequency;
}

static void start_forced(vi_clock *clock, double angular_frequency, double phase)
{
    take_period(clock, angular_frequency);
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
        clock->period = natural > 0.0 ? vi_nearest_power_of_two(TWO_PI / natural) : 1.0;
        clock->period_low = clock->origin = clock->origin_low = 0.0;
    }
    return clock->period >= DBL_MIN && clock->period <= DBL_MAX;
}

/* The instant `periods` and high + low seconds, as a sum whose two numbers do not overlap. */
static vi_instant instant_of(int64_t periods, double high, double low)
{
    const double rest = high + low;
    return (vi_instant){periods, rest, low - (rest - high)};
}

/* The same instant with 0 <= rest < period; the rest given may lie outside this range by one period. */
static vi_instant normalized(const vi_clock *clock, vi_instant instant)
{
    while (instant.rest >= clock->period) {
        instant = instant_of(instant.periods + 1, instant.rest - clock->period, instant.rest_low - clock->period_low);
    }
    while (instant.rest < 0.0) {
        instant = instant_of(instant.periods - 1, instant.rest + clock->period, instant.rest_low + clock->period_low);
        if (instant.rest >= clock->period) { /* a negative rest below the rounding of one period */
            instant = (vi_instant){instant.periods + 1, 0.0, 0.0};
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
    const double whole = count * clock->period, since = high - whole, rest = since + clock->origin;
    low += clock->origin_low - count * clock->period_low - fma(count, clock->period, -whole);
    low += sum_error(high, -whole, since) + sum_error(since, clock->origin, rest);
    /* a phase at time 0 is rounded too, by as much as a period is */
    const double resolution = 2.0 * DBL_EPSILON * (fabs(high) + (clock->origin != 0.0 ? clock->period : 0.0));
    if (fabs(rest + low) <= resolution) {
        *instant = (vi_instant){(int64_t)count, 0.0, 0.0};
    } else if (fabs((rest - clock->period) + low) <= resolution) {
        *instant = (vi_instant){(int64_t)count + 1, 0.0, 0.0};
    } else {
        *instant = normalized(clock, instant_of((int64_t)count, rest, low));
    }
    return true;
}

/* Seconds from `origin` to `instant` on the clock's own count: the returned sum plus its remainder *low. */
static double seconds_since(const vi_clock *clock, vi_instant instant, double origin, double origin_low, double *low)
{
    const double count = (double)instant.periods;
    const double whole = count * clock->period;
    *low = fma(count, clock->period, -whole) + count * clock->period_low - origin_low + instant.rest_low;
    const double sum = whole + instant.rest;
    *low += sum_error(whole, instant.rest, sum);
    const double shifted = sum - origin;
    *low += sum_error(sum, -origin, shifted);
    return shifted;
}

double vi_clock_time(const vi_clock *clock, vi_instant instant)
{
    double low;
    const double high = seconds_since(clock, instant, clock->origin, clock->origin_low, &low);
    return high + low;
}

double vi_clock_time_twofold(const vi_clock *clock, vi_instant instant, double *low)
{
    double rounding;
    const double sum = seconds_since(clock, instant, clock->origin, clock->origin_low, &rounding), high = sum + rounding;
    *low = rounding - (high - sum);
    return high;
}

double vi_clock_elapsed(const vi_clock *clock, vi_instant a, vi_instant b)
{
    const double difference = b.rest - a.rest, low = (b.rest_low - a.rest_low) + sum_error(b.rest, -a.rest, difference);
    if (a.periods == b.periods) {
        return difference + low;
    }
    const double count = (double)(b.periods - a.periods), whole = count * clock->period;
    return (whole + difference) + (count * clock->period_low + fma(count, clock->period, -whole) + low);
}

int64_t vi_clock_events_here(const vi_standstill *standstill, vi_instant now)
{
    const vi_instant *last = &standstill->instant;
    const bool here = now.periods == last->periods && now.rest == last->rest && now.rest_low == last->rest_low;
    return here ? standstill->events : 0;
}

bool vi_clock_stands(vi_standstill *standstill, vi_instant now)
{
    *standstill = (vi_standstill){now, vi_clock_events_here(standstill, now)};
    standstill->events += 1;
    return standstill->events >= VI_MOST_EVENTS;
}

double vi_clock_elapsed_twofold(const vi_clock *clock, vi_instant a, vi_instant b, double *low)
{
    const double count = (double)(b.periods - a.periods), whole = count * clock->period;
    const double difference = b.rest - a.rest, sum = whole + difference;
    double rounding = (b.rest_low - a.rest_low) + sum_error(b.rest, -a.rest, difference)
                      + sum_error(whole, difference, sum);
    rounding += count * clock->period_low + fma(count, clock->period, -whole);
    const double high = sum + rounding;
    *low = rounding - (high - sum);
    return high;
}

double vi_clock_to_period_end(const vi_clock *clock, vi_instant instant)
{
    return (clock->period - instant.rest) + (clock->period_low - instant.rest_low);
}

vi_instant vi_clock_after(const vi_clock *clock, vi_instant instant, double seconds)
{
    double count = 0.0, low = instant.rest_low;
    if (seconds >= 2.0 * clock->period) {
        count = floor(seconds / clock->period);
        low -= count * clock->period_low;
        seconds = fma(-count, clock->period, seconds);
    }
    const double rest = instant.rest + seconds;
    low += sum_error(instant.rest, seconds, rest);
    return normalized(clock, instant_of(instant.periods + (int64_t)count, rest, low));
}

double vi_clock_phase(const vi_clock *clock, vi_instant instant)
{
    if (clock->angular_frequency == 0.0) {
        return NAN;
    }
    const double phase = clock->angular_frequency * instant.rest;
    return phase < TWO_PI ? phase : 0.0;
}

/* ---- another frequency ---- */

bool vi_clock_can_retune(const vi_clock *clock, double angular_frequency, vi_instant now)
{
    if (clock->angular_frequency == 0.0) {
        return angular_frequency == 0.0;
    }
    const double period = TWO_PI / angular_frequency;
    const double since = vi_clock_elapsed(clock, (vi_instant){0, 0.0, 0.0}, now);
    /* periods are counted on in the new length, so the time must keep its digits beside the new count */
    const double counted = (fabs((double)now.periods) + 1.0) * period;
    const double time = fabs(vi_clock_time(clock, now));
    const bool keeps_time = time == 0.0 || counted * (8.0 * DBL_EPSILON) <= time;
    return angular_frequency > 0.0 && period >= DBL_MIN && counted <= DBL_MAX && fabs(since) / period < MOST_PERIODS
           && keeps_time;
}

/* The instant of the same phase, in periods of another clock. */
static vi_instant at_phase_of(const vi_clock *clock, double angular_frequency, vi_instant instant)
{
    const double w = clock->angular_frequency, turn = angular_frequency * instant.rest;
    const double low = fma(angular_frequency, instant.rest, -turn) + angular_frequency * instant.rest_low;
    const double rest = turn / w;
    instant.rest_low = (fma(-rest, w, turn) + low) / w;
    instant.rest = rest;
    if (rest >= clock->period) { /* only by rounding: the period has not ended yet */
        instant.rest = nextafter(clock->period, 0.0);
        instant.rest_low = 0.0;
    }
    return instant;
}

/* `now` moved back by `seconds` >= 0, as far as its periods can be counted. */
static vi_instant before(const vi_clock *clock, vi_instant now, double seconds)
{
    seconds = fmin(seconds, 0.5 * MOST_PERIODS * clock->period);
    const double count = ceil(seconds / clock->period), whole = count * clock->period;
    const double left = whole - seconds, rest = now.rest + left;
    const double low = fma(count, clock->period, -whole) + count * clock->period_low + sum_error(whole, -seconds, left)
                       + sum_error(now.rest, left, rest) + now.rest_low;
    return normalized(clock, instant_of(now.periods - (int64_t)count, rest, low));
}

void vi_clock_retune(vi_clock *clock, double angular_frequency, vi_instant *now, vi_instant *const past[], int count)
{
    if (angular_frequency == clock->angular_frequency) {
        return;
    }
    const vi_clock former = *clock;
    const vi_instant was = *now;
    take_period(clock, angular_frequency);
    *now = at_phase_of(clock, former.angular_frequency, was);
    double low, time_low;
    const double time = seconds_since(&former, was, former.origin, former.origin_low, &time_low);
    const double high = seconds_since(clock, *now, time, time_low, &low);
    clock->origin = high + low;
    clock->origin_low = low - (clock->origin - high);
    for (int i = 0; i < count; ++i) {
        *past[i] = before(clock, *now, fmax(0.0, vi_clock_elapsed(&former, *past[i], was)));
    }
}
