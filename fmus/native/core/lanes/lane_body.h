/* What differs between a lane with a body of one mode and one with a body of several. */
#ifndef VIBROIMPACT_LANE_BODY_H
#define VIBROIMPACT_LANE_BODY_H

#include <stdbool.h>

#include "lanes/lane_cell.h"

/* A contact that is met: which, from 0, and how fast, as vi_lane_group has speeds. */
typedef struct {
    int contact;
    double approach;
} vi_lane_meeting;

typedef struct {
    /* Take the body of a point, in this state; its clock is there. False where lockstep does not follow it. */
    bool (*take)(vi_lane_group *group, int lane, const vi_lanes_plan *plan, const vi_lanes_points *points, int64_t point,
                 const double q[], const double p[]);
    /* From where it is, look for the first contact up to *share of a cell; then the lane is where *share says. */
    vi_cell_result (*search)(vi_lane_group *group, int lane, int modes, int contacts, double *share, vi_lane_meeting *met);
    /* Turn the velocity of a contact, just met, into a rebound at this speed; false for a touch that may be none. */
    bool (*rebound)(vi_lane_group *group, int lane, int modes, const vi_lane_meeting *met, double after);
    /* Extend the range of the observed displacement by what the lane went through in its last round. */
    void (*extremes)(const vi_lane_group *group, int lane, int modes, int contacts, double *highest, double *lowest);
    /* The observed displacement and velocity; a body of one mode is not beyond a stop but for rounding, and put there. */
    void (*observe)(vi_lane_group *group, int lane, int modes, int contacts, double *displacement, double *velocity);
    /* Modal displacements and velocities. */
    void (*state)(const vi_lane_group *group, int lane, int modes, double q[], double p[]);
} vi_lane_body;

extern const vi_lane_body vi_lane_one_mode, vi_lane_many_modes;

/* Length of a cell times the fastest rate: the Taylor terms that are left out are below 1e-17 of the first. */
#define VI_CELL_REACH 0.35
/* Cells in a period, beyond which a body has rates too far apart for lockstep. */
#define VI_MOST_CELLS 4096.0
/* Longest cell in periods: a round of four times all cells and one more takes less than three periods. */
#define VI_LONGEST_CELL 0.0625

/* A length of cells, at most this long, whose multiples up to 512 are exact. */
static inline double vi_lane_cell_length(double longest)
{
    const double coarse = longest * 1024.0;
    return (longest + coarse) - coarse;
}

/* One contact of a point that lockstep can follow: finite, in range. */
bool vi_lane_is_contact(const vi_lanes_points *points, int64_t place);

#endif
