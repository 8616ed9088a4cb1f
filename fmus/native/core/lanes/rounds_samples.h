/* Samples of a vector of lanes in a round; they change nothing of its motion. */
#ifndef VIBROIMPACT_LANE_ROUNDS_SAMPLES_H
#define VIBROIMPACT_LANE_ROUNDS_SAMPLES_H

#include "lanes/recording.h"
#include "lanes/sampling.h"

/* Keep the states at the start of a round: its samples are taken from there on. */
LANES_INLINE void sample_from(vi_lane_group *g, int at, vector q, vector p, vector cosine, vector sine)
{
    vi_lane_samples *samples = &g->samples;
    store(samples->from_q + at, q);
    store(samples->from_p + at, p);
    store(samples->from_cosine + at, cosine);
    store(samples->from_sine + at, sine);
    store(samples->from_periods + at, load(g->periods + at));
    store(samples->from_rest + at, load(g->rest + at));
    store(samples->from_rest_low + at, load(g->rest_low + at));
    store(samples->from_pressed + at, load(g->yielding.pressed_stop + at));
}

/* Lanes that may have a sample up to the present instants. */
LANES_INLINE mask may_have_samples(const vi_lane_group *g, int at)
{
    const mask sampled = load(g->samples.next + at) < load(g->samples.count + at);
    if (!any(sampled)) {
        return sampled;
    }
    /* a sample at the end of the round may be after it by rounding */
    return sampled & (load(g->samples.time + at) <= time_of(g, at) * (1.0 + 16.0 * 2.220446049250313e-16));
}

/* Take the samples of some lanes since the start of the round, after their clocks have moved. */
LANES_INLINE void take_samples(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at, mask where)
{
    const mask samples = may_have_samples(g, at);
    for (int i = 0; i < VI_WIDTH; ++i) {
        if (samples[i] & where[i]) {
            vi_lane_take_samples(g, plan, points, at + i);
        }
    }
}

/* Take the samples of lanes up to a strobe inside a round; further samples are taken from there on. */
LANES_INLINE void sample_to_strobe(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at, mask turns,
                                   vector q, vector p)
{
    vi_lane_samples *samples = &g->samples;
    double *const to[] = {samples->from_q,       samples->from_p,    samples->from_cosine,  samples->from_sine,
                          samples->from_periods, samples->from_rest, samples->from_rest_low};
    const vector value[] = {q, p, all(1.0), all(0.0), load(g->periods + at), all(0.0), all(0.0)};
    take_samples(g, plan, points, at, turns);
    for (int i = 0; i < 7; ++i) {
        store(to[i] + at, choose(turns, value[i], load(to[i] + at)));
    }
}

#endif
