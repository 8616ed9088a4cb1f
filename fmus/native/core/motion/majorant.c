#include "motion/majorant.h"

#include <stdbool.h>

static const double THIRD = 1.0 / 3.0, TWELFTH = 1.0 / 12.0;
/* Ratio of limit to certified step above which bisection gains little; the limit is then lowered first. */
static const double FAR = 64.0;

/* Acceleration of a parabola that approaches at least as fast as the quartic up to s. The quartic's coefficient of
 * t^2/2 is a + j t/3 + bound t^2/12, which is convex in t: its largest value is at an end. */
static inline double acceleration_up_to(const vi_approach *p, double s)
{
    return p->acceleration + vi_max(0.0, s * (p->jerk * THIRD + s * (p->bound * TWELFTH)));
}

/* The longest s up to which that acceleration is not positive; 0 when there is none. Until then a body that moves away
 * from the stop cannot reach the stop. */
static double longest_retreat(const vi_approach *p)
{
    const double slope = p->jerk * THIRD, bend = p->bound * TWELFTH, a = p->acceleration;
    if (a > 0.0 || (a == 0.0 && slope >= 0.0)) {
        return 0.0;
    }
    const double root = sqrt(slope * slope - 4.0 * bend * a);
    return slope > 0.0 ? -2.0 * a / (slope + root) : bend > 0.0 ? (root - slope) / (2.0 * bend) : HUGE_VAL;
}

/* A step by which the quartic surely has a root: its last term then exceeds all terms that could hold it back. */
static double surely_passed(const vi_approach *p)
{
    if (!(p->bound > 0.0)) {
        return HUGE_VAL;
    }
    const double share = 96.0 / p->bound; /* each of four terms may be a quarter of bound s^4 / 24 */
    double s = vi_max(sqrt(sqrt(share * p->clearance)), sqrt(0.5 * share * fabs(p->acceleration)));
    s = vi_max(s, share * fabs(p->jerk) / 6.0);
    return p->velocity < 0.0 ? vi_max(s, cbrt(-share * p->velocity)) : s;
}

/* Does the parabola with this acceleration clear the stop up to s? A parabola that bends away from the stop may dip in
 * between: the answer is then no, unless the body never approaches. */
static inline bool clears(const vi_approach *p, double acceleration, double s)
{
    return (acceleration >= 0.0 || p->velocity <= 0.0)
           && p->clearance - s * (p->velocity + 0.5 * s * acceleration) >= 0.0;
}

double vi_certified_step(const vi_approach *p, double horizon)
{
    /* A step s is certified when the parabola with acceleration_up_to(s) has no root before s. `limit` is an upper
     * bound of every certified step: the root under the least acceleration. */
    double limit = vi_min(horizon, vi_parabola_root(p->clearance, p->velocity, p->acceleration));
    double certified = vi_parabola_root(p->clearance, p->velocity, acceleration_up_to(p, limit));
    if (!(certified < limit)) {
        return limit;
    }
    if (p->velocity <= 0.0) {
        certified = vi_max(certified, vi_min(horizon, longest_retreat(p)));
    }
    if (limit > FAR * certified) {
        limit = vi_max(certified, vi_min(limit, surely_passed(p)));
        const double closer = vi_parabola_root(p->clearance, p->velocity, acceleration_up_to(p, limit));
        certified = vi_max(certified, vi_min(limit, closer));
    }
    for (int pass = 0; pass < 4 && limit > 1.1 * certified; ++pass) {
        const double middle = 0.5 * (certified + limit);
        if (clears(p, acceleration_up_to(p, middle), middle)) {
            certified = middle;
        } else {
            limit = middle;
        }
    }
    return certified;
}
