/* The motion of one lane of a body of one mode, from the tables of a phase. */
#ifndef VIBROIMPACT_LANE_STATE_H
#define VIBROIMPACT_LANE_STATE_H

#include "lanes/lane_cell.h"
#include "lanes/lane_sines.h"

/* State of a lane at the start of a cell. */
typedef struct {
    double q, p, cosine, sine;
} vi_lane_state;

/* Value of a table's row. */
static inline double vi_lane_row(const vi_lane_array row[VI_PARTS], int lane, const vi_lane_state *s)
{
    return (row[VI_OF_Q][lane] * s->q + row[VI_OF_P][lane] * s->p)
           + ((row[VI_OF_COSINE][lane] * s->cosine + row[VI_OF_SINE][lane] * s->sine) + row[VI_OF_ONE][lane]);
}

/* The state after up to VI_CELLS whole cells. */
static inline vi_lane_state vi_lane_after_cells(const vi_one_mode *tables, int lane, const vi_lane_state *s, int cells)
{
    const double turn = tables->turn_cosine[cells][lane], turn_sine = tables->turn_sine[cells][lane];
    return (vi_lane_state){vi_lane_row(tables->end_q[cells], lane, s), vi_lane_row(tables->end_p[cells], lane, s),
                           s->cosine * turn - s->sine * turn_sine, s->sine * turn + s->cosine * turn_sine};
}

/* The motion of q over the cell of this length, s, that begins in a state. */
static inline vi_lane_cell vi_lane_cell_from(const vi_one_mode *tables, int lane, const vi_lane_state *s, double length)
{
    vi_lane_cell cell = {{s->q, s->p * length}, VI_LANE_ORDER};
    for (int n = 2; n <= VI_LANE_ORDER; ++n) {
        cell.term[n] = vi_lane_row(tables->taylor[n], lane, s);
    }
    return cell;
}

/* Add the further sines, in their phases at the start of the cell, to its motion. */
static inline void vi_lane_cell_add_sines(vi_lane_cell *cell, const vi_lane_group *group, int lane,
                                          const vi_lane_phases *phases)
{
    const int further = vi_further_sines(group);
    for (int n = 2; n <= VI_SINE_ORDER && further > 0; ++n) {
        const double own = n <= VI_LANE_ORDER ? cell->term[n] : 0.0;
        cell->term[n] = vi_lane_add_sines(own, group->sines->taylor[n], lane, further, phases);
        cell->order = VI_SINE_ORDER;
    }
}

/* Add the further sines, in their phases at the start, to the state after up to VI_CELLS whole cells. */
static inline void vi_lane_state_add_sines(vi_lane_state *after, const vi_lane_group *group, int lane, int cells,
                                           const vi_lane_phases *phases)
{
    const int further = vi_further_sines(group);
    if (further > 0) {
        after->q = vi_lane_add_sines(after->q, group->sines->end_q[cells], lane, further, phases);
        after->p = vi_lane_add_sines(after->p, group->sines->end_p[cells], lane, further, phases);
    }
}

#endif
