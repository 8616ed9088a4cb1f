#include "motion/polynomial.h"

#include <math.h>

#include "motion/majorant.h"

/* Steps below the noise after which a value counts as zero even where it rises. Within mere rounding, each step would
 * certify only the next few roundings. */
static const int LONGEST_CRAWL = 64;

/* Steps after which the bound on the fourth derivative over the whole remaining length counts as too wide. From then on
 * the bound covers WIDER times the last step. */
static const int LONGEST_APPROACH = 256;
static const double WIDER = 8.0;

void vi_polynomial_at(const double c[VI_ORDER + 1], double u, double value[4])
{
    double x = c[VI_ORDER], v = 0.0, a = 0.0, j = 0.0; /* value, and derivatives over 1, 2 and 6 */
    for (int n = VI_ORDER - 1; n >= 0; --n) {
        j = j * u + a;
        a = a * u + v;
        v = v * u + x;
        x = x * u + c[n];
    }
    value[0] = x;
    value[1] = v;
    value[2] = 2.0 * a;
    value[3] = 6.0 * j;
}

/* n (n - 1) (n - 2) (n - 3): factor of power n in the fourth derivative. */
static const double FOURTH[VI_ORDER + 1] = {0.0,      0.0,      0.0,      0.0,      24.0,     120.0,   360.0,
                                            840.0,    1680.0,   3024.0,   5040.0,   7920.0,   11880.0, 17160.0,
                                            24024.0,  32760.0,  43680.0,  57120.0,  73440.0,  93024.0, 116280.0,
                                            143640.0, 175560.0, 212520.0, 255024.0, 303600.0, 358800.0};

/* Largest modulus of the fourth derivative over 0 <= u <= length. */
static double largest_snap(const double c[VI_ORDER + 1], double length)
{
    double snap = 0.0;
    for (int n = VI_ORDER; n >= 4; --n) {
        snap = snap * length + FOURTH[n] * fabs(c[n]);
    }
    return snap;
}

bool vi_polynomial_clears(const double c[VI_ORDER + 1], double length)
{
    double least = c[0], power = 1.0;
    for (int n = 1; n <= VI_ORDER; ++n) {
        power *= length;
        least += vi_min(0.0, c[n] * power);
    }
    return least > 0.0;
}

double vi_polynomial_size(const double c[VI_ORDER + 1], double length)
{
    double size = 0.0;
    for (int n = VI_ORDER; n >= 0; --n) {
        size = size * length + fabs(c[n]);
    }
    return size;
}

/* The last step to a zero that is closer than rounding resolves. */
static vi_fall land(const double c[VI_ORDER + 1], double u, const vi_approach *p, double length, double noise)
{
    const double square = p->velocity * p->velocity + 2.0 * p->acceleration * p->clearance;
    const double step = square < 0.0 ? -p->velocity / p->acceleration : 2.0 * p->clearance / (p->velocity + sqrt(square));
    double value[4];
    const double root = vi_min(length, u + step);
    vi_polynomial_at(c, root, value);
    if (!(fabs(value[0]) <= 2.0 * noise)) { /* the velocity is mere rounding, as the value is */
        return (vi_fall){true, u, p->velocity};
    }
    return (vi_fall){true, root, square < 0.0 ? 0.0 : vi_max(0.0, -value[1])};
}

vi_fall vi_polynomial_fall(const double c[VI_ORDER + 1], double from, double length, double noise)
{
    double u = from, reach = length, last = length, bound = largest_snap(c, length);
    int crawl = 0;
    for (int evaluation = 0; evaluation < VI_MOST_EVALUATIONS; ++evaluation) {
        double value[4] = {c[0], c[1], 2.0 * c[2], 6.0 * c[3]};
        if (u != 0.0) {
            vi_polynomial_at(c, u, value);
        }
        vi_approach p = {vi_max(0.0, value[0]), -value[1], -value[2], -value[3], bound};
        if (p.velocity > 0.0 && p.clearance <= noise) {
            return land(c, u, &p, length, noise);
        }
        if (evaluation >= LONGEST_APPROACH) {
            reach = vi_min(length, u + WIDER * last);
            bound = largest_snap(c, reach);
            p.bound = bound;
        }
        double horizon = reach - u;
        crawl = p.clearance <= noise ? crawl + 1 : 0;
        if (crawl > LONGEST_CRAWL && bound > 0.0) {
            p.clearance += noise;
            horizon = vi_min(horizon, sqrt(sqrt(24.0 * noise / bound)));
        }
        last = vi_certified_step(&p, horizon);
        if (!(last < length - u)) {
            return (vi_fall){false, length, 0.0};
        }
        if (u + last == u) {
            return (vi_fall){true, u, vi_max(0.0, p.velocity)};
        }
        u += last;
    }
    return (vi_fall){false, u, 0.0};
}
