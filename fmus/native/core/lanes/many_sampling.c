#include "lanes/many_sampling.h"

#define VI_WIDTH 1
#include "lanes/many_samples.h"

void vi_lane_sample_many_from(vi_lane_group *g, int lane, int modes)
{
    vector cosine, sine;
    turn(load(g->angular_frequency + lane) * load(g->rest + lane), &cosine, &sine);
    store(g->start_cosine + lane, cosine);
    store(g->start_sine + lane, sine);
    if (g->sines != NULL) {
        set_sines(g, lane, modes - 2 * vi_further_sines(g), vi_further_sines(g));
    }
    for (int j = 0; j < modes; ++j) {
        g->start_q[j][lane] = g->q[j][lane];
        g->start_p[j][lane] = g->p[j][lane];
    }
    sample_instants_from(g, lane);
}

void vi_lane_take_samples_of_many(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int lane)
{
    take_samples_of_many(g, plan, points, lane);
}
