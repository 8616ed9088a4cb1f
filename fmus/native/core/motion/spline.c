#include "motion/spline.h"

#include <float.h>
#include <math.h>

void vi_spline_prepare(const double time[], const double value[], int count, double curvature[], double room[])
{
    /* (h0 m0 + 2 (h0 + h1) m1 + h1 m2) / 6 = s1 - s0 at each inner knot, with slopes s; Gaussian elimination */
    curvature[0] = room[0] = 0.0;
    for (int i = 1; i + 1 < count; ++i) {
        const double before = time[i] - time[i - 1], after = time[i + 1] - time[i];
        const double turn = (value[i + 1] - value[i]) / after - (value[i] - value[i - 1]) / before;
        const double pivot = 2.0 * (before + after) - before * room[i - 1];
        room[i] = after / pivot;
        curvature[i] = (6.0 * turn - before * curvature[i - 1]) / pivot;
    }
    curvature[count - 1] = 0.0;
    for (int i = count - 2; i > 0; --i) {
        curvature[i] -= room[i] * curvature[i + 1];
    }
}

/* The last knot at or before an instant, by bisection; -1 before the first. An instant within rounding of a knot counts
 * as this knot: the piece that begins there is then a whole one. */
static int knot_before(const double time[], int count, double now)
{
    const double instant = now + 4.0 * DBL_EPSILON * fabs(now);
    int low = -1, high = count;
    while (high - low > 1) {
        const int middle = low + (high - low) / 2;
        *(time[middle] <= instant ? &low : &high) = middle;
    }
    return low;
}

/* The slope of the piece behind knot i, at that knot (side 0) or at the next (side 1). */
static double slope_at(const vi_knots *k, int i, int side)
{
    const double length = k->time[i + 1] - k->time[i], chord = (k->value[i + 1] - k->value[i]) / length;
    const double here = k->curvature[i + side], there = k->curvature[i + 1 - side];
    const double bend = length * (2.0 * here + there) / 6.0;
    return side == 0 ? chord - bend : chord + bend;
}

vi_spline_point vi_spline_at(const vi_knots *knots, int first, int count, double time, double time_low)
{
    const int i = first + knot_before(knots->time + first, count, time), last = first + count - 1;
    if (i < first || i >= last) { /* on a straight line */
        const int end = i < first ? first : last;
        const double slope = slope_at(knots, i < first ? first : last - 1, i >= last);
        const double since = (time - knots->time[end]) + time_low;
        return (vi_spline_point){knots->value[end] + slope * since, slope, 0.0, 0.0, i < first ? -since : HUGE_VAL};
    }
    const double length = knots->time[i + 1] - knots->time[i], since = (time - knots->time[i]) + time_low;
    const double slope = slope_at(knots, i, 0), bend = knots->curvature[i];
    const double jerk = (knots->curvature[i + 1] - bend) / length;
    return (vi_spline_point){knots->value[i] + since * (slope + since * (0.5 * bend + since * (jerk / 6.0))),
                             slope + since * (bend + 0.5 * since * jerk), bend + since * jerk, jerk,
                             (knots->time[i + 1] - time) - time_low};
}
