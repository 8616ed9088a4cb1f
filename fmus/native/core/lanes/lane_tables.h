/* Tables of a lane's motion: Taylor terms over a cell, and the states after whole cells. */
#ifndef VIBROIMPACT_LANE_TABLES_H
#define VIBROIMPACT_LANE_TABLES_H

#include "lanes/lane_group.h"

/* A mode and its loads, per unit modal mass: see lanes.h. */
typedef struct {
    double stiffness, decay, force, held, angular_frequency;
} vi_lane_mode;

/* Fill the tables of one lane for cells of this length, s, and its bounds; the length must be short against every rate. */
void vi_lane_tables(vi_one_mode *tables, int lane, const vi_lane_mode *mode, double cell);

/* Fill the tables of one lane for pairs of cells, after vi_lane_tables. */
void vi_lane_pair_tables(vi_one_mode *tables, int lane, const vi_lane_mode *mode, double cell);

/* Fill the tables of one lane for a further sine, whose force and angular frequency `mode` has; then its bounds cover it.
 * After the tables of the mode and of all sines before it. */
void vi_lane_sine_tables(vi_one_mode *tables, vi_lane_sines *sines, int further, int lane, const vi_lane_mode *mode,
                         double cell);

#endif
