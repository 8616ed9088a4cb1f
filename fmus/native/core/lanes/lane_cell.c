#include "lanes/lane_cell.h"

#include <float.h>
#include <math.h>

#include "body/landing.h"
#include "motion/majorant.h"

/* Most evaluations of a search in one cell; some tens are usual. */
enum { MOST_SEARCHED = 400 };

void vi_lane_cell_at(const vi_lane_cell *cell, double share, double *displacement, double *slope)
{
    double x = cell->term[cell->order], v = (double)cell->order * x;
    for (int n = cell->order - 1; n >= 1; --n) {
        x = x * share + cell->term[n];
        v = v * share + n * cell->term[n];
    }
    *displacement = cell->term[0] + x * share;
    *slope = v;
}

/* Bound of the derivative of this order over the cell. */
static double bound_of(const vi_lane_cell *cell, int order)
{
    double sum = 0.0;
    for (int n = order; n <= cell->order; ++n) {
        double factor = fabs(cell->term[n]);
        for (int i = 0; i < order; ++i) {
            factor *= n - i;
        }
        sum += factor;
    }
    return sum;
}

/* The motion towards a zero of sign * displacement, from below. */
static vi_approach approach_at(const vi_lane_cell *cell, double sign, double share, double bound)
{
    double x = cell->term[cell->order], v = 0.0, a = 0.0, j = 0.0; /* value, and derivatives over 1, 2 and 6 */
    for (int n = cell->order - 1; n >= 0; --n) {
        j = j * share + a;
        a = a * share + v;
        v = v * share + x;
        x = x * share + cell->term[n];
    }
    return (vi_approach){vi_max(0.0, -sign * x), sign * v, 2.0 * sign * a, 6.0 * sign * j, bound};
}

vi_cell_result vi_lane_cell_search(const vi_lane_cell *cell, double scale, double *share, double *slope)
{
    const double bound = bound_of(cell, 4), noise = VI_ROUNDING * scale, horizon = *share;
    double at = 0.0;
    if (!isfinite(bound_of(cell, 0)) || !isfinite(bound) || cell->term[0] > 4.0 * noise) {
        return VI_CELL_UNDECIDED;
    }
    for (int evaluation = 0; evaluation < MOST_SEARCHED; ++evaluation) {
        const vi_approach p = approach_at(cell, 1.0, at, bound);
        if (p.velocity > 0.0 && p.clearance <= noise) {
            const double step = vi_parabola_root(p.clearance, p.velocity, p.acceleration);
            *share = step < 1.0 ? vi_min(horizon, at + step) : at;
            *slope = approach_at(cell, 1.0, *share, bound).velocity;
            return *slope > 0.0 ? VI_CELL_HIT : VI_CELL_UNDECIDED;
        }
        const double step = vi_certified_step(&p, horizon - at);
        if (step >= horizon - at) {
            return VI_CELL_CLEAR;
        }
        if (!(at + step > at)) {
            return VI_CELL_UNDECIDED;
        }
        at += step;
    }
    return VI_CELL_UNDECIDED;
}

/* ---- crests ---- */

/* Largest sign * q over the cell up to `end`, if it may lie inside: visits the zeros of the velocity one by one. */
static double crest(const vi_lane_cell *cell, double sign, double end)
{
    vi_lane_cell speed = {{0.0}, cell->order}; /* slope of the cell as a polynomial */
    for (int n = 1; n <= cell->order; ++n) {
        speed.term[n - 1] = n * cell->term[n];
    }
    const double bound = bound_of(&speed, 4);
    const double noise = VI_ROUNDING * (fabs(cell->term[0]) + fabs(cell->term[1]));
    double at = 0.0, most = -HUGE_VAL;
    double side = speed.term[0] != 0.0 ? copysign(1.0, speed.term[0]) : copysign(1.0, speed.term[1]);
    for (int evaluation = 0; at < end; ++evaluation) {
        const vi_approach p = approach_at(&speed, -side, at, bound);
        if (p.velocity > 0.0 && p.clearance <= noise) {
            double q, slope;
            at = vi_min(end, at + p.clearance / p.velocity);
            vi_lane_cell_at(cell, at, &q, &slope);
            most = vi_max(most, sign * q);
            side = -side;
            at += vi_least_step(end, 1e-12, evaluation);
            continue;
        }
        at += vi_max(vi_certified_step(&p, end - at), vi_least_step(end, 1e-12, evaluation));
    }
    return most;
}

/* Largest sign * q where the slope changes its sign once: Newton's method from a guess on the parabola. */
static double single_crest(const vi_lane_cell *cell, double sign, double end, double first, double last)
{
    double low = 0.0, high = end, at = end * first / (first - last), q = 0.0;
    for (int evaluation = 0; evaluation < 60; ++evaluation) {
        double v = 0.0, a = 0.0, x = cell->term[cell->order];
        for (int n = cell->order - 1; n >= 0; --n) {
            a = a * at + v;
            v = v * at + x;
            x = x * at + cell->term[n];
        }
        q = x;
        if (sign * v > 0.0) {
            low = at;
        } else {
            high = at;
        }
        double next = at - v / (2.0 * a);
        if (!(next > low && next < high)) {
            next = 0.5 * (low + high);
        }
        if (fabs(next - at) <= 1e-9 * end) { /* values are flat at a crest */
            return vi_max(sign * q, sign * (q + v * 0.5 * (next - at)));
        }
        at = next;
    }
    return sign * q;
}

double vi_lane_cell_crest(const vi_lane_cell *cell, double sign, double end)
{
    const double first = sign * cell->term[1], third = bound_of(cell, 3);
    double q, slope;
    vi_lane_cell_at(cell, end, &q, &slope);
    const double last = sign * slope, bulge = 0.125 * third * end * end;
    if (vi_min(first, last) > bulge || vi_max(first, last) < -bulge) {
        return -HUGE_VAL; /* monotone */
    }
    if (2.0 * fabs(cell->term[2]) > third * end) { /* the curvature keeps its sign: at most one crest */
        return first > 0.0 && last < 0.0 ? single_crest(cell, sign, end, first, last) : -HUGE_VAL;
    }
    return crest(cell, sign, end);
}
