/* Instants: conversion to time and back, sums, and the phase after any number of periods. */
#include "motion/clock.h"

#include <float.h>
#include <math.h>

#include "check.h"

static void times_come_back(uint64_t *seed)
{
    for (int n = 0; n < 200000; ++n) {
        const double frequency = choice(seed, 5) == 0 ? 0.0 : pow(10.0, uniform(seed, -6.0, 6.0));
        vi_clock clock;
        CHECK(vi_clock_start(&clock, frequency, uniform(seed, -20.0, 20.0), 1.0), "frequency %g", frequency);
        const double time = uniform(seed, -1.0, 1.0) * pow(10.0, uniform(seed, -9.0, 9.0));
        vi_instant instant;
        CHECK(vi_clock_instant(&clock, time, 0.0, &instant), "time %g", time);
        CHECK(instant.rest >= 0.0 && instant.rest < clock.period, "rest %g of %g", instant.rest, clock.period);
        /* an instant may be moved to the start of its period */
        const double back = vi_clock_time(&clock, instant);
        CHECK(fabs(back - time) <= 4.0 * DBL_EPSILON * (fabs(time) + DBL_EPSILON * clock.period), "%.17g came back as %.17g", time, back);
        const double seconds = uniform(seed, 0.0, 5.0) * clock.period;
        const vi_instant later = vi_clock_after(&clock, instant, seconds);
        CHECK(later.rest >= 0.0 && later.rest < clock.period, "rest %g of %g", later.rest, clock.period);
        const double elapsed = vi_clock_elapsed(&clock, instant, later);
        CHECK(fabs(elapsed - seconds) <= 4.0 * DBL_EPSILON * (seconds + DBL_EPSILON * clock.period), "%.17g elapsed as %.17g", seconds, elapsed);
        if (frequency > 0.0) {
            const double phase = vi_clock_phase(&clock, later);
            CHECK(phase >= 0.0 && phase < 6.283185307179587, "phase %.17g", phase);
        }
    }
}

static double apart(double one, double other)
{
    return fabs(remainder(one - other, 6.283185307179586));
}

static void another_frequency_keeps_time_phase_and_what_was(uint64_t *seed)
{
    int tuned = 0;
    for (int n = 0; n < 20000; ++n) {
        vi_clock clock;
        double frequency = pow(10.0, uniform(seed, -6.0, 6.0));
        CHECK(vi_clock_start(&clock, frequency, uniform(seed, -20.0, 20.0), 1.0), "frequency %g", frequency);
        double time = uniform(seed, 0.0, 1.0) * pow(10.0, uniform(seed, -3.0, 6.0));
        const double earlier = uniform(seed, 0.0, 1.0) * time;
        vi_instant now, past, never = {0, 0.0, 0.0};
        CHECK(vi_clock_instant(&clock, time, 0.0, &now) && vi_clock_instant(&clock, earlier, 0.0, &past), "%g", time);
        bool counted = true;
        for (int step = 0; step < 5; ++step) {
            const double phase = vi_clock_phase(&clock, now), was = vi_clock_time(&clock, now);
            const double other = choice(seed, 20) == 0 ? pow(10.0, uniform(seed, -310.0, 310.0))
                                                       : pow(10.0, uniform(seed, -6.0, 6.0));
            if (!vi_clock_can_retune(&clock, other, now)) {
                continue;
            }
            const vi_instant before = now;
            vi_instant *const seen[] = {&past, &never};
            vi_clock_retune(&clock, other, &now, seen, 2);
            ++tuned;
            CHECK(now.periods == before.periods, "periods %lld", (long long)now.periods);
            CHECK(now.rest >= 0.0 && now.rest < clock.period, "rest %g of %g", now.rest, clock.period);
            CHECK(fabs(vi_clock_time(&clock, now) - was) <= 2.0 * DBL_EPSILON * was, "time %.17g of %.17g", was, other);
            CHECK(apart(vi_clock_phase(&clock, now), phase) <= 1e-14, "phase %.17g at %.17g", phase, other);
            const double ago = vi_clock_time(&clock, past);
            counted = counted && was / clock.period < 1e15; /* otherwise it is as long ago as can be counted */
            CHECK(!counted || fabs(ago - earlier) <= 64.0 * DBL_EPSILON * time, "%.17g was %.17g", earlier, ago);
            if (other < 1e6 && other > 1e-6) {
                const double later = was + uniform(seed, 0.0, 3.0) * clock.period;
                vi_instant end;
                CHECK(vi_clock_instant(&clock, later, 0.0, &end), "time %g", later);
                const double expected = phase + other * (later - was);
                const double rounding = 16.0 * DBL_EPSILON * (other * later + 20.0);
                CHECK(apart(vi_clock_phase(&clock, end), expected) <= rounding, "phase at %.17g, frequency %g", later, other);
                now = end;
                time = later;
            }
        }
    }
    CHECK(tuned > 50000, "%d", tuned);
}

static void a_short_time_in_a_long_period_keeps_its_digits(void)
{
    vi_clock clock;
    CHECK(vi_clock_start(&clock, 1e-6, 0.3, 1.0), "%s", "slow");
    vi_instant start, end;
    vi_clock_instant(&clock, 0.0, 0.0, &start);
    vi_clock_instant(&clock, 1e-3, 0.0, &end);
    const double elapsed = vi_clock_elapsed(&clock, start, end);
    CHECK(fabs(elapsed - 1e-3) <= 1e-18, "%.17g", elapsed);
    vi_instant moved = start;
    for (int n = 0; n < 1000000; ++n) {
        moved = vi_clock_after(&clock, moved, 1e-9);
    }
    const double sum = vi_clock_elapsed(&clock, start, moved);
    CHECK(fabs(sum - 1e-3) <= 1e-15, "%.17g", sum);
}

static void a_million_periods_keep_the_phase(void)
{
    vi_clock clock;
    vi_clock_start(&clock, 0.7, 0.0, 1.0);
    vi_instant instant = {0, 0.0, 0.0};
    const double part = clock.period / 3.0;
    for (int n = 0; n < 3000000; ++n) {
        instant = vi_clock_after(&clock, instant, part);
    }
    const vi_instant target = {1000000, 0.0, 0.0};
    /* a third of a period is a double: wrong by half a rounding each time, in the same direction */
    const double lost = fabs(vi_clock_elapsed(&clock, instant, target));
    CHECK(lost <= 3e6 * DBL_EPSILON * part, "%g lost", lost);
}

static void what_cannot_be_counted_is_refused(void)
{
    vi_clock clock;
    vi_instant instant;
    CHECK(!vi_clock_start(&clock, 1e-310, 0.0, 1.0), "%s", "period too long");
    CHECK(!vi_clock_start(&clock, INFINITY, 0.0, 1.0), "%s", "no period");
    CHECK(vi_clock_start(&clock, 1.0, 0.0, 1.0), "%s", "plain");
    const double bad[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300};
    for (int n = 0; n < 5; ++n) {
        CHECK(!vi_clock_instant(&clock, bad[n], 0.0, &instant), "time %g", bad[n]);
    }
}

int main(void)
{
    uint64_t seed = 2;
    times_come_back(&seed);
    another_frequency_keeps_time_phase_and_what_was(&seed);
    a_short_time_in_a_long_period_keeps_its_digits();
    a_million_periods_keep_the_phase();
    what_cannot_be_counted_is_refused();
    return 0;
}
