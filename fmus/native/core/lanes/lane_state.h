/* The motion of one lane of a body of one mode, from the tables of a phase. */
#ifndef VIBROIMPACT_LANE_STATE_H
#define VIBROIMPACT_LANE_STATE_H

#include "lanes/lane_cell.h"

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
    vi_lane_cell cell = {{s->q, s->p * length}};
    for (int n = 2; n <= VI_LANE_ORDER; ++n) {
        cell.term[n] = vi_lane_row(tables->taylor[n], lane, s);
    }
    return cell;
}

#endif
