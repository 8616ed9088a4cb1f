/* Correlation sums against a count of all pairs. */
#include "door/correlation.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "check.h"
#include "door/door_correlation.h"

enum { COUNT = 700, EMBEDDING = 5, RADII = 40, STRIDE = RADII + 1 };

static double value[COUNT + VI_CORRELATION_PADDING];
static uint64_t joint[VI_CORRELATION_TABLES][(EMBEDDING + 1) / 2][STRIDE][STRIDE];

static double radius(double lowest, int k)
{
    int exponent;
    const int place = (int)(2.0 * VI_RADII_PER_OCTAVE * frexp(lowest, &exponent)) - VI_RADII_PER_OCTAVE + k;
    return ldexp(1.0 + (double)(place % VI_RADII_PER_OCTAVE) / VI_RADII_PER_OCTAVE,
                 exponent - 1 + place / VI_RADII_PER_OCTAVE);
}

/* Number of pairs nearer than radius k in m dimensions, from the table. */
static uint64_t counted(int m, int k)
{
    uint64_t sum = 0;
    for (int cell = 0; cell < VI_CORRELATION_TABLES * STRIDE * STRIDE; ++cell) {
        const int table = cell / (STRIDE * STRIDE), even = cell / STRIDE % STRIDE, odd = cell % STRIDE;
        sum += (m % 2 != 0 ? odd : even) <= k ? joint[table][(m - 1) / 2][even][odd] : 0;
    }
    return sum;
}

static uint64_t brute_force(int m, double r, int window)
{
    uint64_t sum = 0;
    for (int i = 0; i + m <= COUNT; ++i) {
        for (int j = i + window + 1; j + m <= COUNT; ++j) {
            bool is_near = true;
            for (int a = 0; a < m; ++a) {
                is_near = is_near && fabs(value[i + a] - value[j + a]) < r;
            }
            sum += is_near;
        }
    }
    return sum;
}

static void fill(uint64_t *seed, double grid)
{
    for (int j = 0; j < COUNT + VI_CORRELATION_PADDING; ++j) {
        const double x = uniform(seed, -1.0, 1.0);
        value[j] = j < COUNT ? (grid > 0.0 ? grid * floor(x / grid) : x) : (double)NAN;
    }
    value[COUNT / 3] = (double)NAN;
}

static void compare(uint64_t *seed, double grid, double lowest, int window)
{
    fill(seed, grid);
    memset(joint, 0, sizeof joint);
    for (size_t part = 0; part < 3; ++part) {
        CHECK(vi_door_correlation_add(value, COUNT, (size_t)window + 1 + part, COUNT, 3, EMBEDDING, lowest, RADII,
                                      &joint[0][0][0][0]) == 0, "part %d", (int)part);
    }
    for (int m = 1; m <= EMBEDDING; ++m) {
        for (int k = 0; k < RADII; k += 3) {
            const uint64_t expected = brute_force(m, radius(lowest, k), window), found = counted(m, k);
            CHECK(found == expected, "m %d, radius %g: %llu, not %llu", m, radius(lowest, k),
                  (unsigned long long)found, (unsigned long long)expected);
        }
    }
}

static void refuses(size_t first, size_t step, int embedding, double lowest, int radii)
{
    CHECK(vi_door_correlation_add(value, COUNT, first, COUNT, step, embedding, lowest, radii, &joint[0][0][0][0]) == 1,
          "%d %d %d %g %d", (int)first, (int)step, embedding, lowest, radii);
}

int main(void)
{
    uint64_t seed = 5;
    CHECK(vi_door_correlation_padding() == VI_CORRELATION_PADDING, "padding");
    CHECK(vi_door_correlation_tables() == VI_CORRELATION_TABLES, "tables");
    compare(&seed, 0.0, 1.0 / 16.0, 0);
    compare(&seed, 0.0, 1.375 / 1024.0, 1);
    compare(&seed, 1.0 / 64.0, 1.0 / 128.0, 7);
    compare(&seed, 0.1, 1.125 / 64.0, 0);
    refuses(0, 1, 2, 0.5, 20);
    refuses(1, 0, 2, 0.5, 20);
    refuses(1, 1, 0, 0.5, 20);
    refuses(1, 1, VI_MOST_EMBEDDING + 1, 0.5, 20);
    refuses(1, 1, 2, 0.5, 1);
    refuses(1, 1, 2, 0.5, VI_MOST_RADII + 1);
    refuses(1, 1, 2, 0.51, 20);
    refuses(1, 1, 2, 0.0, 20);
    refuses(1, 1, 2, (double)NAN, 20);
    refuses(1, 1, 2, (double)INFINITY, 20);
    value[COUNT] = 0.0;
    refuses(1, 1, 2, 0.5, 20);
    return 0;
}
