/* The touch-downs on stops that yield, noted for the rows of their contacts. For any width of vectors. */
#include "lanes/recording.h"

/* Note the touch-downs at which some lanes are; their contacts are to be recorded. */
LANES_INLINE void note_touch_downs(vi_lane_group *g, int at, mask touches)
{
    vi_yielding *yielding = &g->yielding;
    vector cosine, sine;
    turn(load(g->angular_frequency + at) * load(g->rest + at), &cosine, &sine);
    double *const to[] = {yielding->open,          yielding->touch_periods, yielding->touch_rest,
                          yielding->touch_rest_low, yielding->touch_time,    yielding->touch_phase,
                          yielding->touch_cosine,  yielding->touch_sine,    yielding->touch_approach};
    const vector value[] = {all(1.0),       load(g->periods + at), load(g->rest + at), load(g->rest_low + at),
                            time_of(g, at), phase_of(g, at),       cosine,             sine,
                            load(g->approach + at)};
    for (int i = 0; i < 9; ++i) {
        store(to[i] + at, choose(touches, value[i], load(to[i] + at)));
    }
}
