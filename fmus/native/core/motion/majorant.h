/* Certified steps: how far a motion may be followed without any chance of having passed its stop.
 *
 * After s the clearance is at least d - v s - a s^2/2 - j s^3/6 - bound s^4/24, with clearance d >= 0, approach
 * velocity v, acceleration a and jerk j towards the stop and a bound on the fourth derivative; no root of the motion
 * lies before the first root of this majorant. Two orders more than equations.md 2.1, so fewer evaluations of the
 * flow; and it leaves an impact (d = 0, v < 0), a touch (d = v = 0, a < 0) and a release (d = v = a = 0, j < 0: 2.4)
 * by itself.
 */
#ifndef VIBROIMPACT_MAJORANT_H
#define VIBROIMPACT_MAJORANT_H

#include <math.h>

/* The state of a motion towards a stop. */
typedef struct {
    double clearance;    /* >= 0, m */
    double velocity;     /* positive towards the stop, m/s */
    double acceleration; /* likewise, m/s^2 */
    double jerk;         /* likewise, m/s^3 */
    double bound;        /* >= |fourth derivative| over the horizon, m/s^4 */
} vi_approach;

/* Evaluations after which a search along one piece of motion ends where it is, that far certified: the rest is a piece
 * of its own. Some tens are usual. */
enum { VI_MOST_EVALUATIONS = 10000 };

/* A step s, 0 <= s <= horizon, such that the clearance stays >= 0 over [0, s]. s = horizon: nothing before it. */
double vi_certified_step(const vi_approach *approach, double horizon);

/* First root of clearance - velocity s - acceleration s^2/2 for s > 0; HUGE_VAL when there is none. */
static inline double vi_parabola_root(double clearance, double velocity, double acceleration)
{
    const double square = velocity * velocity + 2.0 * acceleration * clearance;
    if (velocity > 0.0) {
        return square < 0.0 ? HUGE_VAL : 2.0 * clearance / (velocity + sqrt(square));
    }
    return acceleration > 0.0 ? (sqrt(square) - velocity) / acceleration : HUGE_VAL;
}

/* Least step of a search for extremes over `length`: at first this share of it, doubled time and again so that the search
 * ends. */
static inline double vi_least_step(double length, double share, int evaluation)
{
    return ldexp(share * length, evaluation / 1024);
}

/* fmin and fmax without their rules for NaN, which cost a call each. */
static inline double vi_min(double a, double b)
{
    return a < b ? a : b;
}

static inline double vi_max(double a, double b)
{
    return a > b ? a : b;
}

#endif
