#include "lanes/lane_cell.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>

#include "body/landing.h"
#include "motion/majorant.h"

/* Evaluations of a search in one cell; some tens are usual. */
enum { MOST_SEARCHED = 400 };

/* A row of a table for the state at the start of the last round. */
static double after_cells(const vi_lane_array row[VI_PARTS], const vi_lane_group *g, int lane)
{
    return (row[VI_OF_Q][lane] * g->start_q[lane] + row[VI_OF_P][lane] * g->start_p[lane])
           + ((row[VI_OF_COSINE][lane] * g->start_cosine[lane] + row[VI_OF_SINE][lane] * g->start_sine[lane])
              + row[VI_OF_ONE][lane]);
}

vi_lane_cell vi_lane_cell_after(const vi_lane_group *g, int lane, int passed)
{
    const double q = after_cells(g->end_q[passed], g, lane), p = after_cells(g->end_p[passed], g, lane);
    const double turn = g->turn_cosine[passed][lane], turn_sine = g->turn_sine[passed][lane];
    const double cosine = g->start_cosine[lane] * turn - g->start_sine[lane] * turn_sine;
    const double sine = g->start_sine[lane] * turn + g->start_cosine[lane] * turn_sine;
    vi_lane_cell cell = {{q, p * g->cell[lane]}};
    for (int n = 2; n <= VI_LANE_ORDER; ++n) {
        const vi_lane_array *row = g->taylor[n];
        cell.term[n] = (row[VI_OF_Q][lane] * q + row[VI_OF_P][lane] * p)
                       + ((row[VI_OF_COSINE][lane] * cosine + row[VI_OF_SINE][lane] * sine) + row[VI_OF_ONE][lane]);
    }
    return cell;
}

void vi_lane_cell_at(const vi_lane_cell *cell, double share, double *q, double *slope)
{
    double x = cell->term[VI_LANE_ORDER], v = (double)VI_LANE_ORDER * x;
    for (int n = VI_LANE_ORDER - 1; n >= 1; --n) {
        x = x * share + cell->term[n];
        v = v * share + n * cell->term[n];
    }
    *q = cell->term[0] + x * share;
    *slope = v;
}

/* Bound of the derivative of this order over the cell. */
static double bound_of(const vi_lane_cell *cell, int order)
{
    double sum = 0.0;
    for (int n = order; n <= VI_LANE_ORDER; ++n) {
        double factor = fabs(cell->term[n]);
        for (int i = 0; i < order; ++i) {
            factor *= n - i;
        }
        sum += factor;
    }
    return sum;
}

/* Clearance 0 at the start is `start`; towards the stop as the polynomial times `sign` grows. */
static vi_approach approach_at(const vi_lane_cell *cell, double start, double sign, double share, double bound)
{
    double x = cell->term[VI_LANE_ORDER], v = 0.0, a = 0.0, j = 0.0; /* value, and derivatives over 1, 2 and 6 */
    for (int n = VI_LANE_ORDER - 1; n >= 0; --n) {
        j = j * share + a;
        a = a * share + v;
        v = v * share + x;
        x = n > 0 ? x * share + cell->term[n] : x * share;
    }
    return (vi_approach){start - sign * x, sign * v, 2.0 * sign * a, 6.0 * sign * j, bound};
}

/* First contact with one stop; its clearance at the start is known. */
static vi_cell_result find(const vi_lane_cell *cell, double start, double sign, double scale, double horizon,
                           double *share, double *slope)
{
    const double bound = bound_of(cell, 4), noise = VI_ROUNDING * scale;
    double at = 0.0;
    for (int evaluation = 0; evaluation < MOST_SEARCHED; ++evaluation) {
        vi_approach p = approach_at(cell, start, sign, at, bound);
        p.clearance = vi_max(0.0, p.clearance);
        if (p.velocity > 0.0 && p.clearance <= noise) {
            const double step = vi_parabola_root(p.clearance, p.velocity, p.acceleration);
            *share = step < 1.0 ? vi_min(horizon, at + step) : at;
            *slope = approach_at(cell, start, sign, *share, bound).velocity;
            return VI_CELL_HIT;
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

vi_cell_result vi_lane_cell_search(const vi_lane_group *g, int lane, int contacts, double *share, int *contact,
                                   double *approach)
{
    const int passed = (int)g->passed[lane];
    const vi_lane_cell cell = vi_lane_cell_after(g, lane, passed);
    if (!isfinite(bound_of(&cell, 0))) {
        return VI_CELL_UNDECIDED;
    }
    vi_cell_result result = VI_CELL_CLEAR;
    for (int c = 0; c < contacts; ++c) {
        const double sign = g->sign[c][lane], limit = g->limit[c][lane];
        const double scale = fabs(limit) + fabs(cell.term[0]) + fabs(cell.term[1]);
        const bool leaves = passed == 0 && g->on[lane] == c + 1;
        const double start = leaves ? 0.0 : limit - sign * cell.term[0];
        if (start < -4.0 * VI_ROUNDING * scale) {
            return VI_CELL_UNDECIDED;
        }
        double found = *share, slope = 0.0;
        const vi_cell_result one = find(&cell, start, sign, scale, *share, &found, &slope);
        if (one == VI_CELL_UNDECIDED) {
            return one;
        }
        if (one == VI_CELL_HIT) {
            *share = found;
            *contact = c;
            *approach = slope * g->cell_rate[lane];
            result = *approach > 0.0 ? VI_CELL_HIT : VI_CELL_UNDECIDED;
            if (result == VI_CELL_UNDECIDED) {
                return result;
            }
        }
    }
    return result;
}

/* ---- extremes ---- */

/* Largest value of sign * q over the cell up to `end`, where it may lie inside: the zeros of the velocity one by one. */
static double crest(const vi_lane_cell *cell, double sign, double end)
{
    vi_lane_cell speed = {{0.0}}; /* of the cell, as a polynomial of its own */
    for (int n = 1; n <= VI_LANE_ORDER; ++n) {
        speed.term[n - 1] = n * cell->term[n];
    }
    const double bound = bound_of(&speed, 4);
    const double noise = VI_ROUNDING * (fabs(cell->term[0]) + fabs(cell->term[1]));
    double at = 0.0, most = -HUGE_VAL;
    double side = speed.term[0] != 0.0 ? copysign(1.0, speed.term[0]) : copysign(1.0, speed.term[1]);
    for (int evaluation = 0; at < end; ++evaluation) {
        vi_approach p = approach_at(&speed, side * speed.term[0], -side, at, bound);
        p.clearance = vi_max(0.0, p.clearance);
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

/* The same where the slope changes its sign once, by Newton's method from a guess on the parabola. */
static double single_crest(const vi_lane_cell *cell, double sign, double end, double first, double last)
{
    double low = 0.0, high = end, at = end * first / (first - last), q = 0.0;
    for (int evaluation = 0; evaluation < 60; ++evaluation) {
        double v = 0.0, a = 0.0, x = cell->term[VI_LANE_ORDER];
        for (int n = VI_LANE_ORDER - 1; n >= 0; --n) {
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
        if (fabs(next - at) <= 1e-9 * end) { /* the value at a crest is flat */
            return vi_max(sign * q, sign * (q + v * 0.5 * (next - at)));
        }
        at = next;
    }
    return sign * q;
}

/* Largest sign * q inside a cell up to `end`. */
static double largest_inside(const vi_lane_cell *cell, double sign, double end)
{
    const double first = sign * cell->term[1], third = bound_of(cell, 3);
    double q, slope;
    vi_lane_cell_at(cell, end, &q, &slope);
    const double last = sign * slope, bulge = 0.125 * third * end * end;
    if (vi_min(first, last) > bulge || vi_max(first, last) < -bulge) {
        return -HUGE_VAL; /* monotone */
    }
    /* the curvature keeps its sign: one crest, or none */
    const double least = 2.0 * fabs(cell->term[2]);
    if (first > 0.0 && last < 0.0 && least > third * end) {
        return single_crest(cell, sign, end, first, last);
    }
    return crest(cell, sign, end);
}

/* Bound of |second derivative| over the cells to come, over a cell's square: as the rounds have it. */
static double bulge_of(const vi_lane_group *g, int lane)
{
    const double q = g->start_q[lane], p = g->start_p[lane], cell = g->cell[lane];
    const double norm = sqrt(p * p + g->stiffness[lane] * (q * q)) + g->load[lane] * g->span[lane];
    return 0.125 * (g->load[lane] + g->root_rate[lane] * norm) * cell * cell;
}

/* Farthest that the stops let the body go on this side, in units of q. */
static double stop_on(const vi_lane_group *g, int lane, int contacts, double sign)
{
    double farthest = HUGE_VAL;
    for (int c = 0; c < contacts; ++c) {
        if (g->sign[c][lane] == sign) {
            farthest = vi_min(farthest, g->limit[c][lane]);
        }
    }
    return farthest;
}

static double extend(const vi_lane_group *g, int lane, int contacts, double sign, const double edge[], double most)
{
    const int passed = (int)g->passed[lane];
    const double stop = stop_on(g, lane, contacts, sign), bulge = bulge_of(g, lane);
    const int last = g->share[lane] > 0.0 ? passed + 1 : passed;
    for (int i = 0; i <= last; ++i) {
        most = vi_max(most, vi_min(stop, sign * edge[i]));
    }
    for (int i = 0; i < last && most < stop; ++i) {
        if (vi_max(sign * edge[i], sign * edge[i + 1]) + bulge > most) {
            const vi_lane_cell cell = vi_lane_cell_after(g, lane, i);
            const double inside = largest_inside(&cell, sign, i < passed ? 1.0 : g->share[lane]);
            most = vi_max(most, vi_min(stop, inside));
        }
    }
    return most;
}

void vi_lane_extremes(const vi_lane_group *g, int lane, int contacts, double *highest, double *lowest)
{
    const int passed = (int)g->passed[lane];
    double edge[VI_CELLS + 2];
    edge[0] = g->start_q[lane];
    for (int i = 1; i <= passed; ++i) {
        edge[i] = after_cells(g->end_q[i], g, lane);
    }
    edge[passed + 1] = g->q[lane];
    *highest = extend(g, lane, contacts, 1.0, edge, *highest);
    *lowest = -extend(g, lane, contacts, -1.0, edge, -*lowest);
}
