#include "lanes/lane_sines.h"

#define VI_WIDTH 1
#include "lanes/sines.h"

/* A turn, rad, in two parts. */
static const double TURN = 6.283185307179586232, TURN_LOW = 2.449293598294706414e-16;
/* Resolutions of the parts of a number of turns. */
static const double COARSE = 1.0 / 134217728.0, FINE = 1.0 / 18014398509481984.0; /* 2^-27, 2^-54 */
/* Most turns of a sine in a period of the clock; more have more cells than a period may have. */
static const double MOST_TURNS = 1e6;

/* A number to twice the digits. */
typedef struct {
    double high, low;
} twofold;

/* a / TURN */
static twofold in_turns(double a)
{
    const double high = a / TURN;
    return (twofold){high, (fma(-high, TURN, a) - high * TURN_LOW) / TURN};
}

static twofold product(twofold a, double b, double b_low)
{
    const double high = a.high * b;
    return (twofold){high, fma(a.high, b, -high) + (a.high * b_low + a.low * b)};
}

/* a - b less its whole turns, rounded once. */
static double fraction_between(twofold a, twofold b)
{
    const double difference = (a.high - nearbyint(a.high)) - (b.high - nearbyint(b.high)) + (a.low - b.low);
    return difference - nearbyint(difference);
}

/* Split a number of turns, less its whole ones. */
static void split(twofold turns, int k, int lane, vi_lane_sines *sines)
{
    const double part = turns.high - nearbyint(turns.high), coarse = nearbyint(part / COARSE) * COARSE;
    const double left = part - coarse, fine = nearbyint(left / FINE) * FINE;
    sines->turns[k][0][lane] = coarse;
    sines->turns[k][1][lane] = fine;
    sines->turns[k][2][lane] = (left - fine) + turns.low;
}

bool vi_lane_take_sines(vi_lane_group *g, int lane, const vi_lanes_points *points, int64_t point, const vi_clock *clock,
                        int64_t last)
{
    const int further = vi_further_sines(g);
    for (int k = 0; k < further; ++k) {
        const int64_t i = k * points->count + point;
        const double w = points->further_frequency[i], phase = points->further_phase[i];
        const twofold rate = in_turns(w), turns = product(rate, clock->period, clock->period_low);
        if (!(w > 0.0) || !isfinite(phase) || !(turns.high < MOST_TURNS) || !((double)last < VI_MOST_TURNS)) {
            return false;
        }
        const twofold since = product(rate, clock->origin, clock->origin_low);
        g->sines->angular_frequency[k][lane] = w;
        g->sines->rate[k][lane] = rate.high;
        g->sines->turn[k][lane] = fraction_between(in_turns(remainder(phase, TURN)), since);
        split(turns, k, lane, g->sines);
    }
    return true;
}

vi_lane_phases vi_lane_phases_at(const vi_lane_group *g, int lane, double periods, double rest)
{
    vi_lane_phases found;
    phases of;
    const int further = vi_further_sines(g);
    phases_at(g, lane, further, all(periods), all(rest), &of);
    for (int k = 0; k < further; ++k) {
        found.of[k][VI_OF_ITS_COSINE] = of.cosine[k][0];
        found.of[k][VI_OF_ITS_SINE] = of.sine[k][0];
    }
    return found;
}

void vi_lane_set_sines(vi_lane_group *g, int lane, int own)
{
    set_sines(g, lane, own, vi_further_sines(g));
}
