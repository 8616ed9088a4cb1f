/* Instants: to time and back, sums, and the phase after ever so many periods. */
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
        /* an instant may be put on the start of its period */
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
    /* a third of a period is a double: off by half a rounding each time, in the same direction */
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
    a_short_time_in_a_long_period_keeps_its_digits();
    a_million_periods_keep_the_phase();
    what_cannot_be_counted_is_refused();
    return 0;
}
