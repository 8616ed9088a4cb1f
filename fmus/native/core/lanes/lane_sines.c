#include "lanes/lane_sines.h"

#define VI_WIDTH 1
#include "lanes/sines.h"
#include "motion/sines.h"

/* Resolutions of the parts of a number of turns. */
static const double COARSE = 1.0 / 134217728.0, FINE = 1.0 / 18014398509481984.0; /* 2^-27, 2^-54 */
/* Turns in 1 rad. */
static const double TURNS_OF_RADIAN = 0.15915494309189533577;

/* Split the turns of a sine in a period of the clock, less whole ones. */
static void split_turns(const vi_sine *sine, int k, int lane, vi_lane_sines *sines)
{
    const double part = sine->turns - nearbyint(sine->turns), coarse = nearbyint(part / COARSE) * COARSE;
    const double left = part - coarse, fine = nearbyint(left / FINE) * FINE;
    sines->turns[k][0][lane] = coarse;
    sines->turns[k][1][lane] = fine;
    sines->turns[k][2][lane] = (left - fine) + sine->turns_low;
}

/* Set the numbers from which lockstep finds the phase of a harmonic of the clock. */
static void take_harmonic(const vi_sine *sine, int k, int lane, vi_lane_sines *sines)
{
    const vi_phase start = vi_sine_phase(sine, (vi_instant){0, 0.0, 0.0});
    sines->harmonic[k][lane] = (double)sine->harmonic;
    sines->drift[k][lane] = sine->drift * TURNS_OF_RADIAN;
    sines->start_cosine[k][lane] = start.cosine;
    sines->start_sine[k][lane] = start.sine;
    sines->highest = sine->harmonic > sines->highest ? sine->harmonic : sines->highest;
    sines->others += sine->harmonic == 0;
}

bool vi_lane_take_sines(vi_lane_group *g, int lane, const vi_lanes_points *points, int64_t point, const vi_clock *clock,
                        int64_t last)
{
    const int further = vi_further_sines(g);
    for (int k = 0; k < further; ++k) {
        const int64_t i = k * points->count + point;
        const double w = points->further_frequency[i], phase = points->further_phase[i];
        if (!(w > 0.0) || !isfinite(w) || !isfinite(phase) || !((double)last < VI_MOST_TURNS)) {
            return false;
        }
        const vi_sine sine = vi_sine_start(clock, w, phase);
        g->sines->angular_frequency[k][lane] = w;
        g->sines->rate[k][lane] = w * TURNS_OF_RADIAN;
        g->sines->turn[k][lane] = sine.start + sine.start_low;
        split_turns(&sine, k, lane, g->sines);
        take_harmonic(&sine, k, lane, g->sines);
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
