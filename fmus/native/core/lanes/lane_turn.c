#include "lanes/lane_turn.h"

#include <math.h>

#define VI_WIDTH 1
#include "lanes/vector.h"

/* ln 2 in two parts; the first times a whole number below 2^20 is exact. */
static const double LN2_HIGH = 6.93147180369123816490e-01, LN2_LOW = 1.90821492927058770002e-10;
/* Argument x above which exp(-x) is 0. */
static const double VANISHES = 746.0;
/* Terms of the Taylor series of exp on half of ln 2; the first omitted term is below 1e-19. */
enum { TERMS = 15 };

void vi_lane_turn(double angle, double *cosine, double *sine)
{
    vector c, s;
    turn(all(angle), &c, &s);
    *cosine = c[0];
    *sine = s[0];
}

double vi_lane_decay(double x, double *lost)
{
    if (!(x < VANISHES)) {
        *lost = 1.0;
        return 0.0;
    }
    const double halvings = (x * 1.44269504088896338700 + WHOLE) - WHOLE;
    const double high = x - halvings * LN2_HIGH, low = halvings * LN2_LOW, r = high - low;
    double sum = 0.0; /* exp(-r) = 1 - r + r^2 sum */
    for (int n = TERMS; n > 2; --n) {
        sum = (1.0 + sum) * (-r / n);
    }
    const double change = r - 0.5 * (r * r) * (1.0 + sum); /* 1 - exp(-r) */
    const double left = ldexp(1.0 - change, -(int)halvings);
    *lost = halvings == 0.0 ? change : 1.0 - left;
    return left;
}
