/* Extremes of a body of one mode, in lockstep: crests of the motion, where its velocity changes its sign in a cell.
 *
 * A crest counts where it may lie beyond the extremes so far, and short of the stop of its side. The curvature keeps its
 * sign over its cell, so it is the only one there. Of each side one crest waits for its Taylor polynomial: most waiting
 * crests turn out to be needless. A cell in which rounding or the curvature decide nothing is doubtful: see `extremes`
 * of lane_body.h.
 */
#include "lanes/cells.h"

/* Largest last step of Newton's method towards a crest, in cells: the value is then exact to the cube of the step. */
#define LAST_STEP 1e-5

/* A crest to be computed: the state at the start of its cell, a first guess, and the length of the cell's part. */
typedef struct {
    state start;
    vector guess, length;
    mask waits;
} crest;

enum { UPPER, LOWER, SIDES };

/* Extremes of the open periods of a vector of lanes. */
typedef struct {
    mask follows;
    mask doubtful[SIDES];
    vector most[SIDES], stop[SIDES]; /* largest q and -q, so far; place of the nearest stop on this side */
    crest waiting[SIDES];
} extremes;

/* A cell, or a part of it, between two states; velocities and curvatures over the length of a cell. */
typedef struct {
    state start;
    vector end_q, slope, end_slope, half, end_half; /* half: of the second derivative */
    vector length;
    vector slack, bend;                    /* largest deviations of q and of `half` from a line */
} piece;

LANES_INLINE vector of_side(int side, vector a)
{
    return side == UPPER ? a : -a;
}

LANES_INLINE extremes begin_extremes(const vi_lane_group *g, int at, int contacts)
{
    extremes e = {0};
    e.follows = load(g->record.extremes + at) > 0.0;
    if (!any(e.follows)) {
        return e;
    }
    e.most[UPPER] = load(g->record.most + at);
    e.most[LOWER] = -load(g->record.least + at);
    for (int side = 0; side < SIDES; ++side) {
        e.stop[side] = all(HUGE_VAL);
        for (int c = 0; c < contacts; ++c) {
            const mask here = of_side(side, load(g->sign[c] + at)) > 0.0;
            e.stop[side] = choose(here, smaller(load(g->limit[c] + at), e.stop[side]), e.stop[side]);
        }
    }
    return e;
}

/* Let a displacement count. */
LANES_INLINE void reach(extremes *e, int side, mask where, vector q)
{
    const vector most = larger(e->most[side], smaller(of_side(side, q), e->stop[side]));
    e->most[side] = choose(where, most, e->most[side]);
}

/* Compute the waiting crests of some lanes: two steps of Newton's method. */
LANES_INLINE void compute_crests(const vi_lane_group *g, int at, extremes *e, mask where, vector sign, const crest *c)
{
    vector term[VI_LANE_ORDER + 1], share = c->guess, value = share, step = share;
    expand(g, at, &c->start, term);
    for (int i = 0; i < 2; ++i) {
        vector added, slope, half;
        evaluate(term, share, &added, &slope);
        half = half_bend(term, share);
        step = -0.5 * slope / half;
        value = term[0] + (added + 0.5 * (slope * step));
        share = smaller(larger(share + step, all(0.0)), c->length);
    }
    const mask sure = size_of(step) <= LAST_STEP, upper = where & (sign > 0.0), lower = where & (sign < 0.0);
    reach(e, UPPER, upper & sure, value);
    reach(e, LOWER, lower & sure, value);
    e->doubtful[UPPER] |= upper & ~sure;
    e->doubtful[LOWER] |= lower & ~sure;
}

LANES_INLINE crest either(mask where, const crest *a, const crest *b)
{
    return (crest){chosen(where, &a->start, &b->start), choose(where, a->guess, b->guess),
                   choose(where, a->length, b->length), a->waits | b->waits};
}

/* Compute all waiting crests of some lanes that still count. */
LANES_INLINE void finish_crests(const vi_lane_group *g, int at, extremes *e, mask where)
{
    const mask short_of_stop[SIDES] = {e->most[UPPER] < e->stop[UPPER], e->most[LOWER] < e->stop[LOWER]};
    const mask upper = where & e->waiting[UPPER].waits & short_of_stop[UPPER];
    const mask lower = where & e->waiting[LOWER].waits & short_of_stop[LOWER];
    e->waiting[UPPER].waits &= ~where;
    e->waiting[LOWER].waits &= ~where;
    if (!any(upper | lower)) {
        return;
    }
    const crest one = either(upper, &e->waiting[UPPER], &e->waiting[LOWER]);
    compute_crests(g, at, e, upper | lower, choose(upper, all(1.0), all(-1.0)), &one);
    if (any(upper & lower)) {
        compute_crests(g, at, e, upper & lower, all(-1.0), &e->waiting[LOWER]);
    }
}

/* Look for crests in a piece of some lanes. */
LANES_INLINE void look_into(const vi_lane_group *g, int at, extremes *e, mask where, const piece *a)
{
    for (int side = 0; side < SIDES; ++side) {
        const vector edge = larger(of_side(side, a->start.q), of_side(side, a->end_q));
        const vector slope = -of_side(side, a->slope), end_slope = -of_side(side, a->end_slope);
        const vector half = -of_side(side, a->half), end_half = -of_side(side, a->end_half);
        const mask matters = where & (edge + a->slack > e->most[side]) & (e->most[side] < e->stop[side]);
        const mask bent = (smaller(half, end_half) > a->bend) | (larger(half, end_half) < -a->bend);
        mask turns = matters & bent & (half > 0.0) & (slope < 0.0) & (end_slope >= 0.0);
        e->most[side] = choose(matters, larger(e->most[side], edge), e->most[side]);
        e->doubtful[side] |= matters & ~bent;
        const mask both = turns & e->waiting[side].waits;
        if (any(both)) {
            compute_crests(g, at, e, both, of_side(side, all(1.0)), &e->waiting[side]);
            turns &= ~both | (edge + a->slack > e->most[side]);
        }
        if (any(turns)) {
            const vector guess = first_guess(slope, 2.0 * half, end_slope, 2.0 * end_half, a->length);
            const crest new = {a->start, guess, a->length, turns};
            e->waiting[side] = either(turns, &new, &e->waiting[side]);
        }
    }
}

/* Follow the extremes of some lanes over their next whole cells, as many as passed, whose ends are q[]. */
LANES_INLINE void follow_cells(const vi_lane_group *g, int at, extremes *e, mask where, const flight *f,
                               const vector q[], vector passed)
{
    const vector cell = load(g->cell + at), slack = 0.125 * f->second;
    const vector steep = 0.125 * f->third * load(g->cell_rate + at);
    vector p = f->now.p;
    for (int i = 1; i <= VI_CELLS; ++i) {
        const mask inside = where & (passed >= (double)i);
        if (!any(inside)) {
            return;
        }
        const vector end_p = linear(g->one.end_p[i], at, &f->now);
        const mask steady = (smaller(p, end_p) > steep) | (larger(p, end_p) < -steep);
        const mask beyond = (larger(q[i - 1], q[i]) + slack > e->most[UPPER])
                            | (slack - smaller(q[i - 1], q[i]) > e->most[LOWER]);
        const mask may = inside & beyond & ~steady;
        if (any(may)) {
            const state from = turned(g, at, i - 1, q[i - 1], p, &f->now), to = turned(g, at, i, q[i], end_p, &f->now);
            const piece whole = {.start = from,
                                 .end_q = to.q,
                                 .slope = p * cell,
                                 .end_slope = end_p * cell,
                                 .half = linear(g->one.taylor[2], at, &from),
                                 .end_half = linear(g->one.taylor[2], at, &to),
                                 .length = all(1.0),
                                 .slack = slack,
                                 .bend = f->fourth * (1.0 / 16.0)};
            look_into(g, at, e, may, &whole);
        }
        p = end_p;
    }
}

/* Follow the extremes of some lanes over the part of a cell up to a share, which ends in this state. */
LANES_INLINE void follow_part(const vi_lane_group *g, int at, extremes *e, mask where, const flight *f,
                              const state *start, const vector term[], vector share, vector end_q, vector end_slope)
{
    const vector square = share * share, slack = 0.125 * f->second * square, steep = 0.125 * f->third * square;
    const mask steady = (smaller(term[1], end_slope) > steep) | (larger(term[1], end_slope) < -steep);
    const mask beyond = (larger(start->q, end_q) + slack > e->most[UPPER])
                        | (slack - smaller(start->q, end_q) > e->most[LOWER]);
    const mask may = where & beyond & ~steady;
    if (any(may)) {
        const piece part = {.start = *start,
                            .end_q = end_q,
                            .slope = term[1],
                            .end_slope = end_slope,
                            .half = term[2],
                            .end_half = half_bend(term, share),
                            .length = share,
                            .slack = slack,
                            .bend = f->fourth * (1.0 / 16.0) * square};
        look_into(g, at, e, may, &part);
    }
    reach(e, UPPER, where, end_q);
    reach(e, LOWER, where, end_q);
}

/* Keep the extremes in the record. */
LANES_INLINE void keep_extremes(vi_lane_group *g, int at, const extremes *e)
{
    store(g->record.most + at, choose(e->follows, e->most[UPPER], load(g->record.most + at)));
    store(g->record.least + at, choose(e->follows, -e->most[LOWER], load(g->record.least + at)));
}
