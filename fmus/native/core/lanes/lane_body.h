/* Functions that differ between bodies of one mode and bodies of several modes in a lane. */
#ifndef VIBROIMPACT_LANE_BODY_H
#define VIBROIMPACT_LANE_BODY_H

#include <stdbool.h>

#include "lanes/lane_cell.h"

/* A meeting: the contact, from 0, and its speed of approach, in the units of vi_lane_group. */
typedef struct {
    int contact;
    double approach;
} vi_lane_meeting;

typedef struct {
    /* Put the body of a point in the lane, in this state; its clock is set. False if lockstep cannot follow it. */
    bool (*take)(vi_lane_group *group, int lane, const vi_lanes_plan *plan, const vi_lanes_points *points, int64_t point,
                 const double q[], const double p[]);
    /* Search for the first contact up to *share of the present cell; then the lane is moved to the new *share. */
    vi_cell_result (*search)(vi_lane_group *group, int lane, int modes, int contacts, double *share, vi_lane_meeting *met);
    /* Turn the velocity of a contact just met into a rebound at this speed; false for a touch that may be no impact. */
    bool (*rebound)(vi_lane_group *group, int lane, int modes, const vi_lane_meeting *met, double after);
    /* Extend `most` and `least` of the record over the lane's last round. NULL: flights wait for their record. */
    void (*extremes)(vi_lane_group *group, int lane, int modes, int contacts);
    /* The observed displacement and velocity, in units of the record; a body of one mode beyond its stop by rounding is
     * put on it. */
    void (*observe)(vi_lane_group *group, int lane, int modes, int contacts, double *displacement, double *velocity);
    /* Modal displacements and velocities. */
    void (*state)(const vi_lane_group *group, int lane, const vi_lanes_plan *plan, double q[], double p[]);
    /* Keep the lane's state: the next samples are taken from here on. */
    void (*sample_from)(vi_lane_group *group, int lane, int modes);
    /* Take the samples up to the lane's instant, in the phase in which the motion since `sample_from` began. */
    void (*take_samples)(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane);
} vi_lane_body;

extern const vi_lane_body vi_lane_one_mode, vi_lane_many_modes;

/* Length of a cell, in units of 1 / fastest rate; the omitted Taylor terms are below 1e-17 of the first. */
#define VI_CELL_REACH 0.35
/* Cells in a period above which lockstep refuses a body: its rates are too far apart. */
#define VI_MOST_CELLS 4096.0
/* Longest cell, in periods; a round of four times all cells and one more then takes less than three periods. */
#define VI_LONGEST_CELL 0.0625

/* The longest length of cells up to `longest` whose multiples up to 512 are exact. */
static inline double vi_lane_cell_length(double longest)
{
    const double coarse = longest * 1024.0;
    return (longest + coarse) - coarse;
}

/* Is contact `place` of the points valid for lockstep: finite and in range? */
bool vi_lane_is_contact(const vi_lanes_points *points, int64_t place);

#endif
