#include "majorant.h"

#include <math.h>

double vi_parabola_root(double clearance, double velocity, double acceleration)
{
    const double square = velocity * velocity + 2.0 * acceleration * clearance;
    if (velocity > 0.0) {
        return square < 0.0 ? HUGE_VAL : 2.0 * clearance / (velocity + sqrt(square));
    }
    return acceleration > 0.0 ? (sqrt(square) - velocity) / acceleration : HUGE_VAL;
}

double vi_certified_step(double clearance, double velocity, double acceleration, double bound, double horizon)
{
    /* Over [0, s] the cubic lies below the parabola with acceleration a + bound s/3. A step s is certified when that
     * parabola has no root before s; start from the whole horizon and widen what is certified. */
    const double slope = bound / 3.0;
    double certified = vi_parabola_root(clearance, velocity, acceleration + slope * horizon);
    if (!(certified < horizon)) {
        return horizon;
    }
    if (velocity <= 0.0 && acceleration < 0.0) {
        /* leaving and speeding up: no return before the majorant's acceleration changes sign */
        certified = fmax(certified, fmin(horizon, -acceleration / slope));
    }
    double limit = fmin(horizon, vi_parabola_root(clearance, velocity, acceleration + slope * certified));
    for (int pass = 0; pass < 3 && limit > 1.05 * certified; ++pass) {
        const double middle = 0.5 * (certified + limit);
        const double root = vi_parabola_root(clearance, velocity, acceleration + slope * middle);
        if (root >= middle) {
            certified = middle;
        } else {
            certified = fmax(certified, root);
            limit = middle;
        }
    }
    return certified;
}
