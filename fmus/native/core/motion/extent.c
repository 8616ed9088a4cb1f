#include "motion/extent.h"

#include <math.h>

/* Bounds of a mode for a whole flight, where nothing grows: an underdamped mode stays within its amplitude. */
static vi_extent falling_extent(const vi_segment *segment)
{
    const vi_mode *mode = segment->mode;
    const double x = segment->start, v = segment->start_rate;
    if (mode->regime == VI_UNDERDAMPED && mode->rate > 0.1 * mode->natural) {
        const double rate = mode->natural * segment->amplitude;
        return (vi_extent){segment->amplitude, rate, mode->stiffness * mode->natural * rate};
    }
    const double damping = 2.0 * fabs(mode->decay), stiffness = fabs(mode->stiffness);
    const double rate = sqrt(v * v + stiffness * x * x), second = sqrt(damping * damping + stiffness) * rate;
    const double third = damping * second + stiffness * rate;
    const double reach = mode->natural > 0.0 ? rate / mode->natural : HUGE_VAL;
    return (vi_extent){reach, rate, damping * third + stiffness * second};
}

vi_extent vi_extent_of(const vi_segment *segment)
{
    const vi_extent e = falling_extent(segment);
    const double swell = segment->swell;
    return vi_mode_grows(segment->mode) ? (vi_extent){swell * e.reach, swell * e.rate, swell * e.fourth} : e;
}
