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

/* The states VI_CELLS cells later. */
LANES_INLINE state after_all_cells(const vi_one_mode *tables, int lane, const state *s)
{
    state next = {row_of_lane(tables->end_q[VI_CELLS], lane, s), row_of_lane(tables->end_p[VI_CELLS], lane, s), s->q, s->q};
    turn_on(tables, lane, VI_CELLS, s, &next.cosine, &next.sine);
    return next;
}

/* The states after whole cells, of each state its own number below VI_CELLS. Periodic motion has few such numbers. */
LANES_INLINE state after_own_cells(const vi_one_mode *tables, int lane, const state *s, vector cells)
{
    state found = *s;
    for (int i = 1; i < VI_CELLS; ++i) {
        const mask here = cells == (double)i;
        if (any(here)) {
            state next = {row_of_lane(tables->end_q[i], lane, s), row_of_lane(tables->end_p[i], lane, s), s->q, s->q};
            turn_on(tables, lane, i, s, &next.cosine, &next.sine);
            found = chosen(here, &next, &found);
        }
    }
    return found;
}

/* Taylor coefficients of q over the cells that begin in these states, in their shares. */
LANES_INLINE void expand_of_lane(const vi_lane_group *g, int lane, const state *s, vector term[])
{
    term[0] = s->q;
    term[1] = s->p * g->cell[lane];
#pragma GCC unroll 16
    for (int n = 2; n <= VI_LANE_ORDER; ++n) {
        term[n] = row_of_lane(g->one.taylor[n], lane, s);
    }
}

#endif
