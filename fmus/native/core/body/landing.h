/* How a flight ends, for all bodies: where a segment ends, when a contact counts as met, and from which bounces on a
 * body is followed from its stop. */
#ifndef VIBROIMPACT_LANDING_H
#define VIBROIMPACT_LANDING_H

#include <float.h>
#include <math.h>
#include <stdbool.h>

#include "motion/clock.h"
#include "motion/majorant.h"

/* Rounding of a displacement, in units of the terms it is the sum of. */
#define VI_ROUNDING (4.0 * DBL_EPSILON)
/* Length of a bounce, in radians of the fastest rate, below which it is followed from the stop, not from the origin: of
 * it only the stop's position is rounded. */
#define VI_LOW_BOUNCE 0.1
/* Distance from its stop, relative to its other displacements, below which a body that goes no further within a radian
 * is followed from where it is. */
#define VI_LINGERING 1e-6
/* Seconds to a contact, in radians of the fastest rate, below which a parabola may tell it. */
#define VI_NEAR_CONTACT 1e-4

/* What the end of a segment is. */
typedef enum { VI_ENDS_ANYWHERE, VI_ENDS_AT_TARGET, VI_ENDS_AT_PERIOD } vi_ending;

/* How long one segment from `now` may be, s, and what its end is. `periods`: the ends of forcing periods are met. */
double vi_segment_length(const vi_clock *clock, vi_instant now, vi_instant target, bool periods, vi_ending *ending);

/* A contact found by rounding just past the end of the period or of the step is at its end. */
vi_ending vi_ending_at(vi_ending ending, double u, double length, double room);

/* Room after the end of a step, s, in which a contact with another FMU's stop counts as at the end. */
double vi_landing_room(double time);

/* Seconds to the contact when the parabola that touches the motion here tells it, and the speed there, to the last bit:
 * no further evaluation is needed. HUGE_VAL otherwise. `scale`: size of the terms that the displacement is the sum of. */
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
