/* Forces that only push fulfil the conditions of the problem, in any order of contacts, also for redundant contacts. */
#include "contact/complementarity.h"

#include <float.h>
#include <math.h>

#include "check.h"

/* g = A A^T with `rank` columns: positive definite, or singular where contacts are redundant. */
static double random_matrix(uint64_t *seed, int n, int rank, double g[VI_PORTS][VI_PORTS])
{
    double a[VI_PORTS][VI_PORTS], largest = 0.0;
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < rank; ++j) {
            a[i][j] = uniform(seed, -1.0, 1.0);
        }
    }
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
            g[i][j] = 0.0;
            for (int k = 0; k < rank; ++k) {
                g[i][j] += a[i][k] * a[j][k];
            }
            largest = fmax(largest, fabs(g[i][j]));
        }
    }
    return largest;
}

static void check_conditions(int n, double g[VI_PORTS][VI_PORTS], const double b[], const double p[], double room, int run)
{
    for (int k = 0; k < n; ++k) {
        double gap = -b[k], size = fabs(b[k]);
        for (int l = 0; l < n; ++l) {
            gap += g[k][l] * p[l];
            size += fabs(g[k][l] * p[l]);
        }
        CHECK(p[k] >= 0.0 && isfinite(p[k]), "run %d: p[%d] = %g", run, k, p[k]);
        CHECK(gap >= -room * size, "run %d: gap %d of %d is %g of %g", run, k, n, gap, size);
        CHECK(p[k] == 0.0 || fabs(gap) <= room * size, "run %d: contact %d of %d pushes at gap %g", run, k, n, gap);
    }
}

/* The same problem with its contacts listed in another order has the same answer. */
static void check_order(uint64_t *seed, int n, double g[VI_PORTS][VI_PORTS], const double b[], const double p[],
                        double room, int run)
{
    double other[VI_PORTS][VI_PORTS], load[VI_PORTS], answer[VI_PORTS], size = DBL_MIN;
    int order[VI_PORTS];
    for (int i = 0; i < n; ++i) {
        const int j = (int)choice(seed, (unsigned)i + 1u);
        order[i] = order[j];
        order[j] = i;
        size = fmax(size, p[i]);
    }
    for (int i = 0; i < n; ++i) {
        load[i] = b[order[i]];
        for (int j = 0; j < n; ++j) {
            other[i][j] = g[order[i]][order[j]];
        }
    }
    vi_complementary(n, other, load, answer);
    for (int i = 0; i < n; ++i) {
        CHECK(fabs(answer[i] - p[order[i]]) <= room * size, "run %d: %g and %g", run, answer[i], p[order[i]]);
    }
}

enum { PROBLEMS = VI_PORTS > 8 ? 500 : 50000 };

static void random_problems(uint64_t *seed)
{
    double g[VI_PORTS][VI_PORTS], b[VI_PORTS], p[VI_PORTS];
    for (int run = 0; run < PROBLEMS; ++run) {
        const int n = 1 + (int)choice(seed, VI_PORTS);
        const double largest = random_matrix(seed, n, VI_PORTS, g), scale = pow(10.0, uniform(seed, -12.0, 12.0));
        const double own = choice(seed, 2) == 0 ? 1.0 : 1e-4;
        for (int k = 0; k < n; ++k) {
            g[k][k] += own * largest;
            b[k] = choice(seed, 4) == 0 ? 0.0 : scale * uniform(seed, -1.0, 1.0);
        }
        vi_complementary(n, g, b, p);
        check_conditions(n, g, b, p, 1e-10, run); /* elimination at a condition number of at most 1e5 */
        check_order(seed, n, g, b, p, 1e-9, run);
    }
}

/* Loads that stops of a common body can demand: b = g c, so that an answer exists for any singular g. */
static void redundant_contacts(uint64_t *seed)
{
    double g[VI_PORTS][VI_PORTS], b[VI_PORTS], p[VI_PORTS];
    for (int run = 0; run < PROBLEMS; ++run) {
        const int n = 2 + (int)choice(seed, VI_PORTS - 1), rank = 1 + (int)choice(seed, (unsigned)n - 1u);
        random_matrix(seed, n, rank, g);
        double c[VI_PORTS];
        for (int k = 0; k < n; ++k) {
            c[k] = choice(seed, 3) == 0 ? 0.0 : uniform(seed, 0.0, 1.0);
        }
        for (int k = 0; k < n; ++k) {
            b[k] = 0.0;
            for (int l = 0; l < n; ++l) {
                b[k] += g[k][l] * c[l];
            }
        }
        vi_complementary(n, g, b, p);
        /* redundant contacts are softened by 1e-6 of the mobility (complementarity.c) */
        check_conditions(n, g, b, p, 1e-5, run);
    }
}

/* Bodies apart from each other, with loads of very unlike sizes: the smallest loads are balanced, too. */
static void loads_of_unlike_sizes(uint64_t *seed)
{
    enum { BODIES = VI_PORTS / 4, OF_ONE = 4 };
    double g[VI_PORTS][VI_PORTS] = {{0.0}}, b[VI_PORTS], p[VI_PORTS], own[VI_PORTS][VI_PORTS];
    for (int run = 0; run < PROBLEMS; ++run) {
        for (int body = 0; body < BODIES; ++body) {
            const double scale = pow(10.0, uniform(seed, -20.0, 20.0)), largest = random_matrix(seed, OF_ONE, OF_ONE, own);
            for (int i = 0; i < OF_ONE; ++i) {
                b[body * OF_ONE + i] = scale * uniform(seed, -1.0, 1.0);
                for (int j = 0; j < OF_ONE; ++j) {
                    g[body * OF_ONE + i][body * OF_ONE + j] = own[i][j] + (i == j ? largest : 0.0);
                }
            }
        }
        vi_complementary(BODIES * OF_ONE, g, b, p);
        check_conditions(BODIES * OF_ONE, g, b, p, 1e-12, run);
    }
}

static void the_same_point_twice_shares_evenly(void)
{
    double g[VI_PORTS][VI_PORTS] = {{2.0, 2.0}, {2.0, 2.0}}, b[VI_PORTS] = {3.0, 3.0}, p[VI_PORTS];
    vi_complementary(2, g, b, p);
    CHECK(fabs(p[0] - 0.75) <= 1e-9 && fabs(p[1] - 0.75) <= 1e-9, "%.17g and %.17g", p[0], p[1]);
}

int main(void)
{
    uint64_t seed = 4;
    random_problems(&seed);
    redundant_contacts(&seed);
    loads_of_unlike_sizes(&seed);
    the_same_point_twice_shares_evenly();
    return 0;
}
