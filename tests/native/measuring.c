/* The measuring chain: published numbers of the generator; cells, converters and noise for numbers of every kind. */
#include "door/door_measuring.h"

#include <math.h>
#include <string.h>

#include "check.h"
#include "measuring/converter.h"
#include "measuring/gaussian.h"
#include "measuring/magnet.h"
#include "measuring/philox.h"
#include "measuring/reading.h"

/* Known answers of Random123 (kat_vectors, philox4x32 10). */
static void test_philox(void)
{
    static const uint32_t known[3][10] = {
        {0, 0, 0, 0, 0, 0, 0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8},
        {0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff, 0x408f276d, 0x41c83b0e, 0xa20bc7c6,
         0x6d5451fd},
        {0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344, 0xa4093822, 0x299f31d0, 0xd16cfe09, 0x94fdcceb, 0x5001e420,
         0x24126ea1},
    };
    for (int i = 0; i < 3; ++i) {
        uint32_t counter[4];
        memcpy(counter, known[i], sizeof counter);
        vi_philox(counter, known[i][4], known[i][5]);
        CHECK(memcmp(counter, known[i] + 6, sizeof counter) == 0, "vector %d begins with %08x", i, counter[0]);
    }
}

static void test_gaussian(void)
{
    const int64_t last = (INT64_C(1) << 52) - 1;
    double before = vi_gaussian_quantile(-last - 1);
    CHECK(before > -8.4 && before < -8.2, "got %.17g", before);
    for (int k = 1; k <= 1000; ++k) { /* rises in all three parts */
        const double now = vi_gaussian_quantile(-last - 1 + (int64_t)ldexp(1.0, 52) / 500 * k);
        CHECK(now > before, "%.17g after %.17g at %d", now, before, k);
        before = now;
    }
    for (int shift = 0; shift < 52; ++shift) {
        const int64_t j = INT64_C(1) << shift;
        CHECK(vi_gaussian_quantile(j) + vi_gaussian_quantile(-j - 1) == 0.0, "not symmetric at 2^%d", shift);
    }
    CHECK(isfinite(vi_gaussian(UINT64_MAX, UINT64_MAX, UINT64_MAX)), "at the largest numbers");
}

static vi_cell cell, other;

static vi_cell_settings any_settings(uint64_t *seed)
{
    vi_cell_settings s = {uniform(seed, -10.0, 10.0), 0.0, 0.0, uniform(seed, -1.0, 1.0), uniform(seed, -1.0, 1.0), 0.0};
    s.natural_frequency = choice(seed, 5) == 0 ? 0.0 : pow(10.0, uniform(seed, -3.0, 6.0));
    s.damping_ratio = choice(seed, 3) == 0 ? 0.0 : choice(seed, 4) == 0 ? 1.0 : pow(10.0, uniform(seed, -9.0, 3.0));
    s.contact_duration = choice(seed, 6) == 0 && s.natural_frequency > 0.0 ? 0.5 / s.natural_frequency /* resonance */
                                                                           : pow(10.0, uniform(seed, -6.0, 1.0));
    return s;
}

/* Bounded forces and impulses give bounded outputs; after all half sines nothing of them is left. */
static void test_any_cell(uint64_t *seed)
{
    const vi_cell_settings settings = any_settings(seed);
    double time = uniform(seed, -10.0, 1e4), volts, given = 0.0;
    vi_door_cell_start(&cell, &settings, time, uniform(seed, -5.0, 5.0));
    for (int k = 0; k < 40; ++k) {
        const double end = time + pow(10.0, uniform(seed, -13.0, 1.0)), force = uniform(seed, -5.0, 5.0);
        const size_t hits = choice(seed, 3);
        const double at[2] = {uniform(seed, time, end), end}, impulse[2] = {uniform(seed, -1.0, 1.0), 0.5};
        given += fabs(impulse[0]) + 0.5;
        CHECK(vi_door_cell_follow(&cell, 1, &end, &force, hits, at, impulse, &volts) == 0, "refused");
        CHECK(isfinite(volts), "%.17g at natural frequency %.17g Hz, damping ratio %.17g, duration %.17g s", volts,
              settings.natural_frequency, settings.damping_ratio, settings.contact_duration);
        const double most = 40.0 * (5.0 + given * 2.0 / settings.contact_duration);
        const double shown = fabs(cell.seen), limit = settings.damping_ratio == 0.0 ? 60.0 * most : 4.0 * most;
        CHECK(settings.natural_frequency <= 0.0 || shown <= limit, "%.17g N seen of %.17g N", shown, most);
        CHECK(cell.count >= 0 && cell.first >= 0 && cell.first + cell.count <= VI_CELL_PULSES, "half sines");
        time = end;
    }
    vi_cell_advance(&cell, time + 2.0 * settings.contact_duration, 0.0);
    CHECK(cell.count == 0 && cell.first == 0 && !(fabs(vi_cell_load(&cell) - cell.force) > 0.0), "a half sine is left");
    CHECK(vi_cell_unused(&cell) == sizeof cell.pulses, "room is taken");
}

/* The queue of half sines fills, moves up, and refuses one half sine too many. */
static void test_the_queue(void)
{
    const vi_cell_settings settings = {1.0, 100.0, 0.1, 0.0, 0.0, 1.0};
    vi_door_cell_start(&cell, &settings, 0.0, 0.0);
    for (int k = 0; k < 3 * VI_CELL_PULSES; ++k) { /* at most 1001 at once */
        vi_cell_advance(&cell, 1e-3 * k, 0.0);
        CHECK(vi_cell_hit(&cell, 1e-3), "impact %d", k);
    }
    vi_door_cell_start(&cell, &settings, 0.0, 0.0);
    for (int k = 0; k < VI_CELL_PULSES; ++k) {
        CHECK(vi_cell_hit(&cell, 1e-3), "impact %d", k);
    }
    CHECK(!vi_cell_hit(&cell, 1e-3), "one too many");
    CHECK(vi_cell_unused(&cell) == 0, "room is left");
    memcpy(&other, &cell, sizeof other); /* a saved state */
    vi_cell_advance(&cell, 0.3, 0.0);
    vi_cell_advance(&other, 0.3, 0.0);
    CHECK(memcmp(&other, &cell, sizeof other) == 0, "a copy goes on as the cell does");
}

static void test_edges(uint64_t *seed)
{
    const vi_sample_clock clock = {pow(10.0, uniform(seed, -3.0, 7.0)), uniform(seed, -500.0, 500.0),
                                   choice(seed, 2) ? 0.0 : uniform(seed, 0.0, 1e-3)};
    const double time = uniform(seed, -10.0, 1e4);
    const int64_t k = vi_sample_after(&clock, time);
    CHECK(vi_sample_time(&clock, k) > time && vi_sample_time(&clock, k - 1) <= time + 2e-13 * (1.0 + fabs(time)),
          "edge %lld of %.17g Hz after %.17g s", (long long)k, clock.rate, time);
    const double edge = vi_sample_time(&clock, k);
    CHECK(vi_sample_after(&clock, edge) > k, "an edge is not after itself");
    (void)vi_sample_after(&(vi_sample_clock){1e300, 0.0, 0.0}, 1e300);
}

static void test_numbers_that_are_none(void)
{
    const double none[2] = {NAN, INFINITY};
    double out[2];
    vi_door_digitised(2, none, 5.0, 12, out);
    CHECK(isnan(out[0]) && out[1] < 5.0, "%g", out[1]);
    vi_door_reading(2, none, 1.0, 0.0, 5.0, out);
    CHECK(isnan(out[0]) && out[1] <= 5.0, "%g", out[1]);
    CHECK(vi_door_magnet(2, none, none, 1.0, 0.0, 1.0, VI_MAGNET_LOWER, out) == 0, "a displacement that is no number");
}

int main(void)
{
    uint64_t seed = 20261125;
    test_philox();
    test_gaussian();
    test_the_queue();
    test_numbers_that_are_none();
    for (int round = 0; round < 3000; ++round) {
        test_any_cell(&seed);
        test_edges(&seed);
    }
    return 0;
}
