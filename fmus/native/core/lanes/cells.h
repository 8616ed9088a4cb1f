/* The motion of a vector of lanes of one mode over pairs of cells: states at their ends, Taylor polynomials, bounds.
 *
 * The polynomial of a pair is about its middle: it reaches as far to either side as that of a cell to one.
 */
#ifndef VIBROIMPACT_LANE_CELLS_H
#define VIBROIMPACT_LANE_CELLS_H

#include "lanes/recording.h"
#include "lanes/sines.h"

/* Share of a pair about which its polynomial is. */
#define MIDDLE 0.5

/* A state of the lanes of a vector. */
typedef struct {
    vector q, p, cosine, sine;
} state;

/* The lanes of a vector during a round. */
typedef struct {
    state now, start;           /* from here the contacts are searched; start: of the round */
    vector on;
    vector to_goal;             /* pairs */
    vector jumped;              /* whole pairs passed from `start` to `now` */
    vector third[2], fourth[2]; /* bounds of derivatives of q over the near pairs, and over all, in units of a pair */
} flight;

/* Length of a pair, s. */
LANES_INLINE vector pair_of(const vi_lane_group *g, int at)
{
    return 2.0 * load(g->cell + at);
}

/* Pairs in a second. */
LANES_INLINE vector pair_rate(const vi_lane_group *g, int at)
{
    return 0.5 * load(g->cell_rate + at);
}

/* A bound over pairs ahead. */
LANES_INLINE vector bound_by(const vi_lane_array by[3], int at, const state *s)
{
    return load(by[0] + at) + (load(by[1] + at) * size_of(s->q) + load(by[2] + at) * size_of(s->p));
}

/* Bound the derivatives of q over the pairs ahead. */
LANES_INLINE void bound(const vi_lane_group *g, int at, flight *f)
{
#pragma GCC unroll 2
    for (int far = 0; far < 2; ++far) {
        f->third[far] = bound_by(g->one.third_by[far], at, &f->now);
        f->fourth[far] = bound_by(g->one.fourth_by[far], at, &f->now);
    }
}

/* Value of a table's row for a state. */
LANES_INLINE vector linear(const vi_lane_array row[VI_PARTS], int at, const state *s)
{
    return (load(row[VI_OF_Q] + at) * s->q + load(row[VI_OF_P] + at) * s->p)
           + ((load(row[VI_OF_COSINE] + at) * s->cosine + load(row[VI_OF_SINE] + at) * s->sine)
              + load(row[VI_OF_ONE] + at));
}

LANES_INLINE state chosen(mask where, const state *a, const state *b)
{
    return (state){choose(where, a->q, b->q), choose(where, a->p, b->p), choose(where, a->cosine, b->cosine),
                   choose(where, a->sine, b->sine)};
}

/* Rows of a table, chosen by each lane. */
LANES_INLINE vector gather(const vi_lane_array *rows, int stride, int at, const int row[])
{
    vector found;
#pragma GCC unroll 8
    for (int i = 0; i < VI_WIDTH; ++i) {
        found[i] = rows[row[i] * stride][at + i];
    }
    return found;
}

/* Value of a table for a state, in the row of each lane. */
LANES_INLINE vector gathered(const vi_lane_array *table, int at, const int row[], const state *s)
{
    return (gather(table + VI_OF_Q, VI_PARTS, at, row) * s->q + gather(table + VI_OF_P, VI_PARTS, at, row) * s->p)
           + ((gather(table + VI_OF_COSINE, VI_PARTS, at, row) * s->cosine
               + gather(table + VI_OF_SINE, VI_PARTS, at, row) * s->sine)
              + gather(table + VI_OF_ONE, VI_PARTS, at, row));
}

/* Turn the phases of the further sines by some whole pairs of each lane, and add their shares to the velocities then. */
LANES_INLINE void turn_sines_by(const vi_lane_group *g, int at, int further, const int row[], phases *of, vector *speed)
{
    const int stride = VI_FURTHER_SINES * VI_SINE_PARTS;
    for (int k = 0; k < further; ++k) {
        const vi_lane_array *of_p = g->sines->end_p[0][k], *turn = g->sines->turned[0][k];
        const vector c = of->cosine[k], s = of->sine[k];
        *speed += gather(of_p + VI_OF_ITS_COSINE, stride, at, row) * c + gather(of_p + VI_OF_ITS_SINE, stride, at, row) * s;
        const vector cosine = gather(turn + VI_OF_ITS_COSINE, stride, at, row);
        const vector sine = gather(turn + VI_OF_ITS_SINE, stride, at, row);
        of->cosine[k] = c * cosine - s * sine;
        of->sine[k] = s * cosine + c * sine;
    }
}

/* The same by `row` cells in all lanes. */
LANES_INLINE void turn_sines(const vi_lane_group *g, int at, int further, int row, phases *of, vector *speed)
{
    for (int k = 0; k < further; ++k) {
        const vi_lane_array *of_p = g->sines->end_p[row][k], *turn = g->sines->turned[row][k];
        const vector c = of->cosine[k], s = of->sine[k];
        *speed += load(of_p[VI_OF_ITS_COSINE] + at) * c + load(of_p[VI_OF_ITS_SINE] + at) * s;
        const vector cosine = load(turn[VI_OF_ITS_COSINE] + at), sine = load(turn[VI_OF_ITS_SINE] + at);
        of->cosine[k] = c * cosine - s * sine;
        of->sine[k] = s * cosine + c * sine;
    }
}

/* The state of this displacement and velocity some pairs later. */
LANES_INLINE state turned(const vi_lane_group *g, int at, int pairs, vector q, vector p, const state *s)
{
    const vector c = load(g->one.turn_cosine[2 * pairs] + at), n = load(g->one.turn_sine[2 * pairs] + at);
    return (state){q, p, s->cosine * c - s->sine * n, s->sine * c + s->cosine * n};
}

/* The state after some whole pairs of each lane; q[]: displacements after all numbers of pairs. `of`: phases of the
 * further sines, which turn too. Periodic motions pass the same number of pairs in all lanes: then no row is gathered. */
LANES_INLINE state after_pairs(const vi_lane_group *g, int at, int further, const state *s, phases *of, const vector q[],
                               vector pairs)
{
    if (!any(pairs != all(pairs[0]))) {
        const int row = 2 * (int)pairs[0];
        vector p = linear(g->one.end_p[row], at, s);
        turn_sines(g, at, further, row, of, &p);
        return turned(g, at, row / 2, q[row / 2], p, s);
    }
    int row[VI_WIDTH];
    vector here;
#pragma GCC unroll 8
    for (int i = 0; i < VI_WIDTH; ++i) {
        row[i] = 2 * (int)pairs[i];
        here[i] = q[row[i] / 2][i];
    }
    vector p = gathered(g->one.end_p[0], at, row, s);
    turn_sines_by(g, at, further, row, of, &p);
    const vector c = gather(g->one.turn_cosine, 1, at, row), n = gather(g->one.turn_sine, 1, at, row);
    return (state){here, p, s->cosine * c - s->sine * n, s->sine * c + s->cosine * n};
}

/* Half of the second derivative of q in a state, over a pair. */
LANES_INLINE vector half_of(const vi_lane_group *g, int at, int further, const state *s, const phases *of)
{
    vector half = linear(g->one.taylor[2], at, s);
    if (further) {
        add_sines(g->sines->taylor[2], at, further, of, &half);
    }
    return 4.0 * half;
}

/* Order of the Taylor terms with some further sines. */
LANES_INLINE int order_with(int further)
{
    return further ? VI_SINE_ORDER : VI_LANE_ORDER;
}

/* Taylor coefficients of q about the middle of the pair that begins in a state, in its share less MIDDLE. */
LANES_INLINE void expand(const vi_lane_group *g, int at, int further, const state *s, const phases *of, vector term[])
{
#pragma GCC unroll 20
    for (int n = 0; n <= order_with(further); ++n) {
        term[n] = n <= VI_LANE_ORDER ? linear(g->one.middle[n], at, s) : all(0.0);
        if (further) {
            add_sines(g->sines->middle[n], at, further, of, term + n);
        }
    }
}

/* Added value of a polynomial beyond its first term, and its slope. Odd and even powers are summed apart, which halves
 * the chain of operations. */
LANES_INLINE void evaluate(const vector term[], int order, vector share, vector *added, vector *slope)
{
    const vector square = share * share;
    vector odd = term[order - 1], odd_slope = (double)(order - 1) * odd;
    vector even = term[order], even_slope = (double)order * even;
#pragma GCC unroll 16
    for (int n = order - 3; n >= 1; n -= 2) {
        odd = odd * square + term[n];
        odd_slope = odd_slope * square + (double)n * term[n];
        even = even * square + term[n + 1];
        even_slope = even_slope * square + (double)(n + 1) * term[n + 1];
    }
    *added = share * (odd + share * even);
    *slope = odd_slope + share * even_slope;
}

/* Half the second derivative of a polynomial. */
LANES_INLINE vector half_bend(const vector term[], int last, vector share)
{
    const vector square = share * share;
    vector odd = (double)((last - 1) * (last - 2) / 2) * term[last - 1];
    vector even = (double)(last * (last - 1) / 2) * term[last];
#pragma GCC unroll 16
    for (int n = last - 3; n >= 3; n -= 2) {
        odd = odd * square + (double)(n * (n - 1) / 2) * term[n];
        even = even * square + (double)((n + 1) * n / 2) * term[n + 1];
    }
    return (even * square + term[2]) + share * odd;
}

/* First guess of a zero over a length: that of the inverse of a rising cubic. */
LANES_INLINE vector first_guess(vector y, vector slope, vector end_y, vector end_slope, vector length)
{
    const vector rise = end_y - y, t = -y / rise, back = 1.0 - t;
    /* slopes of the inverse at both ends; a line has 1 */
    const vector inverse = rise / (length * (slope * end_slope));
    const vector x = t + t * back * ((inverse * end_slope - 1.0) * back - (inverse * slope - 1.0) * t);
    return length * smaller(larger(x, all(0.0)), all(1.0));
}

#endif
