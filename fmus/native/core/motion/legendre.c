#include "motion/legendre.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "motion/rows.h"

/* Gauss nodes above the middle of [-1, 1], and their weights. */
static const double NODE[VI_NODES / 2] = {0.0950125098376374401853, 0.281603550779258913230, 0.458016777657227386342,
                                          0.617876244402643748447,  0.755404408355003033895, 0.865631202387831743880,
                                          0.944575023073232576078,  0.989400934991649932596};
static const double WEIGHT[VI_NODES / 2] = {0.189450610455068496285,  0.182603415044923588867, 0.169156519395002538189,
                                            0.149595988816576732082,  0.124628971255533872052, 0.0951585116824927848099,
                                            0.0622535239386478928628, 0.0271524594117540948518};
/* Newton steps to a turning point, and the step, relative to the length, below which the point is found. */
enum { MOST_STEPS = 40 };
static const double CLOSE = 1e-9;

/* Legendre polynomials at x. */
static void polynomials(double x, double p[VI_NODES])
{
    p[0] = 1.0;
    p[1] = x;
    for (int n = 1; n + 1 < VI_NODES; ++n) {
        const double order = (double)n;
        p[n + 1] = ((2.0 * order + 1.0) * x * p[n] - order * p[n - 1]) / (order + 1.0);
    }
}

/* Node i on [-1, 1]. */
static double place(int i)
{
    return i < VI_NODES / 2 ? -NODE[VI_NODES / 2 - 1 - i] : NODE[i - VI_NODES / 2];
}

static double weight(int i)
{
    return i < VI_NODES / 2 ? WEIGHT[VI_NODES / 2 - 1 - i] : WEIGHT[i - VI_NODES / 2];
}

/* Series over the way from the start to `node` of P_0 to P_15 of the whole step, by the recurrence of P_n. The variable
 * of the step is node (x + 1) - 1. A product x P_r is ((r + 1) P_(r + 1) + r P_(r - 1)) / (2 r + 1). */
static void restrict_to(double node, double part[VI_NODES][VI_NODES])
{
    memset(part, 0, VI_NODES * sizeof part[0]);
    part[0][0] = 1.0;
    part[1][0] = node - 1.0;
    part[1][1] = node;
    for (int n = 1; n + 1 < VI_NODES; ++n) {
        const double order = (double)n;
        for (int r = 0; r <= n + 1; ++r) {
            const double below = r > 0 ? part[n][r - 1] * (double)r / (double)(2 * r - 1) : 0.0;
            const double above = r < n ? part[n][r + 1] * (double)(r + 1) / (double)(2 * r + 3) : 0.0;
            const double moved = node * (below + above) + (node - 1.0) * part[n][r];
            part[n + 1][r] = ((2.0 * order + 1.0) * moved - order * part[n - 1][r]) / (order + 1.0);
        }
    }
}

void vi_legendre_prepare(vi_legendre *basis)
{
    for (int i = 0; i < VI_NODES; ++i) {
        double p[VI_NODES];
        polynomials(place(i), p);
        basis->node[i] = 0.5 * (1.0 + place(i));
        for (int n = 0; n < VI_NODES; ++n) {
            basis->series[i][n] = ((double)n + 0.5) * weight(i) * p[n];
        }
        restrict_to(basis->node[i], basis->part[i]);
    }
}

void vi_legendre_series(const vi_legendre *basis, const double value[VI_NODES], double series[VI_NODES])
{
    memset(series, 0, VI_NODES * sizeof series[0]);
    vi_rows_combine(series, basis->series[0], VI_NODES, value, VI_NODES, VI_NODES);
}

void vi_legendre_at(const double series[VI_NODES], double x, double value[2])
{
    static const double SHARE[VI_NODES] = {1.0,      1.0 / 2,  1.0 / 3,  1.0 / 4,  1.0 / 5,  1.0 / 6,
                                           1.0 / 7,  1.0 / 8,  1.0 / 9,  1.0 / 10, 1.0 / 11, 1.0 / 12,
                                           1.0 / 13, 1.0 / 14, 1.0 / 15, 1.0 / 16};
    double before = 1.0, now = x, slope_before = 0.0, slope = 1.0;
    value[0] = series[0] + series[1] * x;
    value[1] = series[1];
    for (int n = 1; n + 1 < VI_NODES; ++n) {
        const double order = (double)n, twice = 2.0 * order + 1.0;
        const double next = (twice * x * now - order * before) * SHARE[n], steeper = slope_before + twice * now;
        before = now;
        now = next;
        slope_before = slope;
        slope = steeper;
        value[0] += series[n + 1] * next;
        value[1] += series[n + 1] * steeper;
    }
}

double vi_legendre_spread(const double series[VI_NODES])
{
    double spread = 0.0;
    for (int n = 1; n < VI_NODES; ++n) {
        spread += fabs(series[n]);
    }
    return spread;
}

/* Largest value of sign times the series between two places, around a node that exceeds its neighbours. Secants and
 * halvings find the zero of the derivative. */
static double crest(const double series[VI_NODES], double low, double high, double sign)
{
    double left[2], right[2], value[2];
    vi_legendre_at(series, low, left);
    vi_legendre_at(series, high, right);
    double largest = fmax(sign * left[0], sign * right[0]);
    for (int step = 0; step < MOST_STEPS && sign * left[1] > 0.0 && sign * right[1] < 0.0; ++step) {
        const double secant = (low * right[1] - high * left[1]) / (right[1] - left[1]);
        const double x = step % 3 == 2 ? 0.5 * (low + high) : secant;
        vi_legendre_at(series, x, value);
        largest = fmax(largest, sign * value[0]);
        if (high - low <= CLOSE || x <= low || x >= high) {
            break;
        }
        if (sign * value[1] > 0.0) {
            low = x;
            memcpy(left, value, sizeof left);
        } else {
            high = x;
            memcpy(right, value, sizeof right);
        }
    }
    return largest;
}

double vi_legendre_largest(const vi_legendre *basis, const double series[VI_NODES], const double value[VI_NODES],
                           double sign, double so_far)
{
    if (!(sign * series[0] + vi_legendre_spread(series) > so_far)) {
        return so_far;
    }
    for (int i = 0; i < VI_NODES; ++i) {
        const bool rises = i == 0 || sign * value[i] >= sign * value[i - 1];
        const bool falls = i + 1 == VI_NODES || sign * value[i] > sign * value[i + 1];
        if (rises && falls) {
            const double low = i > 0 ? 2.0 * basis->node[i - 1] - 1.0 : -1.0;
            const double high = i + 1 < VI_NODES ? 2.0 * basis->node[i + 1] - 1.0 : 1.0;
            so_far = fmax(so_far, crest(series, low, high, sign));
        }
    }
    return so_far;
}
