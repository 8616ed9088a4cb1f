/* Ends of flights of all bodies: the end of a segment, the tolerance of a contact, bounces followed from the stop. */
#ifndef VIBROIMPACT_LANDING_H
#define VIBROIMPACT_LANDING_H

#include <float.h>
#include <math.h>
#include <stdbool.h>

#include "motion/clock.h"
#include "motion/majorant.h"

/* Rounding of a displacement, in units of the sum of the sizes of its terms. */
#define VI_ROUNDING (4.0 * DBL_EPSILON)
/* Length of a bounce, in radians of the fastest rate. A shorter bounce is followed from the stop, not from the origin:
 * only the stop's position is then rounded. */
#define VI_LOW_BOUNCE 0.1
/* Distance from the stop, relative to other displacements. A body staying closer over a radian is followed from
 * there. */
#define VI_LINGERING 1e-6
/* Time to a contact, in radians of the fastest rate, below which a parabola may locate the contact. */
#define VI_NEAR_CONTACT 1e-4

/* Kind of the end of a segment. */
typedef enum { VI_ENDS_ANYWHERE, VI_ENDS_AT_TARGET, VI_ENDS_AT_PERIOD } vi_ending;

/* Length of one segment from `now`, s, and the kind of its end. `periods`: also end at forcing periods. */
double vi_segment_length(const vi_clock *clock, vi_instant now, vi_instant target, bool periods, vi_ending *ending);

/* The segment's end if a contact at u is, by rounding, at or past this end; otherwise VI_ENDS_ANYWHERE. */
vi_ending vi_ending_at(vi_ending ending, double u, double length, double room);

/* Time after the end of a step, s, within which a contact with another FMU's stop counts as at the end. */
double vi_landing_room(double time);

/* Seconds to the contact, from the parabola that touches the motion here, if time and speed are exact to the last bit;
 * otherwise HUGE_VAL. This saves further evaluations. `scale`: sum of the sizes of the displacement's terms. */
static inline double vi_seconds_to_landing(const vi_approach *p, double fastest, double scale)
{
    if (!(p->clearance * fastest < VI_NEAR_CONTACT * p->velocity)) {
        return HUGE_VAL;
    }
    const double s = vi_parabola_root(p->clearance, p->velocity, p->acceleration), cube = s * s * s;
    const bool exact = fabs(p->jerk) * cube <= DBL_EPSILON * scale && p->bound * cube <= DBL_EPSILON * p->velocity;
    return exact ? s : HUGE_VAL;
}

#endif
