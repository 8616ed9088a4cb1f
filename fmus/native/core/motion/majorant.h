/* Certified steps: how far a motion may be followed without any chance of having passed its stop.
 *
 * After s the clearance is at least d - v s - a s^2/2 - j s^3/6 - bound s^4/24. Here d >= 0 is the clearance and v the
 * velocity towards the stop; a and j are the acceleration and the jerk. `bound` bounds the fourth derivative. No root
 * of the motion lies before the first root of this majorant.
 *
 * The majorant has two orders more than equations.md 2.1, which saves evaluations of the flow. It leaves the stop after
 * an impact (d = 0, v < 0), a touch (d = v = 0, a < 0) or a release without a special rule.
 */
#ifndef VIBROIMPACT_MAJORANT_H
#define VIBROIMPACT_MAJORANT_H

#include <math.h>

/* The state of a motion towards a stop. */
typedef struct {
    double clearance;    /* >= 0, m */
    double velocity;     /* positive towards the stop, m/s */
    double acceleration; /* positive towards the stop, m/s^2 */
    double jerk;         /* positive towards the stop, m/s^3 */
    double bound;        /* >= |fourth derivative| over the horizon, m/s^4 */
} vi_approach;

/* Most evaluations of a search along one piece of motion. A search beyond ends there, certified so far; the rest is a
 * new piece. Some tens are usual. */
enum { VI_MOST_EVALUATIONS = 10000 };

/* A step s, 0 <= s <= horizon, such that the clearance stays >= 0 over [0, s]. s = horizon: no root before. */
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

/* Least step of a search for extremes over `length`: this share, doubled every 1024 evaluations to end the search. */
static inline double vi_least_step(double length, double share, int evaluation)
{
    return ldexp(share * length, evaluation / 1024);
}

/* fmin and fmax without their rules for NaN, which cost a function call. */
static inline double vi_min(double a, double b)
{
    return a < b ? a : b;
}

static inline double vi_max(double a, double b)
{
    return a > b ? a : b;
}

#endif
