/* The first fall of a polynomial to zero, against its known roots and against a fine grid. */
#include "motion/polynomial.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "check.h"

static void times_root(double c[VI_ORDER + 1], int order, double root)
{
    for (int n = order; n >= 0; --n) {
        c[n + 1] += c[n];
        c[n] *= -root;
    }
}

/* Make a polynomial with these roots, positive at 0. */
static void from_roots(double c[VI_ORDER + 1], const double roots[], int count)
{
    memset(c, 0, (VI_ORDER + 1) * sizeof c[0]);
    c[0] = 1.0;
    for (int i = 0; i < count; ++i) {
        times_root(c, i, roots[i]);
    }
    for (int n = 0; n <= VI_ORDER && count % 2 == 1; ++n) {
        c[n] = -c[n];
    }
}

/* The first of well separated roots is found, within the conditioning of the polynomial. */
static void the_first_root_is_found(uint64_t *seed)
{
    double c[VI_ORDER + 1], roots[6];
    for (int run = 0; run < 20000; ++run) {
        const int count = 1 + (int)choice(seed, 6);
        double first = HUGE_VAL;
        for (int i = 0; i < count; ++i) {
            roots[i] = (0.1 + 0.25 * (double)i + uniform(seed, 0.0, 0.1)) * (choice(seed, 3) == 0 ? -1.0 : 1.0);
            first = roots[i] > 0.0 ? fmin(first, roots[i]) : first;
        }
        from_roots(c, roots, count);
        if (c[0] < 0.0) {
            for (int n = 0; n <= VI_ORDER; ++n) {
                c[n] = -c[n];
            }
        }
        const double length = 1.5, noise = 4.0 * DBL_EPSILON * vi_polynomial_size(c, length);
        const vi_fall fall = vi_polynomial_fall(c, 0.0, length, noise);
        CHECK(fall.found == (first <= length), "run %d: first root %.17g", run, first);
        if (!fall.found) {
            continue;
        }
        double at[4];
        vi_polynomial_at(c, first, at);
        CHECK(fall.speed > 0.0 && fabs(fall.time - first) <= 8.0 * noise / fabs(at[1]), "run %d: %.17g for %.17g", run,
              fall.time, first);
    }
}

/* No fall is missed, and each fall found is a zero, for polynomials with any coefficients. */
static void nothing_is_passed(uint64_t *seed)
{
    double c[VI_ORDER + 1], value[4];
    for (int run = 0; run < 20000; ++run) {
        const double decay = uniform(seed, 0.2, 1.5), length = pow(10.0, uniform(seed, -6.0, 0.0));
        double size = pow(10.0, uniform(seed, -12.0, 12.0));
        for (int n = 0; n <= VI_ORDER; ++n, size *= decay / length) {
            c[n] = choice(seed, 5) == 0 ? 0.0 : size * uniform(seed, -1.0, 1.0);
        }
        c[0] = fabs(c[0]);
        const double noise = 4.0 * DBL_EPSILON * vi_polynomial_size(c, length);
        const vi_fall fall = vi_polynomial_fall(c, 0.0, length, noise);
        CHECK(isfinite(fall.time) && fall.time >= 0.0 && fall.time <= length, "run %d: %.17g", run, fall.time);
        CHECK(!vi_polynomial_clears(c, length) || !fall.found, "run %d: a zero at %.17g", run, fall.time);
        for (int i = 1; i < 200; ++i) {
            vi_polynomial_at(c, fall.time * (double)i / 200.0, value);
            CHECK(value[0] >= -4.0 * noise, "run %d: %g at step %d of 200", run, value[0], i);
        }
        vi_polynomial_at(c, fall.time, value);
        CHECK(!fall.found || fabs(value[0]) <= 4.0 * noise + 4.0 * DBL_EPSILON * fall.time * fabs(value[1]),
              "run %d: %g is no zero", run, value[0]);
    }
}

/* Values of rounding size neither stop the search nor prolong it without end. */
static void rounding_is_passed_over(uint64_t *seed)
{
    double c[VI_ORDER + 1];
    for (int run = 0; run < 50; ++run) {
        memset(c, 0, sizeof c);
        c[0] = 1e-65;
        for (int n = 1; n <= VI_ORDER; ++n) {
            c[n] = 1e-50 * pow(50.0, n) * (n % 2 == 0 ? 1.0 : 0.1) * uniform(seed, 0.5, 1.0);
        }
        const vi_fall fall = vi_polynomial_fall(c, 0.0, 0.02, 4.0 * DBL_EPSILON * vi_polynomial_size(c, 0.02));
        CHECK(!fall.found, "run %d", run);
    }
}

/* With coefficients whose sizes differ by 100 decades and more the search still finds the zero or reaches the end. */
static void sizes_do_not_stop_it(uint64_t *seed)
{
    double c[VI_ORDER + 1];
    for (int run = 0; run < 2000; ++run) {
        memset(c, 0, sizeof c);
        const double length = pow(10.0, uniform(seed, -7.0, 0.0)), sign = choice(seed, 2) == 0 ? 1.0 : -1.0;
        const int high = 5 + (int)choice(seed, 8);
        c[0] = pow(10.0, uniform(seed, -200.0, -180.0));
        c[1] = pow(10.0, uniform(seed, -130.0, -100.0));
        c[high] = sign * pow(10.0, uniform(seed, -40.0, 0.0));
        const double zero = pow(c[1] / fabs(c[high]), 1.0 / (double)(high - 1)); /* c[0] does not affect it */
        const vi_fall fall = vi_polynomial_fall(c, 0.0, length, DBL_EPSILON * c[0]);
        const bool falls = sign < 0.0 && zero < length;
        CHECK(fall.found == falls && (falls || fall.time == length), "run %d: ended at %g of %g", run, fall.time,
              length);
        CHECK(!falls || fabs(fall.time - zero) <= 1e-12 * zero, "run %d: %.17g for %.17g", run, fall.time, zero);
    }
}

int main(void)
{
    uint64_t seed = 4;
    the_first_root_is_found(&seed);
    nothing_is_passed(&seed);
    rounding_is_passed_over(&seed);
    sizes_do_not_stop_it(&seed);
    return 0;
}
