/* One lane alone: what lockstep leaves undecided in a cell, and the extremes of a motion. */
#ifndef VIBROIMPACT_LANE_CELL_H
#define VIBROIMPACT_LANE_CELL_H

#include "lanes/lane_group.h"

/* The motion over one cell, in the share of it: Taylor terms of q. */
typedef struct {
    double term[VI_LANE_ORDER + 1];
} vi_lane_cell;

/* What a careful search comes to. */
typedef enum { VI_CELL_CLEAR, VI_CELL_HIT, VI_CELL_UNDECIDED } vi_cell_result;

/* The cell `passed` cells after the start of the lane's last round. */
vi_lane_cell vi_lane_cell_after(const vi_lane_group *group, int lane, int passed);

/* q and dq/dshare after a share of the cell. */
void vi_lane_cell_at(const vi_lane_cell *cell, double share, double *q, double *slope);

/* First contact in the cell of the last round up to *share, certified; a hit tells the share, the contact (from 0) and
 * the speed of approach, in units of q. */
vi_cell_result vi_lane_cell_search(const vi_lane_group *group, int lane, int contacts, double *share, int *contact,
                                   double *approach);

/* Extend the range of q by what the lane went through in its last round. */
void vi_lane_extremes(const vi_lane_group *group, int lane, int contacts, double *highest, double *lowest);

#endif
