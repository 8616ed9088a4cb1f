/* The motion of one point over one cell, as a polynomial: the careful search for contacts, and crests. */
#ifndef VIBROIMPACT_LANE_CELL_H
#define VIBROIMPACT_LANE_CELL_H

#include "lanes/lane_group.h"

/* Taylor terms of a displacement over the share of the cell. */
typedef struct {
    double term[VI_SINE_ORDER + 1];
    int order; /* of the last term */
} vi_lane_cell;

/* Result of a careful search. */
typedef enum {
    VI_CELL_CLEAR,
    VI_CELL_HIT,
    VI_CELL_UNDECIDED,
    VI_CELL_ACTED /* the body has acted on an event of its own */
} vi_cell_result;

/* Displacement and its slope over the share, at a share of the cell. */
void vi_lane_cell_at(const vi_lane_cell *cell, double share, double *displacement, double *slope);

/* First zero of a displacement that rises from below, up to *share, certified; a hit sets its share and the slope
 * there. scale: sum of the sizes of the displacement's terms. */
vi_cell_result vi_lane_cell_search(const vi_lane_cell *cell, double scale, double *share, double *slope);

/* Largest sign * displacement strictly inside the cell, up to the share `end`; -HUGE_VAL: an end has the largest. */
double vi_lane_cell_crest(const vi_lane_cell *cell, double sign, double end);

#endif
