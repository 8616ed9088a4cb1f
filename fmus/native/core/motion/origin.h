/* Origin of a mode's unforced motion: the instant and state from which the motion is counted.
 *
 * A flight that is cut (at a communication point, a sample, the end of a period) goes on from the state it has reached.
 * Counted from that state, each cut would add the rounding of one propagator. This rounding is the same at equal steps:
 * 4e-17 of the energy, always with one sign. So the next flight is counted from the start of the first flight, as long
 * as nothing else has changed the motion.
 */
#ifndef VIBROIMPACT_ORIGIN_H
#define VIBROIMPACT_ORIGIN_H

#include "motion/clock.h"
#include "motion/flow.h"

typedef struct {
    vi_instant at;
    double x, v, amplitude;      /* unforced motion at the origin; see vi_segment */
    double reached_x, reached_v; /* whole motion at the end of the last flight counted from here */
    double held;                 /* constant input since the origin */
    double stiffness, decay;     /* of the mode; both may follow its amplitude */
    int64_t known;               /* 64 bits, to avoid padding: its bytes would show in saved states */
} vi_origin;

/* Time since an instant that several modes may share. */
typedef struct {
    vi_instant at;
    double high, low; /* s; their sum is the time */
} vi_since;

/* Count a segment that starts now at displacement x and velocity v from the origin. It stays as it is if anything has
 * changed the motion since, or if damping has removed the rounding. `since` is a cache for the next mode. */
void vi_origin_follow(const vi_origin *origin, vi_segment *segment, const vi_clock *clock, vi_instant now, double x,
                      double v, vi_since *since);

/* Tell the origin that the segment, begun at `start`, has reached this displacement and velocity without an event. */
void vi_origin_reach(vi_origin *origin, const vi_segment *segment, vi_instant start, double x, double v);

#endif
