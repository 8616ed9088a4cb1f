/* The length of two numbers is the C library's to a unit in the last place; the power of two is the nearest. */
#include "motion/magnitude.h"

#include <float.h>
#include <math.h>

#include "check.h"

static double any_number(uint64_t *seed)
{
    static const double special[] = {0.0,          -0.0,          1.0,     3.0,   4.0,   DBL_MIN,
                                     DBL_TRUE_MIN, DBL_MAX / 2.0, -1e-308, 1e154, 1e-162};
    if (choice(seed, 8) == 0) {
        return special[choice(seed, sizeof special / sizeof special[0])];
    }
    return ldexp(uniform(seed, -1.0, 1.0), (int)choice(seed, 2000) - 1050);
}

static void the_length_is_that_of_the_library(uint64_t *seed)
{
    int others = 0;
    for (int i = 0; i < 300000; ++i) {
        const double x = any_number(seed);
        const double y = i % 2 == 0 ? any_number(seed) : x * uniform(seed, -3.0, 3.0);
        const double found = vi_magnitude(x, y), expected = hypot(x, y);
        others += found != expected;
        CHECK(found == expected || fabs(found - expected) <= fmax(expected * DBL_EPSILON, DBL_TRUE_MIN),
              "%.17g, %.17g: %.17g, not %.17g", x, y, found, expected);
    }
    CHECK(others < 3000, "%d of 300000 differ in the last place", others);
}

static void what_is_no_length_is_not_hidden(void)
{
    CHECK(vi_magnitude(3.0, -4.0) == 5.0 && vi_magnitude(0.0, -0.0) == 0.0, "%s", "exact");
    CHECK(isinf(vi_magnitude(-INFINITY, 1.0)) && isinf(vi_magnitude(DBL_MAX, DBL_MAX)), "%s", "infinite");
    CHECK(isnan(vi_magnitude(NAN, 1.0)) && isnan(vi_magnitude(0.0, NAN)), "%s", "no number");
}

static void powers_are_the_nearest(uint64_t *seed)
{
    for (int i = 0; i < 100000; ++i) {
        const double x = fabs(any_number(seed));
        if (x > 0.0) {
            const double found = vi_nearest_power_of_two(x), expected = exp2(rint(log2(x)));
            CHECK(found == expected, "%.17g: %g, not %g", x, found, expected);
        }
    }
    CHECK(isinf(vi_nearest_power_of_two(INFINITY)), "%s", "infinite");
}

int main(void)
{
    uint64_t seed = 7;
    the_length_is_that_of_the_library(&seed);
    what_is_no_length_is_not_hidden();
    powers_are_the_nearest(&seed);
    return 0;
}
