/* Flights over many intervals of a random load, far from all stops; equations.md 8.10. Each mode steps from interval to
 * interval by its response to the coefficients of the spline.
 */
#ifndef VIBROIMPACT_RANDOM_FLIGHT_H
#define VIBROIMPACT_RANDOM_FLIGHT_H

#include "body/modal/state.h"

/* Fly over intervals that end before `target` and in which no stop and no record of an extreme can be met. The modal
 * state is moved, the instant is not. Returns the length, s; 0 where there are no such intervals. */
#if VI_SIGNALS > 0

double vi_random_flight(const vi_structure *s, vi_instant target);

#else

static inline double vi_random_flight(const vi_structure *s, vi_instant target)
{
    (void)s;
    (void)target;
    return 0.0;
}

#endif

#endif
