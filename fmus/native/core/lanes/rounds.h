/* The lockstep of bodies of one mode, for one instruction set: see rounds_many.h. */
#include "lanes/recording.h"
#include "lanes/rounds_samples.h"

/* Most times that a lane goes through all its cells in one round. */
enum { MOST_JUMPS = 3 };

/* Rounding of a displacement, in units of the sum of the sizes of its terms. */
#define ROUNDING (16.0 * 2.220446049250313e-16)

/* State of the lanes of a vector at the start of a round. */
typedef struct {
    vector q, p, cosine, sine, on;
    vector to_goal;             /* cells */
    vector jumped;              /* whole cells already passed in the round */
    vector second, third, fourth; /* bounds of derivatives of q over VI_CELLS cells, times powers of the cell */
} setting;

/* The cell in which a lane may meet a contact or its goal. */
typedef struct {
    vector passed;        /* whole cells before it */
    vector length;        /* share of it up to the goal or its end */
    mask goal;            /* its end is the goal */
    mask searched;        /* a contact may be met in it */
    mask twofold;         /* two contacts may be met in it */
    vector sign, limit;   /* of the contact */
    vector number;        /* from 1 */
    vector q, p, cosine, sine; /* at its start */
} candidate;

/* Bound the derivatives of q over the next VI_CELLS cells. */
LANES_INLINE void bound(const vi_lane_group *g, int at, setting *s)
{
    /* the energy norm grows at most by the loads; the derivatives follow from the equation */
    const vector k = load(g->one.stiffness + at), loads = load(g->one.load + at), drag = load(g->one.drag + at);
    const vector w = load(g->angular_frequency + at), cell = load(g->cell + at), square = cell * cell;
    const vector norm = root(s->p * s->p + k * (s->q * s->q)) + loads * load(g->one.span + at);
    const vector second = loads + load(g->one.root_rate + at) * norm;
    const vector third = w * loads + (drag * second + k * norm);
    const vector fourth = w * (w * loads) + (drag * third + k * second);
    s->second = second * square;
    s->third = third * (square * cell);
    s->fourth = fourth * (square * square);
}

/* Time to the goal, s. */
LANES_INLINE vector seconds_to_goal(const vi_lane_group *g, int at)
{
    const vector whole = load(g->goal_periods + at) - load(g->periods + at);
    const vector high = whole * load(g->period + at) + (load(g->goal_rest + at) - load(g->rest + at));
    const vector low = whole * load(g->period_low + at) + (load(g->goal_rest_low + at) - load(g->rest_low + at));
    return high + low;
}

LANES_INLINE setting begin_round(const vi_lane_group *g, int at)
{
    setting s;
    s.q = load(g->q[0] + at);
    s.p = load(g->p[0] + at);
    s.on = load(g->on + at);
    turn(load(g->angular_frequency + at) * load(g->rest + at), &s.cosine, &s.sine);
    s.to_goal = larger(seconds_to_goal(g, at) * load(g->cell_rate + at), all(0.0));
    s.jumped = all(0.0);
    bound(g, at, &s);
    return s;
}

/* Count the cells in which each contact is surely not met. */
LANES_INLINE void scan(const vi_lane_group *g, int at, int contacts, const setting *s, vector count[])
{
    vector before[VI_LANES_CONTACTS], sign[VI_LANES_CONTACTS], limit[VI_LANES_CONTACTS];
    mask clear[VI_LANES_CONTACTS];
    const vector bulge = 0.125 * s->second;
    for (int c = 0; c < contacts; ++c) {
        sign[c] = load(g->sign[c] + at);
        limit[c] = load(g->limit[c] + at);
        before[c] = sign[c] * s->q - limit[c];
        count[c] = all(0.0);
        clear[c] = before[c] == before[c];
    }
#pragma GCC unroll 8
    for (int i = 1; i <= VI_CELLS; ++i) {
        const vi_lane_array *table = g->one.end_q[i];
        const vector q = (load(table[VI_OF_Q] + at) * s->q + load(table[VI_OF_P] + at) * s->p)
                         + ((load(table[VI_OF_COSINE] + at) * s->cosine + load(table[VI_OF_SINE] + at) * s->sine)
                            + load(table[VI_OF_ONE] + at));
        for (int c = 0; c < contacts; ++c) {
            const vector y = sign[c] * q - limit[c];
            mask passes = larger(before[c], y) + bulge < 0.0;
            if (i == 1) {
                /* just left: the mean velocity since then, which is smooth, stays negative */
                const vector leaving = sign[c] * (s->p * load(g->cell + at));
                const mask left = larger(leaving, y) + s->third * (1.0 / 24.0) < 0.0;
                const mask here = s->on == (double)(c + 1);
                passes = (passes & ~here) | (left & here);
            }
            clear[c] &= passes;
            count[c] += only(clear[c], all(1.0));
            before[c] = y;
        }
    }
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

LANES_INLINE void go_to_cell(const vi_lane_group *g, int at, const setting *s, candidate *cell)
{
    int row[VI_WIDTH];
#pragma GCC unroll 8
    for (int i = 0; i < VI_WIDTH; ++i) {
        row[i] = (int)cell->passed[i];
    }
    const vi_lane_array *q = g->one.end_q[0], *p = g->one.end_p[0];
    cell->q = (gather(q + VI_OF_Q, VI_PARTS, at, row) * s->q + gather(q + VI_OF_P, VI_PARTS, at, row) * s->p)
              + ((gather(q + VI_OF_COSINE, VI_PARTS, at, row) * s->cosine
                  + gather(q + VI_OF_SINE, VI_PARTS, at, row) * s->sine)
                 + gather(q + VI_OF_ONE, VI_PARTS, at, row));
    cell->p = (gather(p + VI_OF_Q, VI_PARTS, at, row) * s->q + gather(p + VI_OF_P, VI_PARTS, at, row) * s->p)
              + ((gather(p + VI_OF_COSINE, VI_PARTS, at, row) * s->cosine
                  + gather(p + VI_OF_SINE, VI_PARTS, at, row) * s->sine)
                 + gather(p + VI_OF_ONE, VI_PARTS, at, row));
    const vector c = gather(g->one.turn_cosine, 1, at, row), n = gather(g->one.turn_sine, 1, at, row);
    cell->cosine = s->cosine * c - s->sine * n;
    cell->sine = s->sine * c + s->cosine * n;
}

/* Whole cells that a lane surely passes: no contact in them, and not beyond the goal. */
LANES_INLINE vector sure_cells(const setting *s, int contacts, const vector count[], vector *cleared)
{
    *cleared = all((double)VI_CELLS);
    for (int c = 0; c < contacts; ++c) {
        *cleared = smaller(count[c], *cleared);
    }
    return smaller(*cleared, whole_part(smaller(s->to_goal, all((double)VI_CELLS))));
}

/* Lanes that pass all their cells go on from there in the same round. */
LANES_INLINE void jump(const vi_lane_group *g, int at, mask jumps, setting *s)
{
    const vi_lane_array *q = g->one.end_q[VI_CELLS], *p = g->one.end_p[VI_CELLS];
    const vector c = load(g->one.turn_cosine[VI_CELLS] + at), n = load(g->one.turn_sine[VI_CELLS] + at);
    const vector next_q = (load(q[VI_OF_Q] + at) * s->q + load(q[VI_OF_P] + at) * s->p)
                          + ((load(q[VI_OF_COSINE] + at) * s->cosine + load(q[VI_OF_SINE] + at) * s->sine)
                             + load(q[VI_OF_ONE] + at));
    const vector next_p = (load(p[VI_OF_Q] + at) * s->q + load(p[VI_OF_P] + at) * s->p)
                          + ((load(p[VI_OF_COSINE] + at) * s->cosine + load(p[VI_OF_SINE] + at) * s->sine)
                             + load(p[VI_OF_ONE] + at));
    const vector cosine = s->cosine * c - s->sine * n, sine = s->sine * c + s->cosine * n;
    s->q = choose(jumps, next_q, s->q);
    s->p = choose(jumps, next_p, s->p);
    s->cosine = choose(jumps, cosine, s->cosine);
    s->sine = choose(jumps, sine, s->sine);
    s->on = only(~jumps, s->on);
    s->jumped += only(jumps, all((double)VI_CELLS));
    s->to_goal -= only(jumps, all((double)VI_CELLS));
    bound(g, at, s);
}

LANES_INLINE candidate choose_cell(const vi_lane_group *g, int at, int contacts, setting *s)
{
    candidate cell;
    vector count[VI_LANES_CONTACTS], cleared;
    const mask alone = load(g->record.extremes + at) == 0.0;
    for (int i = 0;; ++i) {
        scan(g, at, contacts, s, count);
        cell.passed = sure_cells(s, contacts, count, &cleared);
        const mask jumps = alone & (cell.passed == (double)VI_CELLS);
        if (i == MOST_JUMPS || !any(jumps)) {
            break;
        }
        jump(g, at, jumps, s);
    }
    const mask jumps = cell.passed == (double)VI_CELLS;
    const vector length = larger(s->to_goal - cell.passed, all(0.0));
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
    go_to_cell(g, at, s, &cell);
    return cell;
}

/* Taylor coefficients of q over the cell, in its share. */
LANES_INLINE void expand(const vi_lane_group *g, int at, const candidate *cell, vector term[])
{
    term[0] = cell->q;
    term[1] = cell->p * load(g->cell + at);
#pragma GCC unroll 16
    for (int n = 2; n <= VI_LANE_ORDER; ++n) {
        const vi_lane_array *table = g->one.taylor[n];
        term[n] = (load(table[VI_OF_Q] + at) * cell->q + load(table[VI_OF_P] + at) * cell->p)
                  + ((load(table[VI_OF_COSINE] + at) * cell->cosine + load(table[VI_OF_SINE] + at) * cell->sine)
                     + load(table[VI_OF_ONE] + at));
    }
}

/* Added value of the polynomial beyond its first term, and its slope, at a share of the cell. Odd and even powers are
 * summed apart, which halves the chain of operations. */
LANES_INLINE void follow(const vector term[], vector share, vector *added, vector *slope)
{
    const vector square = share * share;
    vector odd = term[VI_LANE_ORDER - 1], odd_slope = (double)(VI_LANE_ORDER - 1) * odd;
    vector even = term[VI_LANE_ORDER], even_slope = (double)VI_LANE_ORDER * even;
#pragma GCC unroll 16
    for (int n = VI_LANE_ORDER - 3; n >= 1; n -= 2) {
        odd = odd * square + term[n];
        odd_slope = odd_slope * square + (double)n * term[n];
        even = even * square + term[n + 1];
        even_slope = even_slope * square + (double)(n + 1) * term[n + 1];
    }
    *added = share * (odd + share * even);
    *slope = odd_slope + share * even_slope;
}

/* One step towards the zero of y + sign * (added value of the polynomial), of third order (Chebyshev's). */
LANES_INLINE vector closer(const vector term[], vector y, vector sign, vector share)
{
    const int last = VI_LANE_ORDER;
    const vector square = share * share;
    vector added, slope, odd = (double)((last - 1) * (last - 2) / 2) * term[last - 1];
    vector even = (double)(last * (last - 1) / 2) * term[last];
#pragma GCC unroll 16
    for (int n = last - 3; n >= 3; n -= 2) {
        odd = odd * square + (double)(n * (n - 1) / 2) * term[n];
        even = even * square + (double)((n + 1) * n / 2) * term[n + 1];
    }
    follow(term, share, &added, &slope);
    const vector bend = (even * square + term[2]) + share * odd; /* half the second derivative */
    const vector inverse = 1.0 / slope, step = (sign * y + added) * inverse;
    return share - step * (1.0 + step * (bend * inverse));
}

/* First guess of the contact: the zero of the inverse of a rising cubic. */
LANES_INLINE vector first_guess(vector y, vector slope, vector end_y, vector end_slope, vector length)
{
    const vector rise = end_y - y, t = -y / rise, back = 1.0 - t;
    /* slopes of the inverse at both ends; a line has 1 */
    const vector inverse = rise / (length * (slope * end_slope));
    const vector x = t + t * back * ((inverse * end_slope - 1.0) * back - (inverse * slope - 1.0) * t);
    return length * smaller(larger(x, all(0.0)), all(1.0));
}

/* Result of a round for the lanes. */
typedef struct {
    vector share; /* passed share of the cell */
    vector q, p;
    mask hits, careful;
} arrival;

LANES_INLINE arrival search(const vi_lane_group *g, int at, const setting *s, const candidate *cell)
{
    vector term[VI_LANE_ORDER + 1], added, slope;
    expand(g, at, cell, term);
    follow(term, cell->length, &added, &slope);
    const vector length = cell->length, bare = cell->sign * cell->q - cell->limit;
    const mask leaves = (cell->passed == 0.0) & (s->on == cell->number);
    const vector y = only(~leaves, bare), first = cell->sign * term[1];
    const vector end_y = y + cell->sign * added, end_slope = cell->sign * slope;
    const vector noise = ROUNDING * (size_of(cell->limit) + size_of(cell->q) + size_of(term[1]) + size_of(added));
    const mask rises = (smaller(first, end_slope) > 0.125 * s->third * (length * length)) & (y <= noise);
    /* Bernstein coefficients of the cubic with these values and slopes, and the deviation from the cubic */
    const vector third = length * (1.0 / 3.0);
    const vector highest = larger(larger(y, end_y), larger(y + third * first, end_y - third * end_slope));
    const mask below = highest + s->fourth * (1.0 / 384.0) < 0.0;
    arrival a;
    a.hits = cell->searched & ~cell->twofold & rises & (end_y > 0.0);
    a.careful = cell->searched & ~a.hits & (cell->twofold | ~(below | (rises & (end_y <= 0.0))));
    a.share = length;
    if (any(a.hits)) {
        vector share = first_guess(y, first, end_y, end_slope, length);
        for (int i = 0; i < 2; ++i) {
            share = smaller(larger(closer(term, y, cell->sign, share), all(0.0)), length);
        }
        a.share = choose(a.hits, share, length);
        follow(term, a.share, &added, &slope);
        const mask lost = a.hits & ~(size_of(y + cell->sign * added) <= noise);
        a.hits &= ~lost;
        a.careful |= lost;
    }
    a.q = choose(a.hits, cell->sign * cell->limit, cell->q + added);
    a.p = slope * load(g->cell_rate + at);
    return a;
}

/* Rebound at the hit contacts; returns the lanes that leave lockstep. */
LANES_INLINE mask rebound(vi_lane_group *g, int at, int contacts, const candidate *cell, arrival *a)
{
    const vector approach = cell->sign * a->p;
    vector restitution = all(0.0), yields = all(0.0), resolution = all(0.0);
    for (int c = 0; c < contacts; ++c) {
        const mask here = cell->number == (double)(c + 1);
        restitution = choose(here, load(g->restitution[c] + at), restitution);
        yields = choose(here, load(g->yield_velocity[c] + at), yields);
        resolution = choose(here, load(g->resolution[c] + at), resolution);
    }
    const mask softer = a->hits & (yields > 0.0) & (approach > yields);
    if (any(softer)) {
        restitution = choose(softer, restitution / root(root(approach / yields)), restitution);
    }
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

/* Turn the periods of lanes at their goals. Returns these lanes, whose goal is now the end of the next period. */
LANES_INLINE mask turn_periods(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at, int contacts,
                               mask arrives)
{
    const vector goal = load(g->goal_periods + at), last = load(g->record.last_turn + at);
    const mask turns = arrives & (goal < last) & (load(g->record.doubtful + at) == 0.0);
    if (!any(turns)) {
        return turns;
    }
    vector q = load(g->q[0] + at);
    for (int c = 0; c < contacts; ++c) { /* beyond a stop by rounding: put on it */
        const vector sign = load(g->sign[c] + at), limit = load(g->limit[c] + at);
        q = choose(turns & (sign * q > limit), sign * limit, q);
    }
    store(g->q[0] + at, q);
    end_periods(g, plan, points, at, turns);
    begin_periods(g, at, turns, q, load(g->p[0] + at));
    store(g->goal_periods + at, goal + only(turns, all(1.0)));
    return turns;
}

/* Do one round of a vector of lanes; true when one of them has an event. */
LANES_INLINE bool one_round(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at, int contacts)
{
    setting s = begin_round(g, at);
    if (plan->rate > 0.0) {
        sample_from(g, at, s.q, s.p, s.cosine, s.sine);
    }
    const candidate cell = choose_cell(g, at, contacts, &s);
    arrival a = search(g, at, &s, &cell);
    const mask leaves = rebound(g, at, contacts, &cell, &a), moves = ~a.careful;
    const mask arrives = cell.goal & ~a.hits & moves, stays = a.careful & (cell.passed == 0.0);
    const vector impacts = load(g->impacts + at) + only(a.hits, all(1.0)), share = only(moves, a.share);
    store(g->start_q[0] + at, s.q);
    store(g->start_p[0] + at, s.p);
    store(g->start_cosine + at, s.cosine);
    store(g->start_sine + at, s.sine);
    store(g->passed + at, cell.passed);
    store(g->share + at, share);
    store(g->impacts + at, impacts);
    store(g->q[0] + at, choose(moves, a.q, cell.q));
    store(g->p[0] + at, choose(moves, a.p, cell.p));
    store(g->on + at, choose(a.hits, cell.number, only(stays, s.on)));
    move_clock(g, at, s.jumped + cell.passed, share, arrives);
    if (plan->rate > 0.0) {
        take_samples(g, plan, points, at);
    }
    store(g->record.doubtful + at, load(g->record.extremes + at));
    const mask written = a.hits & ~leaves & (load(g->record.impacts + at) > 0.0);
    if (any(written)) {
        write_impacts(g, points, at, contacts, written);
    }
    const mask turns = turn_periods(g, plan, points, at, contacts, arrives);
    vector event = only(load(g->record.doubtful + at) > 0.0, all((double)VI_EVENT_FLIGHT));
    event = choose(a.hits & (impacts >= load(g->most_impacts + at)), all((double)VI_EVENT_IMPACT), event);
    event = choose(arrives & ~turns, all((double)VI_EVENT_GOAL), event);
    event = choose(a.careful, all((double)VI_EVENT_CELL), event);
    event = choose(leaves, all((double)VI_EVENT_LEAVE), event);
    store(g->event + at, event);
    return any(event > 0.0);
}

LANES_INLINE void run_rounds(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int contacts)
{
    bool found = false;
    for (int i = 0; i < VI_MOST_ROUNDS && !found; ++i) {
        for (int at = 0; at < VI_LANES; at += VI_WIDTH) {
            found |= one_round(g, plan, points, at, contacts);
        }
    }
}
