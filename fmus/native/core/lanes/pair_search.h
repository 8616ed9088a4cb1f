/* The contacts of a vector of lanes of one mode in a pair of cells: parts that surely have one, or none; their places.
 *
 * Included by rounds.h. A part that is not sure is cut in half there.
 */
#include "lanes/cells.h"

/* Step of a search for a contact, in pairs, below which it is the last one. The polynomial of third order then gives the
 * value and the slope to a rounding. */
#define LAST_CONTACT_STEP 2e-6
/* Largest change of a pair's start since the last contact, in changes of q over the pair. Below it the search begins at
 * the share of that contact. */
#define ALIKE 1e-3
/* Most steps of a search for a contact. */
enum { MOST_CONTACT_STEPS = 5 };

/* A place on the polynomial of a pair: its share, the added value beyond the first term there, and the slope. */
typedef struct {
    vector share, added, slope;
} place;

LANES_INLINE place place_at(const vector term[], int order, vector share)
{
    place a = {.share = share};
    evaluate(term, order, share - MIDDLE, &a.added, &a.slope);
    return a;
}

LANES_INLINE place either_place(mask where, const place *a, const place *b)
{
    return (place){choose(where, a->share, b->share), choose(where, a->added, b->added),
                   choose(where, a->slope, b->slope)};
}

/* A stop, as the motion of q towards it sees it: y = sign * q - limit rises through 0 at a contact. */
typedef struct {
    vector sign, limit;
    mask leaves; /* the motion begins on the stop, and recedes */
} stop;

/* Bounds on the polynomial of a pair: its third derivative in the middle, and the largest size of its fourth one. */
typedef struct {
    vector third, fourth;
} bends;

LANES_INLINE bends bends_of(const vector term[], int order)
{
    bends b = {6.0 * term[3], 24.0 * size_of(term[4])};
    double half = 0.5;
#pragma GCC unroll 16
    for (int n = 5; n <= order; ++n, half *= 0.5) {
        b.fourth += (double)(n * (n - 1) * (n - 2) * (n - 3)) * half * size_of(term[n]);
    }
    return b;
}

/* Largest deviation from a line over a length, to the side of `curve`, the largest second derivative times its sign. */
LANES_INLINE vector sag(vector curve, vector square)
{
    return larger(0.125 * square * curve, all(0.0));
}

/* Verdict on a part of a pair: the stop is surely met once; surely not; otherwise the part is too long. */
typedef struct {
    mask hits, clear;
} verdict;

/* Judge the part of a pair between two places. noise: rounding of y. */
LANES_INLINE verdict judge(const stop *stop, const vector term[], const bends *b, const place *from, const place *to,
                           vector noise)
{
    const vector middle = stop->sign * term[0] - stop->limit, length = to->share - from->share, square = length * length;
    const vector y = only(~stop->leaves, middle + stop->sign * from->added), end_y = middle + stop->sign * to->added;
    const vector slope = stop->sign * from->slope, end_slope = stop->sign * to->slope, third = stop->sign * b->third;
    const mask rises = (smaller(slope, end_slope) > sag(third + 0.5 * b->fourth, square)) & (y <= noise);
    /* Bernstein coefficients of the cubic with these values and slopes, and the deviation from the cubic */
    const vector part = length * (1.0 / 3.0);
    const vector highest = larger(larger(y, end_y), larger(y + part * slope, end_y - part * end_slope));
    const mask below = highest + b->fourth * (square * square) * (1.0 / 384.0) < 0.0;
    /* leaving: the mean velocity since the start, bent by a third of the third derivative, stays negative */
    const vector mean = sag((0.5 * b->fourth - third) * (1.0 / 3.0), square);
    const mask recedes = stop->leaves & (slope + mean < 0.0) & (end_y + length * mean < 0.0);
    return (verdict){rises & (end_y > 0.0), below | recedes | (rises & (end_y <= 0.0))};
}

/* Third derivative of a polynomial, to its seventh order: it corrects the last step. */
LANES_INLINE vector third_of(const vector term[], vector share)
{
    const vector x = share - MIDDLE, square = x * x;
    return (6.0 * term[3] + square * (60.0 * term[5] + square * (210.0 * term[7])))
           + x * (24.0 * term[4] + square * (120.0 * term[6]));
}

/* One step of third order (Chebyshev's) towards the contact, with the value and the slope after it. */
LANES_INLINE place step_from(const vector term[], int order, vector y, const place *from, const place *to, vector share, mask *found)
{
    const place at = place_at(term, order, share);
    const vector half = half_bend(term, VI_LANE_ORDER, share - MIDDLE), third = third_of(term, share), inverse = 1.0 / at.slope;
    const vector whole = (y + at.added) * inverse, bent = half * inverse, next = share - whole * (1.0 + whole * bent);
    place after = {.share = smaller(larger(next, from->share), to->share)};
    const vector step = after.share - share;
    *found = size_of(step) * larger(size_of(bent), all(1.0)) < LAST_CONTACT_STEP;
    after.added = at.added + step * (at.slope + step * (half + step * (third * (1.0 / 6.0))));
    after.slope = at.slope + step * (2.0 * half + step * (0.5 * third));
    return after;
}

/* Lanes whose pair begins as that of their last contact did: periodic motion repeats. */
LANES_INLINE mask repeat_last(const vi_lane_group *g, int at, vector flown, const state *start)
{
    const vector q = start->q - load(g->hit_q + at), p = start->p - load(g->hit_p + at);
    return (flown == load(g->hit_pairs + at))
           & (size_of(q) + pair_of(g, at) * size_of(p) < ALIKE * (pair_of(g, at) * size_of(start->p)));
}

/* Find the contacts of some lanes, on a rising part of a pair. `y`: of the middle, in the direction of q. */
LANES_INLINE place find_contact(const vi_lane_group *g, int at, mask hits, mask repeats, const vector term[],
                                int order, vector y, const place *from, const place *to)
{
    const vector last = load(g->hit_share + at);
    place met = {.share = last};
    repeats &= (last >= from->share) & (last <= to->share);
    if (any(hits & ~repeats)) {
        const vector guess = first_guess(y + from->added, from->slope, y + to->added, to->slope, to->share - from->share);
        met.share = choose(repeats, last, from->share + guess);
    }
    mask found = hits & ~hits, exact;
    for (int i = 0; i < MOST_CONTACT_STEPS && any(hits & ~found); ++i) {
        const place next = step_from(term, order, y, from, to, met.share, &exact);
        met = either_place(found, &met, &next);
        found |= exact;
    }
    return met;
}
