/* Extremes of the flights of one lane: crests of the motion, where its velocity changes its sign in a cell.
 *
 * All ends of cells count. A crest is computed only where a bound of its cell lies beyond the extreme so far. That
 * extreme is short of the stop of its side. The bound exceeds each computed value, so what is left out changes no bit.
 * A crest whose curvature keeps its sign is the only one of its cell. The careful search of lane_cell.h does other cells.
 */
#ifndef VIBROIMPACT_LANE_EXTREMES_H
#define VIBROIMPACT_LANE_EXTREMES_H

#include "lanes/lane_cell.h"
#include "lanes/one_lane.h"
#include "motion/majorant.h"

/* Largest last step of Newton's method towards a crest, in cells: the value is then exact to the cube of the step. */
#define LAST_STEP 1e-5
/* Rounding of an end or a crest, in units of the displacements and of the bound of the acceleration. */
#define ROUNDING_OF_CREST (64.0 * 2.220446049250313e-16)

enum { UPPER, LOWER, SIDES };
/* Stretches of VI_CELLS cells in the longest flight. */
enum { MOST_SEGMENTS = 5 };

/* Largest q and -q of a period, so far. */
typedef struct {
    double most[SIDES];
} range;

/* Cells that may have a crest: their starts, lengths, sides (1, -1), bounds of the fourth derivative of q. Their instants
 * are set for further sines. */
typedef struct {
    _Alignas(64) double q[VI_WIDTH];
    _Alignas(64) double p[VI_WIDTH];
    _Alignas(64) double cosine[VI_WIDTH];
    _Alignas(64) double sine[VI_WIDTH];
    _Alignas(64) double length[VI_WIDTH];
    _Alignas(64) double side[VI_WIDTH];
    _Alignas(64) double fourth[VI_WIDTH];
    _Alignas(64) double periods[VI_WIDTH];
    _Alignas(64) double rest[VI_WIDTH];
    int32_t period[VI_WIDTH];
    int count;
} crests;

/* The search for the extremes of a lane. */
typedef struct {
    const vi_lane_group *g;
    int lane;
    double stop[SIDES]; /* place of the nearest stop on this side */
    range *range_of;    /* of each period */
    crests waiting;
} extremes;

/* Bounds of derivatives of q over VI_CELLS cells, times powers of the cell. The energy norm grows at most by
 * the loads; the derivatives follow from the equation. */
typedef struct {
    vector second, third, fourth;
} bounds;

LANES_INLINE bounds bound_lane(const vi_lane_group *g, int lane, const state *s)
{
    const double k = g->one.stiffness[lane], loads = g->one.load[lane], drag = g->one.drag[lane];
    const double w = g->one.fastest_load[lane], cell = g->cell[lane], square = cell * cell;
    const vector norm = root(s->p * s->p + k * (s->q * s->q)) + loads * g->one.span[lane];
    const vector second = loads + g->one.root_rate[lane] * norm;
    const vector third = w * loads + (drag * second + k * norm);
    const vector fourth = w * (w * loads) + (drag * third + k * second);
    return (bounds){second * square, third * (square * cell), fourth * (square * square)};
}

/* Let a displacement count. */
static inline void reach(extremes *e, int32_t period, int side, double q)
{
    double *most = &e->range_of[period].most[side];
    const double value = vi_min(side == UPPER ? q : -q, e->stop[side]);
    *most = value > *most ? value : *most;
}

/* Compute the waiting crests: two steps of Newton's method. */
static void compute_crests(extremes *e)
{
    crests *c = &e->waiting;
    const state start = {load(c->q), load(c->p), load(c->cosine), load(c->sine)};
    const vector length = load(c->length), side = load(c->side), bend = load(c->fourth) * (1.0 / 16.0) * (length * length);
    vector term[VI_SINE_ORDER + 1], added, slope;
    phases of;
    phases_of_lane(e->g, e->lane, vi_further_sines(e->g), load(c->periods), load(c->rest), &of);
    expand_of_lane(e->g, e->lane, &start, &of, term);
    evaluate_of_lane(e->g, term, length, &added, &slope);
    const vector first = -side * term[1], last = -side * slope;
    const vector half = -side * term[2], end_half = -side * half_bend_of_lane(e->g, term, length);
    const mask bent = (smaller(half, end_half) > bend) | (larger(half, end_half) < -bend);
    const mask turns = bent & (half > 0.0) & (first < 0.0) & (last >= 0.0);
    vector share = first_guess(first, 2.0 * half, last, 2.0 * end_half, length), value = share, step = share;
    for (int i = 0; i < 2; ++i) {
        evaluate_of_lane(e->g, term, share, &added, &slope);
        step = -0.5 * slope / half_bend_of_lane(e->g, term, share);
        value = term[0] + (added + 0.5 * (slope * step));
        share = smaller(larger(share + step, all(0.0)), length);
    }
    const mask sure = turns & (size_of(step) <= LAST_STEP), careful = ~bent | (turns & ~sure);
    for (int i = 0; i < c->count; ++i) {
        const int of = c->side[i] > 0.0 ? UPPER : LOWER;
        if (sure[i]) {
            reach(e, c->period[i], of, value[i]);
        } else if (careful[i]) {
            vi_lane_cell cell = {.order = order_with(vi_further_sines(e->g))};
            for (int n = 0; n <= cell.order; ++n) {
                cell.term[n] = term[n][i];
            }
            reach(e, c->period[i], of, c->side[i] * vi_lane_cell_crest(&cell, c->side[i], c->length[i]));
        }
    }
    c->count = 0;
}

/* A vector of flights, in segments of VI_CELLS cells. */
typedef struct {
    int32_t period[VI_WIDTH];
    vector cells, whole, end_q;
    vector periods, rest;                               /* of the clock at the starts */
    int segments;
    state segment[MOST_SEGMENTS];                       /* at its start */
    vector q[MOST_SEGMENTS * VI_CELLS + 1];             /* at the ends of cells */
    vector highest[MOST_SEGMENTS], lowest[MOST_SEGMENTS]; /* of a segment's ends of cells */
} stretch;

/* Seconds of the clock's period some cells after the starts of the flights. */
LANES_INLINE vector rest_after(const vi_lane_group *g, int lane, const stretch *s, int cells)
{
    return s->rest + (double)cells * g->cell[lane];
}

/* Compute the displacements at the ends of the cells. */
LANES_INLINE void pass_cells(const vi_lane_group *g, int lane, stretch *s)
{
    s->q[0] = s->segment[0].q;
    for (s->segments = 1;; ++s->segments) {
        const int segment = s->segments - 1, first = segment * VI_CELLS;
        const state *now = &s->segment[segment];
        const bool is_whole = !any(s->whole < (double)(first + VI_CELLS));
        const int further = vi_further_sines(g);
        phases of;
        phases_of_lane(g, lane, further, s->periods, rest_after(g, lane, s, first), &of);
        vector highest = larger(s->q[first], s->end_q), lowest = smaller(s->q[first], s->end_q);
#pragma GCC unroll 8
        for (int i = 1; i <= VI_CELLS; ++i) {
            vector q = row_of_lane(g->one.end_q[i], lane, now);
            if (further) {
                add_sines_of_lane(g->sines->end_q + i, 1, lane, further, &of, &q);
            }
            s->q[first + i] = q;
            if (!is_whole) {
                q = choose(s->whole >= (double)(first + i), q, s->end_q);
            }
            highest = larger(highest, q);
            lowest = smaller(lowest, q);
        }
        s->highest[segment] = highest;
        s->lowest[segment] = lowest;
        if (s->segments == MOST_SEGMENTS || !any(s->cells > (double)(first + VI_CELLS))) {
            return;
        }
        s->segment[s->segments] = after_cells(g, lane, VI_CELLS, now, &of);
    }
}

/* Put the cells of some flights in line for their crests. */
static inline void put_in_line(extremes *e, const state *start, const stretch *s, int cell, vector length, vector fourth,
                               int side, mask where)
{
    const vector rest = rest_after(e->g, e->lane, s, cell);
    crests *c = &e->waiting;
    for (int n = 0; n < VI_WIDTH; ++n) {
        if (where[n]) {
            const int to = c->count++;
            c->q[to] = start->q[n];
            c->p[to] = start->p[n];
            c->cosine[to] = start->cosine[n];
            c->sine[to] = start->sine[n];
            c->length[to] = length[n];
            c->side[to] = side == UPPER ? 1.0 : -1.0;
            c->fourth[to] = fourth[n];
            c->periods[to] = s->periods[n];
            c->rest[to] = rest[n];
            c->period[to] = s->period[n];
            if (c->count == VI_WIDTH) {
                compute_crests(e);
            }
        }
    }
}

/* Velocity some cells after the start of a segment. */
LANES_INLINE vector speed_after(const extremes *e, const stretch *s, int segment, int cells)
{
    const int further = vi_further_sines(e->g);
    vector p = row_of_lane(e->g->one.end_p[cells], e->lane, &s->segment[segment]);
    if (further) {
        phases of;
        phases_of_lane(e->g, e->lane, further, s->periods, rest_after(e->g, e->lane, s, segment * VI_CELLS), &of);
        add_sines_of_lane(e->g->sines->end_p + cells, 1, e->lane, further, &of, &p);
    }
    return p;
}

/* Look for crests in cell `i`, from 1, of a segment, for some flights of each side.
 *
 * The velocity deviates from a line over the cell by an eighth of its largest second derivative. Its slope deviates from
 * the line's by half of it: then the velocity is monotone, and its signs tell crests. */
LANES_INLINE void look_into(extremes *e, const stretch *s, int segment, int i, const bounds *b, const mask may[SIDES])
{
    const vi_lane_group *g = e->g;
    const state *now = &s->segment[segment];
    const int cell = segment * VI_CELLS + i - 1;
    state start = {s->q[cell], i == 1 ? now->p : speed_after(e, s, segment, i - 1), now->cosine, now->sine};
    const vector end_p = speed_after(e, s, segment, i), third = b->third * g->cell_rate[e->lane];
    const mask steady = (smaller(start.p, end_p) > 0.125 * third) | (larger(start.p, end_p) < -0.125 * third);
    const mask bends = ~steady & ~(size_of(end_p - start.p) > 0.5 * third);
    const mask here[SIDES] = {may[UPPER] & (bends | ((start.p > 0.0) & (end_p < 0.0))),
                              may[LOWER] & (bends | ((start.p < 0.0) & (end_p > 0.0)))};
    if (!any(here[UPPER] | here[LOWER])) {
        return;
    }
    const vector length = smaller(s->cells - (double)cell, all(1.0));
    turn_on(&g->one, e->lane, i - 1, now, &start.cosine, &start.sine);
    for (int side = 0; side < SIDES; ++side) {
        if (any(here[side])) {
            put_in_line(e, &start, s, cell, length, b->fourth, side, here[side]);
        }
    }
}

/* Look for crests in the cells of a vector of flights. */
LANES_INLINE void look_for_crests(extremes *e, const stretch *s)
{
    vector most[SIDES];
    for (int side = 0; side < SIDES; ++side) {
        vector so_far;
#pragma GCC unroll 8
        for (int n = 0; n < VI_WIDTH; ++n) {
            so_far[n] = e->range_of[s->period[n]].most[side];
        }
        most[side] = choose(so_far < e->stop[side], so_far, all(HUGE_VAL));
    }
    for (int segment = 0; segment < s->segments; ++segment) {
        const bounds b = bound_lane(e->g, e->lane, &s->segment[segment]);
        const vector size = larger(s->highest[segment], -s->lowest[segment]);
        const vector slack = 0.125 * b.second + ROUNDING_OF_CREST * (size + b.second);
        const vector highest = most[UPPER] - slack, lowest = slack - most[LOWER];
        const mask begun = s->cells > (double)(segment * VI_CELLS);
        if (!any(begun & ((s->highest[segment] > highest) | (s->lowest[segment] < lowest)))) {
            continue;
        }
        for (int i = 1; i <= VI_CELLS; ++i) {
            const int cell = segment * VI_CELLS + i - 1;
            const mask inside = s->cells > (double)cell;
            const vector q = s->q[cell], end = choose(s->whole > (double)cell, s->q[cell + 1], s->end_q);
            const mask may[SIDES] = {inside & (larger(q, end) > highest), inside & (smaller(q, end) < lowest)};
            if (any(may[UPPER] | may[LOWER])) {
                look_into(e, s, segment, i, &b, may);
            }
        }
    }
}

/* Order flights: those of several segments come first, so that vectors hold flights of about one length. */
static inline void order_flights(const vi_waiting_flights *w, int32_t count, int32_t order[])
{
    int32_t first = 0, last = count;
    for (int32_t n = 0; n < count; ++n) {
        const bool is_long = w->cells[n] > (double)VI_CELLS;
        last -= !is_long;
        order[is_long ? first : last] = n;
        first += is_long;
    }
}

LANES_INLINE vector pick(const double *from, const int32_t order[])
{
    vector found;
#pragma GCC unroll 8
    for (int i = 0; i < VI_WIDTH; ++i) {
        found[i] = from[order[i]];
    }
    return found;
}

/* Read a vector of flights, and let their ends of cells count. */
LANES_INLINE void begin_stretch(extremes *e, const int32_t order[], stretch *s)
{
    const vi_waiting_flights *w = &e->g->waiting[e->lane];
    s->segment[0] = (state){pick(w->q, order), pick(w->p, order), pick(w->cosine, order), pick(w->sine, order)};
    s->cells = pick(w->cells, order);
    s->whole = whole_part(s->cells);
    s->end_q = pick(w->end_q, order);
    s->periods = pick(w->periods, order);
    s->rest = pick(w->rest, order);
    pass_cells(e->g, e->lane, s);
    vector highest = s->highest[0], lowest = s->lowest[0];
    for (int segment = 1; segment < s->segments; ++segment) {
        const mask begun = s->cells > (double)(segment * VI_CELLS);
        highest = choose(begun, larger(highest, s->highest[segment]), highest);
        lowest = choose(begun, smaller(lowest, s->lowest[segment]), lowest);
    }
    for (int n = 0; n < VI_WIDTH; ++n) {
        s->period[n] = w->strobes_before[order[n]];
        if (order[n] < w->flights) {
            reach(e, s->period[n], UPPER, highest[n]);
            reach(e, s->period[n], LOWER, lowest[n]);
        }
    }
}

/* Extend the ranges of the periods by the waiting flights of a lane, which fill their last vector. */
LANES_INLINE void follow_flights(const vi_lane_group *g, int lane, int contacts, range range_of[])
{
    const int32_t count = (int32_t)(g->waiting[lane].flights + VI_WIDTH - 1) / VI_WIDTH * VI_WIDTH;
    extremes e = {.g = g, .lane = lane, .stop = {HUGE_VAL, HUGE_VAL}, .range_of = range_of};
    int32_t order[VI_FLIGHTS];
    for (int c = 0; c < contacts; ++c) {
        double *stop = &e.stop[g->sign[c][lane] > 0.0 ? UPPER : LOWER];
        *stop = vi_min(*stop, g->limit[c][lane]);
    }
    order_flights(&g->waiting[lane], count, order);
    for (int32_t first = 0; first < count; first += VI_WIDTH) {
        stretch s;
        begin_stretch(&e, order + first, &s);
        look_for_crests(&e, &s);
    }
    if (e.waiting.count > 0) {
        compute_crests(&e);
    }
}

#endif
