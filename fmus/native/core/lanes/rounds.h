/* The lockstep of bodies of one mode, for one instruction set: see rounds_many.h. */
#include "lanes/rounds_samples.h"
#include "lanes/waiting.h"

/* Rounding of a displacement, in units of the sum of the sizes of its terms. */
#define ROUNDING (16.0 * 2.220446049250313e-16)

/* Largest difference between the first guess of a contact and the share of the cell that ended the last flight. That
 * share is a better guess then: periodic motion repeats. */
#define ALIKE 1e-3
/* Step of third order below which its error is a rounding. */
#define EXACT_FROM 4e-6
/* Most times in a row that a lane goes through all its cells in one round. */
enum { MOST_JUMPS = 3 };

/* The cell in which a lane may meet a contact or its goal. */
typedef struct {
    vector passed;        /* whole cells before it */
    vector length;        /* share of it up to the goal or its end */
    mask goal;            /* its end is the goal */
    mask searched;        /* a contact may be met in it */
    mask twofold;         /* two contacts may be met in it */
    vector sign, limit;   /* of the contact */
    vector number;        /* from 1 */
    state start;
} candidate;

/* Time to the goal, s. */
LANES_INLINE vector seconds_to_goal(const vi_lane_group *g, int at)
{
    const vector whole = load(g->goal_periods + at) - load(g->periods + at);
    const vector high = whole * load(g->period + at) + (load(g->goal_rest + at) - load(g->rest + at));
    const vector low = whole * load(g->period_low + at) + (load(g->goal_rest_low + at) - load(g->rest_low + at));
    return high + low;
}

LANES_INLINE flight begin_round(const vi_lane_group *g, int at)
{
    flight f;
    f.now.q = load(g->q[0] + at);
    f.now.p = load(g->p[0] + at);
    turn(load(g->angular_frequency + at) * load(g->rest + at), &f.now.cosine, &f.now.sine);
    f.start = f.now;
    f.on = load(g->on + at);
    f.to_goal = larger(seconds_to_goal(g, at) * load(g->cell_rate + at), all(0.0));
    f.jumped = all(0.0);
    bound(g, at, &f);
    return f;
}

/* Displacements at the ends of the cells ahead. */
LANES_INLINE void ends_of_cells(const vi_lane_group *g, int at, const flight *f, vector q[])
{
    q[0] = f->now.q;
#pragma GCC unroll 8
    for (int i = 1; i <= VI_CELLS; ++i) {
        q[i] = linear(g->one.end_q[i], at, &f->now);
    }
}

/* Count the cells in which a contact is surely not met. q[]: at the ends of the cells; bend: q'' now, over a cell.
 *
 * The motion exceeds the line over a cell by at most an eighth of its largest -y''. Second differences give y'' at the
 * ends of cells to a twelfth of the fourth derivative. Between them y'' is off a line by an eighth of it. */
LANES_INLINE vector count_clear(const vi_lane_group *g, int at, int c, const flight *f, const vector q[], vector bend)
{
    const vector sign = load(g->sign[c] + at), limit = load(g->limit[c] + at);
    const vector error = f->fourth * (1.0 / 12.0 + 1.0 / 8.0), none = all(0.0);
    vector before = sign * q[0] - limit, here = sign * q[1] - limit, curve = sign * bend;
    mask clear = before == before, counted = (mask)all(WHOLE);
#pragma GCC unroll 8
    for (int i = 1; i <= VI_CELLS; ++i) {
        vector next = here, end_curve = curve - f->third;
        if (i < VI_CELLS) {
            next = sign * q[i + 1] - limit;
            end_curve = (next - here) - (here - before);
        }
        mask passes = larger(before, here) < 0.125 * smaller(smaller(curve, end_curve) - error, none);
        if (i == 1) {
            /* just left: the mean velocity since then, which is smooth, stays negative */
            const vector leaving = sign * (f->now.p * load(g->cell + at));
            const mask left = larger(leaving, here) + f->third * (1.0 / 24.0) < 0.0, on = f->on == (double)(c + 1);
            passes = (passes & ~on) | (left & on);
        }
        clear &= passes;
        counted -= clear;
        before = here;
        here = next;
        curve = end_curve;
    }
    return (vector)counted - WHOLE;
}

/* Whole cells that a lane surely passes: no contact in them, and not beyond the goal. */
LANES_INLINE vector sure_cells(const flight *f, int contacts, const vector count[], vector *cleared)
{
    *cleared = all((double)VI_CELLS);
    for (int c = 0; c < contacts; ++c) {
        *cleared = smaller(count[c], *cleared);
    }
    return smaller(*cleared, whole_part(smaller(f->to_goal, all((double)VI_CELLS))));
}

/* Lanes that pass all their cells go on from there in the same round. */
LANES_INLINE void jump(const vi_lane_group *g, int at, mask jumps, flight *f)
{
    const vector q = linear(g->one.end_q[VI_CELLS], at, &f->now), p = linear(g->one.end_p[VI_CELLS], at, &f->now);
    const state next = turned(g, at, VI_CELLS, q, p, &f->now);
    f->now = chosen(jumps, &next, &f->now);
    f->on = only(~jumps, f->on);
    f->jumped += only(jumps, all((double)VI_CELLS));
    f->to_goal -= only(jumps, all((double)VI_CELLS));
}

/* Move on to the cell in which each lane may meet a contact, its goal or the end of its round. */
LANES_INLINE candidate choose_cell(const vi_lane_group *g, int at, int contacts, flight *f)
{
    candidate cell;
    vector count[VI_LANES_CONTACTS], cleared, q[VI_CELLS + 1];
    for (int i = 0;; ++i) {
        ends_of_cells(g, at, f, q);
        const vector bend = 2.0 * linear(g->one.taylor[2], at, &f->now);
        for (int c = 0; c < contacts; ++c) {
            count[c] = count_clear(g, at, c, f, q, bend);
        }
        cell.passed = sure_cells(f, contacts, count, &cleared);
        const mask jumps = cell.passed == (double)VI_CELLS;
        if (i == MOST_JUMPS || !any(jumps)) {
            break;
        }
        jump(g, at, jumps, f);
        bound(g, at, f);
    }
    const mask jumps = cell.passed == (double)VI_CELLS;
    const vector length = larger(f->to_goal - cell.passed, all(0.0));
    cell.length = only(~jumps, smaller(length, all(1.0)));
    cell.goal = ~jumps & (length <= 1.0);
    cell.searched = ~jumps & (cleared == cell.passed);
    cell.twofold = cell.searched & ~cell.searched;
    cell.sign = cell.limit = cell.number = all(0.0);
    for (int c = contacts - 1; c >= 0; --c) {
        const mask met = cell.searched & (count[c] == cell.passed);
        cell.twofold |= met & (cell.number > 0.0);
        cell.sign = choose(met, load(g->sign[c] + at), cell.sign);
        cell.limit = choose(met, load(g->limit[c] + at), cell.limit);
        cell.number = choose(met, all((double)(c + 1)), cell.number);
    }
    cell.start = after_cells(g, at, &f->now, q, cell.passed);
    return cell;
}

/* One step towards the zero of y + sign * (added value of the polynomial), of third order (Chebyshev's). */
LANES_INLINE vector closer(const vector term[], vector y, vector sign, vector share)
{
    vector added, slope;
    evaluate(term, share, &added, &slope);
    const vector bend = half_bend(term, share);
    const vector inverse = 1.0 / slope, step = (sign * y + added) * inverse;
    return share - step * (1.0 + step * (bend * inverse));
}

/* Share of the cell at which the rising motion y + sign * (added value) of some lanes meets its contact. */
LANES_INLINE vector find_contact(const vi_lane_group *g, int at, mask hits, const flight *f, const candidate *cell,
                                 const vector term[], vector y, vector slope, vector end_y, vector end_slope)
{
    const vector guess = first_guess(y, slope, end_y, end_slope, cell->length), last = load(g->hit_share + at);
    const mask repeats = (f->jumped + cell->passed == load(g->hit_cells + at)) & (size_of(last - guess) < ALIKE);
    const vector from = choose(repeats, last, guess);
    const vector near = smaller(larger(closer(term, y, cell->sign, from), all(0.0)), cell->length);
    const mask found = size_of(near - from) < EXACT_FROM;
    if (!any(hits & ~found)) {
        return near;
    }
    const vector nearer = smaller(larger(closer(term, y, cell->sign, near), all(0.0)), cell->length);
    return choose(found, near, nearer);
}

/* Result of a round for the lanes. */
typedef struct {
    vector share; /* passed share of the cell */
    vector q, p;
    vector slope; /* of the polynomial, before a rebound */
    mask hits, careful;
} arrival;

/* Move to the contact, the goal or the end of a cell with these Taylor coefficients. */
LANES_INLINE arrival search(const vi_lane_group *g, int at, const flight *f, const candidate *cell, const vector term[])
{
    vector added, slope;
    evaluate(term, cell->length, &added, &slope);
    const vector length = cell->length, bare = cell->sign * term[0] - cell->limit;
    const mask leaves = (cell->passed == 0.0) & (f->on == cell->number);
    const vector y = only(~leaves, bare), first = cell->sign * term[1];
    const vector end_y = y + cell->sign * added, end_slope = cell->sign * slope;
    const vector noise = ROUNDING * (size_of(cell->limit) + size_of(term[0]) + size_of(term[1]) + size_of(added));
    const mask rises = (smaller(first, end_slope) > 0.125 * f->third * (length * length)) & (y <= noise);
    /* Bernstein coefficients of the cubic with these values and slopes, and the deviation from the cubic */
    const vector third = length * (1.0 / 3.0);
    const vector highest = larger(larger(y, end_y), larger(y + third * first, end_y - third * end_slope));
    const mask below = highest + f->fourth * (1.0 / 384.0) < 0.0;
    arrival a;
    a.hits = cell->searched & ~cell->twofold & rises & (end_y > 0.0);
    a.careful = cell->searched & ~a.hits & (cell->twofold | ~(below | (rises & (end_y <= 0.0))));
    a.share = length;
    if (any(a.hits)) {
        a.share = choose(a.hits, find_contact(g, at, a.hits, f, cell, term, y, first, end_y, end_slope), length);
        evaluate(term, a.share, &added, &slope);
        const mask lost = a.hits & ~(size_of(y + cell->sign * added) <= noise);
        a.hits &= ~lost;
        a.careful |= lost;
    }
    a.slope = slope;
    a.q = choose(a.hits, cell->sign * cell->limit, term[0] + added);
    a.p = slope * load(g->cell_rate + at);
    return a;
}

/* Restitution of an impact at this speed of approach, for the contact that each lane hits. */
LANES_INLINE vector restitution_of(const vi_lane_group *g, int at, int contacts, mask hits, vector number,
                                   vector approach)
{
    vector restitution = all(0.0), yields = all(0.0);
    for (int c = 0; c < contacts; ++c) {
        const mask here = number == (double)(c + 1);
        restitution = choose(here, load(g->restitution[c] + at), restitution);
        yields = choose(here, load(g->yield_velocity[c] + at), yields);
    }
    const mask softer = hits & (yields > 0.0) & (approach > yields);
    if (any(softer)) {
        restitution = choose(softer, restitution / root(root(approach / yields)), restitution);
    }
    return restitution;
}

/* Rebound at the hit contacts; returns the lanes that leave lockstep. */
LANES_INLINE mask rebound(vi_lane_group *g, int at, int contacts, const candidate *cell, arrival *a)
{
    const vector approach = cell->sign * a->p;
    vector resolution = all(0.0);
    for (int c = 0; c < contacts; ++c) {
        resolution = choose(cell->number == (double)(c + 1), load(g->resolution[c] + at), resolution);
    }
    const vector restitution = restitution_of(g, at, contacts, a->hits, cell->number, approach);
    const vector after = restitution * approach;
    const vector fastest = larger(load(g->fastest_impact + at), only(a->hits, approach));
    const mask leaves = a->hits & ~((after > VI_LANE_TAIL * fastest) & (approach * approach > resolution));
    store(g->fastest_impact + at, fastest);
    store(g->hit + at, only(a->hits, cell->number));
    store(g->approach + at, only(a->hits, approach));
    a->p = choose(a->hits, -cell->sign * after, a->p);
    return leaves;
}

/* Move the clocks by whole cells, which are exact, and a part of a cell; clocks at the goal are set to it exactly. */
LANES_INLINE void move_clock(vi_lane_group *g, int at, vector cells, vector share, mask arrives)
{
    const vector length = load(g->cell + at), period = load(g->period + at);
    const vector rest = load(g->rest + at), whole = cells * length, part = share * length;
    const vector first = rest + whole, second = first + part;
    const vector error = error_of_sum(rest, whole, first) + error_of_sum(first, part, second);
    /* less than four periods: both subtractions are exact */
    const mask two = second >= 2.0 * period;
    const vector less = second - only(two, 2.0 * period);
    const mask one = less >= period;
    const vector left = less - only(one, period), turns = only(two, all(2.0)) + only(one, all(1.0));
    const vector low = (error + load(g->rest_low + at)) - turns * load(g->period_low + at);
    const vector after = left + low;
    store(g->rest + at, choose(arrives, load(g->goal_rest + at), after));
    store(g->rest_low + at, choose(arrives, load(g->goal_rest_low + at), low - (after - left)));
    store(g->periods + at, choose(arrives, load(g->goal_periods + at), load(g->periods + at) + turns));
}

/* Do one round of a vector of lanes; true when one of them has an event. */
LANES_INLINE bool one_round(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at, int contacts)
{
    flight f = begin_round(g, at);
    if (plan->rate > 0.0) {
        sample_from(g, at, f.now.q, f.now.p, f.now.cosine, f.now.sine);
    }
    vector term[VI_LANE_ORDER + 1];
    const candidate cell = choose_cell(g, at, contacts, &f);
    expand(g, at, &cell.start, term);
    arrival a = search(g, at, &f, &cell, term);
    const mask leaves = rebound(g, at, contacts, &cell, &a), moves = ~a.careful;
    const mask arrives = cell.goal & ~a.hits & moves, stays = a.careful & (cell.passed == 0.0);
    const vector impacts = load(g->impacts + at) + only(a.hits, all(1.0)), share = only(moves, a.share);
    const vector q = choose(moves, a.q, cell.start.q);
    const vector p = choose(moves, a.p, cell.start.p);
    store(g->start_q[0] + at, f.start.q);
    store(g->start_p[0] + at, f.start.p);
    store(g->start_cosine + at, f.start.cosine);
    store(g->start_sine + at, f.start.sine);
    store(g->jumped + at, f.jumped);
    store(g->hit_cells + at, choose(a.hits, f.jumped + cell.passed, load(g->hit_cells + at)));
    store(g->hit_share + at, choose(a.hits, a.share, load(g->hit_share + at)));
    store(g->passed + at, cell.passed);
    store(g->share + at, share);
    store(g->impacts + at, impacts);
    store(g->on + at, choose(a.hits, cell.number, only(stays, f.on)));
    move_clock(g, at, f.jumped + cell.passed, share, arrives);
    if (plan->rate > 0.0) {
        take_samples(g, plan, points, at);
    }
    const mask written = a.hits & ~leaves & (load(g->record.impacts + at) > 0.0);
    if (any(written)) {
        write_impacts(g, points, at, contacts, written);
    }
    store(g->q[0] + at, q);
    store(g->p[0] + at, p);
    vector event = only(a.hits & (impacts >= load(g->most_impacts + at)), all((double)VI_EVENT_IMPACT));
    event = choose(arrives, all((double)VI_EVENT_GOAL), event);
    event = choose(a.careful, all((double)VI_EVENT_CELL), event);
    event = choose(leaves, all((double)VI_EVENT_LEAVE), event);
    store(g->event + at, event);
    return any(event > 0.0);
}

/* Do rounds until a lane has an event. */
LANES_INLINE void run_rounds(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int contacts)
{
    const bool waits = some_wait(g);
    bool found = false;
    for (int i = 0; i < VI_MOST_ROUNDS && !found; ++i) {
        for (int at = 0; at < VI_LANES; at += VI_WIDTH) {
            if (waits) {
                note_start(g, at);
            }
            found |= one_round(g, plan, points, at, contacts);
        }
        if (waits) {
            note_rounds(g, plan, points);
        }
    }
}
