#include "door/correlation.h"

#include <math.h>
#include <string.h>

/* A double has 52 bits after the point; the first 3 of them distinguish 8 radii per octave. */
#define DROPPED_BITS (52 - 3)
#define LENGTH (VI_CORRELATION_BLOCK + VI_MOST_EMBEDDING)

/* Workspace of one block, small enough for the innermost cache. */
typedef struct {
    double distance[LENGTH];
    uint64_t bits[LENGTH];
    uint8_t near[LENGTH];        /* class of |x_i - x_{i+lag}| */
    uint8_t odd[LENGTH];         /* class of the distance in m = 1, 3, 5, ... dimensions */
    uint8_t even[LENGTH];        /* class of the distance in m + 1 dimensions */
    uint16_t cell[VI_CORRELATION_BLOCK];
} block_space;

static uint64_t leading_bits(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits >> DROPPED_BITS;
}

/* Classes of the distances of one block: 0 below the lowest radius, `count` at or beyond the highest, and for NaN. */
static void classify(block_space *s, const double *restrict from, const double *restrict to, double below, double highest,
                     uint64_t base)
{
    for (int j = 0; j < LENGTH; ++j) {
        double d = fabs(to[j] - from[j]);
        /* this order turns NaN into the highest radius */
        d = d < highest ? d : highest;
        s->distance[j] = d > below ? d : below;
    }
    memcpy(s->bits, s->distance, sizeof s->bits);
    for (int j = 0; j < LENGTH; ++j) {
        s->near[j] = (uint8_t)((s->bits[j] >> DROPPED_BITS) - base);
    }
}

/* larger[j] = the larger class of running[j] and of the pair `ahead` places on. */
static void widen(uint8_t *restrict larger, const uint8_t *restrict running, const uint8_t *restrict near, int ahead)
{
    for (int j = 0; j < VI_CORRELATION_BLOCK; ++j) {
        const uint8_t a = running[j], b = near[j + ahead];
        larger[j] = a > b ? a : b;
    }
}

/* Count pairs by cell. Neighbouring pairs often fall into one cell: tables in turn let no increment wait. */
static void count_cells(block_space *s, unsigned stride, size_t table, uint64_t joint[])
{
    for (int j = 0; j < VI_CORRELATION_BLOCK; ++j) {
        s->cell[j] = (uint16_t)(s->even[j] * stride + s->odd[j]);
    }
    for (int j = 0; j < VI_CORRELATION_BLOCK; j += VI_CORRELATION_TABLES) {
        for (size_t t = 0; t < VI_CORRELATION_TABLES; ++t) {
            ++joint[t * table + s->cell[(size_t)j + t]];
        }
    }
}

static void count_block(block_space *s, int embedding, unsigned stride, uint64_t joint[])
{
    const size_t square = (size_t)stride * stride, table = square * (size_t)((embedding + 1) / 2);
    memcpy(s->odd, s->near, sizeof s->odd);
    for (int m = 1; m <= embedding; m += 2) {
        widen(s->even, s->odd, s->near, m);
        count_cells(s, stride, table, joint + (size_t)(m / 2) * square);
        widen(s->odd, s->even, s->near, m + 1);
    }
}

void vi_correlation_add(const double value[], size_t count, size_t first, size_t last, size_t step, int embedding,
                        const vi_radius_ladder *ladder, uint64_t joint[])
{
    block_space space;
    const uint64_t base = leading_bits(ladder->lowest) - 1;
    const uint64_t highest_bits = (base + (uint64_t)ladder->count) << DROPPED_BITS;
    const double below = nextafter(ladder->lowest, 0.0);
    double highest;
    memcpy(&highest, &highest_bits, sizeof highest);
    for (size_t lag = first; lag <= last && lag < count; lag += step) {
        for (size_t i = 0; i < count - lag; i += VI_CORRELATION_BLOCK) {
            classify(&space, value + i, value + i + lag, below, highest, base);
            count_block(&space, embedding, (unsigned)ladder->count + 1, joint);
        }
    }
}
