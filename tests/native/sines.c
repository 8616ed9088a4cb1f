/* Phases of harmonics by powers of the clock's turn are those of the direct count, whichever instant was before. */
#include "motion/sines.h"

#include <float.h>
#include <math.h>

#include "check.h"
#include "motion/flow.h"

/* Largest difference of a cosine or sine from the direct count, for each turn of the harmonic. */
static const double CLOSE = 8.0 * DBL_EPSILON;

static int64_t any_period(uint64_t *seed)
{
    static const double largest[] = {1.0, 3e3, 1e6, 1e9};
    return (int64_t)uniform(seed, -1.0, largest[choice(seed, 4)]);
}

/* A multiple of the clock's frequency, as it is rounded in a scene or by one more unit. */
static double near_multiple(uint64_t *seed, double own, double multiple)
{
    const double product = own * multiple;
    return choice(seed, 2) ? product : nextafter(product, HUGE_VAL);
}

static void powers_agree_with_the_count_of_turns(uint64_t *seed)
{
    int harmonics = 0;
    for (int i = 0; i < 20000; ++i) {
        vi_clock clock;
        const double own = uniform(seed, 0.1, 10.0), multiple = 1.0 + choice(seed, 8);
        CHECK(vi_clock_start(&clock, own, uniform(seed, -7.0, 7.0), 1.0), "%.17g", own);
        const vi_sine sine = vi_sine_start(&clock, near_multiple(seed, own, multiple), uniform(seed, -7.0, 7.0));
        harmonics += sine.harmonic > 0;
        vi_sine_block block = {.first = INT64_MAX};
        for (int n = 0; n < 3; ++n) {
            const vi_instant now = {any_period(seed), uniform(seed, 0.0, clock.period), 0.0};
            vi_phase found;
            vi_sine_phases(&sine, 1, &clock, now, vi_phase_of(own * now.rest), &block, &found);
            const vi_phase direct = vi_sine_phase(&sine, now);
            const double difference = fmax(fabs(found.cosine - direct.cosine), fabs(found.sine - direct.sine));
            CHECK(difference <= multiple * CLOSE, "%.17g, %g, period %lld: %g", own, multiple, (long long)now.periods,
                  difference);
            CHECK(fabs(sin(found.angle - direct.angle)) <= multiple * 2.0 * CLOSE, "%.17g: angle %.17g, not %.17g", own,
                  found.angle, direct.angle);
            vi_sine_block other = {.first = INT64_MAX};
            vi_phase again;
            vi_sine_phases(&sine, 1, &clock, now, vi_phase_of(own * now.rest), &other, &again);
            CHECK(again.cosine == found.cosine && again.sine == found.sine && again.angle == found.angle,
                  "%.17g: the phase depends on the instant before", own);
        }
    }
    CHECK(harmonics > 19000, "%d of 20000 are harmonics", harmonics);
}

static void other_ratios_are_counted_directly(void)
{
    vi_clock clock;
    vi_clock_start(&clock, 1.3, 0.2, 1.0);
    const double ratio[] = {0.5, 1.5, 2.0 + 1e-12, 9.0, 1.4142135623730951};
    for (int i = 0; i < 5; ++i) {
        const vi_sine sine = vi_sine_start(&clock, 1.3 * ratio[i], 0.4);
        const vi_instant now = {12345, 2.0, 0.0};
        vi_sine_block block = {.first = INT64_MAX};
        vi_phase found;
        vi_sine_phases(&sine, 1, &clock, now, vi_phase_of(2.6), &block, &found);
        const vi_phase direct = vi_sine_phase(&sine, now);
        CHECK(sine.harmonic == 0 && found.cosine == direct.cosine && found.sine == direct.sine, "%.17g", ratio[i]);
    }
}

int main(void)
{
    uint64_t seed = 11;
    powers_agree_with_the_count_of_turns(&seed);
    other_ratios_are_counted_directly();
    return 0;
}
