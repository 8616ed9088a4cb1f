/* Several states of one lane in a vector: its tables, of one mode, are the same for all of them. */
#ifndef VIBROIMPACT_ONE_LANE_H
#define VIBROIMPACT_ONE_LANE_H

#include "lanes/cells.h"

/* Value of a table's row of the lane. */
LANES_INLINE vector row_of_lane(const vi_lane_array row[VI_PARTS], int lane, const state *s)
{
    return (row[VI_OF_Q][lane] * s->q + row[VI_OF_P][lane] * s->p)
           + ((row[VI_OF_COSINE][lane] * s->cosine + row[VI_OF_SINE][lane] * s->sine) + row[VI_OF_ONE][lane]);
}

/* Turn of the force from a state over some cells. */
LANES_INLINE void turn_on(const vi_one_mode *tables, int lane, int cells, const state *s, vector *cosine, vector *sine)
{
    const double c = tables->turn_cosine[cells][lane], n = tables->turn_sine[cells][lane];
    *cosine = s->cosine * c - s->sine * n;
    *sine = s->sine * c + s->cosine * n;
}

/* The states up to VI_CELLS whole cells later. `of`: phases of the further sines in the states. */
LANES_INLINE state after_cells(const vi_lane_group *g, int lane, int cells, const state *s, const phases *of)
{
    const vi_one_mode *tables = &g->one;
    const int further = vi_further_sines(g);
    state next = {row_of_lane(tables->end_q[cells], lane, s), row_of_lane(tables->end_p[cells], lane, s), s->q, s->q};
    if (further) {
        add_sines_of_lane(g->sines->end_q + cells, 1, lane, further, of, &next.q);
        add_sines_of_lane(g->sines->end_p + cells, 1, lane, further, of, &next.p);
    }
    turn_on(tables, lane, cells, s, &next.cosine, &next.sine);
    return next;
}

/* The states after whole cells, of each state its own number below VI_CELLS. Periodic motion has few such numbers. */
LANES_INLINE state after_own_cells(const vi_lane_group *g, int lane, const state *s, const phases *of, vector cells)
{
    state found = *s;
    for (int i = 1; i < VI_CELLS; ++i) {
        const mask here = cells == (double)i;
        if (any(here)) {
            const state next = after_cells(g, lane, i, s, of);
            found = chosen(here, &next, &found);
        }
    }
    return found;
}

/* Taylor coefficients of q over the cells that begin in these states, in their shares. */
LANES_INLINE void expand_of_lane(const vi_lane_group *g, int lane, const state *s, const phases *of, vector term[])
{
    const int further = vi_further_sines(g);
    term[0] = s->q;
    term[1] = s->p * g->cell[lane];
#pragma GCC unroll 16
    for (int n = 2; n <= VI_LANE_ORDER; ++n) {
        term[n] = row_of_lane(g->one.taylor[n], lane, s);
    }
    if (further) {
#pragma GCC unroll 4
        for (int n = VI_LANE_ORDER + 1; n <= VI_SINE_ORDER; ++n) {
            term[n] = all(0.0);
        }
        add_sines_of_lane(g->sines->taylor + 2, VI_SINE_ORDER - 1, lane, further, of, term + 2);
    }
}

/* Evaluate a motion that expand_of_lane has expanded. */
LANES_INLINE void evaluate_of_lane(const vi_lane_group *g, const vector term[], vector share, vector *added, vector *slope)
{
    if (vi_further_sines(g)) {
        evaluate(term, VI_SINE_ORDER, share, added, slope);
    } else {
        evaluate(term, VI_LANE_ORDER, share, added, slope);
    }
}

/* Half the second derivative of such a motion. */
LANES_INLINE vector half_bend_of_lane(const vi_lane_group *g, const vector term[], vector share)
{
    return vi_further_sines(g) ? half_bend(term, VI_SINE_ORDER, share) : half_bend(term, VI_LANE_ORDER, share);
}

#endif
