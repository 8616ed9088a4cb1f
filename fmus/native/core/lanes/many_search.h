/* The search of bodies of several modes, in all lanes at once: the first contact in one shortest cell. */
#ifndef VIBROIMPACT_MANY_SEARCH_H
#define VIBROIMPACT_MANY_SEARCH_H

#include "lanes/many_cells.h"

/* Reciprocals of the factorials. */
static const double OVER_FACTORIAL[VI_LANE_ORDER + 1] = {1.0,
                                                         1.0,
                                                         1.0 / 2.0,
                                                         1.0 / 6.0,
                                                         1.0 / 24.0,
                                                         1.0 / 120.0,
                                                         1.0 / 720.0,
                                                         1.0 / 5040.0,
                                                         1.0 / 40320.0,
                                                         1.0 / 362880.0,
                                                         1.0 / 3628800.0,
                                                         1.0 / 39916800.0,
                                                         1.0 / 479001600.0,
                                                         1.0 / 6227020800.0,
                                                         1.0 / 87178291200.0};

/* A shortest cell in which a lane may meet a contact or its goal. */
typedef struct {
    modal_state start;
    vector half;             /* shortest cells between the certified cells and this one, 0 or 1 */
    vector length;           /* share of the cell up to the goal or its end */
    mask goal;               /* the end is the goal */
    vector on;               /* number of the contact just left, from 1; 0: none */
    const vector *amplitude; /* bounds of the modes */
} searched_cell;

/* Derivatives of the modes at the start of a cell, over the cell. */
typedef struct {
    vector of[VI_REAL_MODES][VI_LANE_ORDER + 1];
} derivatives;

/* The first meeting so far. */
typedef struct {
    vector share;            /* of the cell */
    vector number, approach; /* of the contact, from 1 (0: none); speed over the share of the cell */
    mask careful;            /* the cell needs the careful search */
    vector size, pull;       /* of the contact: sum of the terms of its displacement, and of its acceleration */
} meeting;

/* Choose the shortest cell to be searched: the half of the next cell that may have a contact. `left` is the number of
 * shortest cells up to the goal. */
LANES_INLINE void choose_half(const vi_lane_group *g, int at, int modes, int contacts, const certified_flight *s,
                              vector left, searched_cell *cell)
{
    const vi_many_modes *many = &g->many;
    const vector third = load(g->cell + at) * (1.0 / 3.0), on = only(s->passed == 0.0, load(g->on + at));
    modal_state middle;
    mask clear = left > 1.0;
    step_on(at, modes, many->half, many->half_cosine, many->half_sine, &s->now, &middle);
    for (int c = 0; c < contacts; ++c) {
        vector y, v;
        contact_at(g, at, modes, c, &middle, &y, &v);
        /* the deviation is a sixteenth of the whole cell's; its rounding stays */
        const vector bulge = 0.25 * s->contact[c].bulge;
        const mask here = on == (double)(c + 1);
        clear &= (stays_below(&s->contact[c], y, v, third, bulge) & ~here)
                 | (comes_away(&s->contact[c], y, v, third, bulge) & here);
    }
    for (int j = 0; j < modes; ++j) {
        cell->start.q[j] = choose(clear, middle.q[j], s->now.q[j]);
        cell->start.p[j] = choose(clear, middle.p[j], s->now.p[j]);
    }
    cell->start.cosine = choose(clear, middle.cosine, s->now.cosine);
    cell->start.sine = choose(clear, middle.sine, s->now.sine);
    cell->half = only(clear, all(1.0));
    cell->on = only(~clear, on);
    const vector length = larger(left - cell->half, all(0.0));
    cell->length = smaller(length, all(1.0));
    cell->goal = length <= 1.0;
}

/* ---- Taylor terms ---- */

LANES_INLINE void expand_modes(const vi_lane_group *g, int at, int modes, const modal_state *s, derivatives *d)
{
    const vector cell = load(g->cell + at);
    for (int j = 0; j < modes; ++j) {
        const vector drag = -load(g->many.drag[j] + at), spring = load(g->many.spring[j] + at);
        vector *of = d->of[j];
        of[0] = s->q[j];
        of[1] = s->p[j] * cell;
#pragma GCC unroll 16
        for (int n = 2; n <= VI_LANE_ORDER; ++n) {
            of[n] = drag * of[n - 1] - spring * of[n - 2];
        }
    }
}

/* Set the Taylor terms of a point's displacement from `offset`; returns a bound of its third derivative over the cell. */
LANES_INLINE vector expand_point(const vi_lane_group *g, int at, int modes, int c, const vi_lane_array offset[],
                                 const modal_state *s, const derivatives *d, vector term[])
{
    const vi_many_modes *many = &g->many;
    const vector a = load(many->cosine[c] + at), b = load(many->sine[c] + at), angle = load(many->turn + at);
    const vector square = -(angle * angle);
    term[0] = a * s->cosine + b * s->sine;
    term[1] = angle * (b * s->cosine - a * s->sine);
#pragma GCC unroll 16
    for (int n = 2; n <= VI_LANE_ORDER; ++n) {
        term[n] = square * term[n - 2];
    }
    term[0] += load(offset[c] + at);
    for (int j = 0; j < modes; ++j) {
        const vector shape = load(many->shape[c][j] + at);
#pragma GCC unroll 16
        for (int n = 0; n <= VI_LANE_ORDER; ++n) {
            term[n] += shape * d->of[j][n];
        }
    }
    vector third = all(0.0);
#pragma GCC unroll 16
    for (int n = VI_LANE_ORDER; n >= 3; --n) {
        third += size_of(term[n]) * OVER_FACTORIAL[n - 3];
    }
#pragma GCC unroll 16
    for (int n = 2; n <= VI_LANE_ORDER; ++n) {
        term[n] *= OVER_FACTORIAL[n];
    }
    return third;
}

/* Sum of the powers of s times coefficients. Four sums go on beside each other, which shortens the chain. */
LANES_INLINE vector sum_of_powers(const vector of[], int last, vector s, vector square, vector fourth)
{
    vector sum[4] = {of[last], of[last - 1], of[last - 2], of[last - 3]};
#pragma GCC unroll 16
    for (int n = last - 4; n >= 0; --n) {
        sum[(last - n) % 4] = sum[(last - n) % 4] * fourth + of[n];
    }
    return (sum[last % 4] + s * sum[(last + 3) % 4]) + square * (sum[(last + 2) % 4] + s * sum[(last + 1) % 4]);
}

/* A displacement beyond its first Taylor term, its slope and half its second derivative, at a share of the cell. */
typedef struct {
    vector added, slope, bend;
} motion_at;

/* The motion by its Taylor terms up to the order `last`. */
LANES_INLINE motion_at motion_by(const vector term[], int last, vector s)
{
    const vector square = s * s, fourth = square * square;
    vector slope[VI_LANE_ORDER], bend[VI_LANE_ORDER];
#pragma GCC unroll 16
    for (int n = 1; n <= last; ++n) {
        slope[n - 1] = (double)n * term[n];
        bend[n - 1] = (double)((n + 1) * n / 2) * term[n < last ? n + 1 : n];
    }
    return (motion_at){s * sum_of_powers(term + 1, last - 1, s, square, fourth),
                       sum_of_powers(slope, last - 1, s, square, fourth),
                       sum_of_powers(bend, last - 2, s, square, fourth)};
}

/* ---- the zero ---- */

/* Order of the Taylor terms in the first step to a contact, which only has to come near. */
enum { FIRST_ORDER = 10 };
/* Most further steps; one is usual. */
enum { MOST_STEPS = 3 };

/* Share of a cell at which a parabola between these ends, bent by `curve`, rises through 0. */
LANES_INLINE vector parabola_zero(vector y, vector end_y, vector curve)
{
    const vector slope = (end_y - y) - curve;
    const vector spread = root(larger(slope * slope - 4.0 * (curve * y), all(0.0)));
    const mask rising = slope > 0.0;
    const vector share = choose(rising, -2.0 * y, spread - slope) / choose(rising, slope + spread, 2.0 * curve);
    return smaller(larger(share, all(0.0)), all(1.0));
}

/* A step of third order towards the zero of y + (added displacement): Chebyshev's method. */
LANES_INLINE vector step_to_zero(const motion_at *m, vector y)
{
    const vector inverse = 1.0 / m->slope, step = (y + m->added) * inverse;
    return -(step * (1.0 + step * (m->bend * inverse)));
}

LANES_INLINE vector within(vector share, vector length)
{
    return smaller(larger(share, all(0.0)), length);
}

/* Move from a near share to the zero of y + (added displacement), and set the slope there. Returns the lanes that are
 * there to rounding, rising. */
LANES_INLINE mask go_to_zero(const vector term[], vector y, vector third, vector length, mask hits, vector *share,
                             vector *slope)
{
    motion_at m = motion_by(term, FIRST_ORDER, *share);
    vector at = within(*share + step_to_zero(&m, y), length);
    mask done = ~hits;
    for (int i = 0; i < MOST_STEPS && any(~done); ++i) {
        m = motion_by(term, VI_LANE_ORDER, at);
        const vector step = step_to_zero(&m, y), change = m.bend * step, after = m.slope + 2.0 * change;
        at = within(at + step, length);
        *share = choose(done, *share, at);
        *slope = choose(done, *slope, after);
        /* the next term of the slope, and the error of the step, are roundings */
        done |= (third * (step * step) <= 2.2e-16 * after) & (change * change <= 2.2e-16 * (after * after));
    }
    return done & hits & (*slope > 0.0);
}

/* Search the cell for the contact c up to the earliest meeting so far. A zero is the only one if the displacement
 * certainly rises all the time, or if its curvature keeps its sign. */
LANES_INLINE void meet(const vi_lane_group *g, int at, int modes, int c, mask met, const searched_cell *cell,
                       const derivatives *d, meeting *first)
{
    const vi_many_modes *many = &g->many;
    vector term[VI_LANE_ORDER + 1], size = load(many->size[c] + at), pull = load(many->steady_pull[c] + at);
    const vector third = expand_point(g, at, modes, c, many->offset, &cell->start, d, term), length = first->share;
    for (int j = 0; j < modes; ++j) {
        const vector reach = size_of(load(many->shape[c][j] + at)) * cell->amplitude[j];
        size += reach;
        pull += reach * load(many->pull[j] + at);
    }
    const vector noise = ROUNDING * size;
    const mask leaves = cell->on == (double)(c + 1);
    const vector y = only(~leaves, term[0]), up = term[1];
    const motion_at end = motion_by(term, VI_LANE_ORDER, length);
    const vector end_y = y + end.added, spread = third * length, second = 2.0 * term[2];
    const mask crosses = met & (end_y > 0.0), apart = leaves | (y < -noise);
    const mask rises = (smaller(up, end.slope) > 0.125 * (spread * length)) & (y <= noise);
    const mask convex = (second > spread) & apart, concave = (second < -spread) & apart;
    const mask clear = rises | convex | (concave & ((up <= 0.0) | (end.slope >= 0.0)));
    const mask hits = crosses & (rises | (convex & ~(leaves & (up >= 0.0))) | (concave & ~leaves));
    vector share = length * parabola_zero(y, end_y, 0.5 * (length * (end.slope - up))), slope = end.slope;
    const mask found = go_to_zero(term, y, third, length, hits, &share, &slope);
    const mask twice = (first->number > 0.0) & (share == length); /* two contacts at one instant */
    first->careful |= (crosses & (~found | twice)) | (met & ~(crosses | clear));
    first->share = choose(found, share, length);
    first->number = choose(found, all((double)(c + 1)), first->number);
    first->approach = choose(found, slope, first->approach);
    first->size = choose(found, size, first->size);
    first->pull = choose(found, pull, first->pull);
}

/* ---- the state at the end ---- */

/* Set the modes at a share of the cell. */
LANES_INLINE void state_at(const vi_lane_group *g, int at, int modes, const derivatives *d, vector share, vector q[],
                           vector p[])
{
    const vector rate = load(g->cell_rate + at);
    vector power[VI_LANE_ORDER + 1] = {all(1.0), share}; /* share^n / n! */
#pragma GCC unroll 16
    for (int n = 2; n <= VI_LANE_ORDER; ++n) {
        power[n] = power[n / 2] * power[n - n / 2];
    }
#pragma GCC unroll 16
    for (int n = 2; n <= VI_LANE_ORDER; ++n) {
        power[n] *= OVER_FACTORIAL[n];
    }
    for (int j = 0; j < modes; ++j) {
        const vector *of = d->of[j];
        vector x = of[VI_LANE_ORDER] * power[VI_LANE_ORDER], v = of[VI_LANE_ORDER] * power[VI_LANE_ORDER - 1];
#pragma GCC unroll 16
        for (int n = VI_LANE_ORDER - 1; n >= 1; --n) { /* smallest terms first */
            x += of[n] * power[n];
            v += of[n] * power[n - 1];
        }
        q[j] = x + of[0];
        p[j] = v * rate;
    }
}

#endif
