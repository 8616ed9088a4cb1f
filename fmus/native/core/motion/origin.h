/* Where the unforced motion of a mode is counted from.
 *
 * A flight that is cut (at a communication point, a sample, the end of a period) goes on from the state it has reached.
 * Counted from there, each cut would add the rounding of one propagator, the same one at equal steps: 4e-17 of the
 * energy, always one way. So the next flight is counted from where the first began, for as long as nothing else has
 * changed the motion.
 */
#ifndef VIBROIMPACT_ORIGIN_H
#define VIBROIMPACT_ORIGIN_H

#include "motion/clock.h"
#include "motion/flow.h"

typedef struct {
    vi_instant at;
    double x, v, amplitude;      /* unforced motion then; see vi_segment */
    double reached_x, reached_v; /* whole motion at the end of the last flight counted from here */
    double held;                 /* constant input meanwhile */
    double stiffness, decay;     /* of the mode, which may follow its amplitude */
    int64_t known;               /* 64 bits: no padding, whose bytes a saved state would show */
} vi_origin;

/* Time since an instant that several modes may have in common. */
typedef struct {
    vi_instant at;
    double high, low; /* s; their sum is the time */
} vi_since;

/* Count a segment that starts now at displacement x and velocity v from the origin, unless something has changed the
 * motion since, or damping has taken the rounding away. `since` is of use for the next mode. */
void vi_origin_follow(const vi_origin *origin, vi_segment *segment, const vi_clock *clock, vi_instant now, double x,
                      double v, vi_since *since);

/* The segment, begun at `start`, has been followed to this displacement and velocity without an event. */
void vi_origin_reach(vi_origin *origin, const vi_segment *segment, vi_instant start, double x, double v);

#endif
