/* The lockstep of bodies of one mode with stops that yield, for one instruction set: see rounds_many.h.
 *
 * The motion of a lane is linear in each of its phases: free, or pressed into a stop. Each phase has tables of its own,
 * which are blended lane by lane. While a stop is pressed, q and p are the depth and its rate: no rounding of the stop's
 * position enters the contact.
 */
#include "lanes/rounds_samples.h"
#include "lanes/touch_down.h"
#include "lanes/yielding.h"

/* Limit of a stop that is not met while another one is pressed. */
#define NEVER 1e300
/* Most times in a row that a lane goes through all its cells in one round. */
enum { MOST_JUMPS_OF_PHASES = 3 };

/* State of the lanes of a vector in a round. */
typedef struct {
    vector q, p, cosine, sine, on;
    vector cell, rate;                /* length of a cell in the present phase, s; its reciprocal */
    vector to_goal, jumped;           /* cells */
    vector second, third, fourth, fifth; /* bounds of derivatives of q over VI_CELLS cells, times powers of the cell */
    mask pressed[VI_LANES_CONTACTS];  /* stop c is pressed */
    mask recedes[VI_LANES_CONTACTS];  /* the body is beyond the rest position of stop c, which it has left */
    /* an event at stop c: sign (q + lag q') - limit rises through 0, with q' over a cell */
    vector sign[VI_LANES_CONTACTS], limit[VI_LANES_CONTACTS], lag[VI_LANES_CONTACTS];
} phase_setting;

/* The cell in which a lane may have an event. */
typedef struct {
    vector passed, length;
    mask goal, searched, twofold;
    vector sign, limit, lag, number;
    vector q, p, cosine, sine; /* at its start */
} phase_cell;

/* Result of a round. */
typedef struct {
    vector share, q, p;
    mask hits, careful;
} phase_arrival;

/* A value for the phase of each lane. */
LANES_INLINE vector of_phase(const phase_setting *s, int contacts, const double *free, const double *first,
                             const double *second)
{
    const vector one = choose(s->pressed[0], load(first), load(free));
    return contacts < 2 ? one : choose(s->pressed[1], load(second), one);
}

/* A member of the tables of each lane's phase. */
#define OF_PHASE(member) \
    of_phase(s, contacts, g->one.member + at, g->yielding.pressed[0].member + at, g->yielding.pressed[1].member + at)

/* Value of a table's row for each lane's phase. */
#define ROW_OF_PHASE(row)                                                                                           \
    ((OF_PHASE(row[VI_OF_Q]) * state->q + OF_PHASE(row[VI_OF_P]) * state->p)                                        \
     + ((OF_PHASE(row[VI_OF_COSINE]) * state->cosine + OF_PHASE(row[VI_OF_SINE]) * state->sine)                     \
        + OF_PHASE(row[VI_OF_ONE])))

/* Set what can happen at each stop, from the present phase and displacement. */
LANES_INLINE void set_events(const vi_lane_group *g, int at, int contacts, phase_setting *s)
{
    mask any_pressed = s->pressed[0];
    for (int c = 1; c < contacts; ++c) {
        any_pressed |= s->pressed[c];
    }
    for (int c = 0; c < contacts; ++c) {
        const vector sign = load(g->sign[c] + at), limit = load(g->limit[c] + at);
        s->recedes[c] &= sign * s->q - limit > 0.0;
        s->sign[c] = choose(s->pressed[c], all(-1.0), only(~any_pressed, sign));
        s->limit[c] = only(~s->pressed[c], choose(any_pressed, all(NEVER), limit));
        s->lag[c] = only(s->pressed[c] | s->recedes[c], load(g->yielding.lag[c] + at) * s->rate);
    }
}

/* Bound the derivatives of q over the next VI_CELLS cells, as for rigid stops. */
LANES_INLINE void bound_phase(const vi_lane_group *g, int at, int contacts, phase_setting *s)
{
    const vector k = OF_PHASE(stiffness), loads = OF_PHASE(load), drag = OF_PHASE(drag);
    const vector w = load(g->angular_frequency + at), cell = s->cell, square = cell * cell;
    const vector norm = root(s->p * s->p + k * (s->q * s->q)) + loads * OF_PHASE(span);
    const vector second = loads + OF_PHASE(root_rate) * norm;
    const vector third = w * loads + (drag * second + k * norm);
    const vector fourth = w * (w * loads) + (drag * third + k * second);
    const vector fifth = w * (w * (w * loads)) + (drag * fourth + k * third);
    s->second = second * square;
    s->third = third * (square * cell);
    s->fourth = fourth * (square * square);
    s->fifth = fifth * (square * square * cell);
}

LANES_INLINE phase_setting begin_phase_round(const vi_lane_group *g, int at, int contacts)
{
    phase_setting s;
    const vector pressed = load(g->yielding.pressed_stop + at), receding = load(g->yielding.receding + at);
    s.q = load(g->q[0] + at);
    s.p = load(g->p[0] + at);
    s.on = load(g->on + at);
    s.cell = load(g->cell + at);
    s.rate = load(g->cell_rate + at);
    turn(load(g->angular_frequency + at) * load(g->rest + at), &s.cosine, &s.sine);
    s.to_goal = larger(seconds_to_goal(g, at) * s.rate, all(0.0));
    s.jumped = all(0.0);
    for (int c = 0; c < contacts; ++c) {
        s.pressed[c] = pressed == (double)(c + 1);
        s.recedes[c] = receding == (double)(c + 1);
    }
    set_events(g, at, contacts, &s);
    bound_phase(g, at, contacts, &s);
    return s;
}

/* Value of sign (q + lag q') - limit at stop c after some cells. */
LANES_INLINE vector event_after(const vi_lane_group *g, int at, int contacts, const phase_setting *s, int c, int cells)
{
    const vi_lane_array *free = g->one.end_q[cells], *receding = g->yielding.receding_end[c][cells];
    const vi_lane_array *pressed = g->yielding.pressed_end[c][cells];
    vector row[VI_PARTS];
    (void)contacts;
    for (int part = 0; part < VI_PARTS; ++part) {
        row[part] = choose(s->pressed[c], load(pressed[part] + at),
                           choose(s->recedes[c], load(receding[part] + at), load(free[part] + at)));
    }
    const vector sum = (row[VI_OF_Q] * s->q + row[VI_OF_P] * s->p)
                       + ((row[VI_OF_COSINE] * s->cosine + row[VI_OF_SINE] * s->sine) + row[VI_OF_ONE]);
    return s->sign[c] * sum - s->limit[c];
}

/* Count the cells in which each stop surely has no event. */
LANES_INLINE void scan_phase(const vi_lane_group *g, int at, int contacts, const phase_setting *s, vector count[])
{
    const phase_setting *state = s;
    const vector slope = s->p * s->cell, bend = 2.0 * ROW_OF_PHASE(taylor[2]);
    vector before[VI_LANES_CONTACTS], bulge[VI_LANES_CONTACTS];
    mask clear[VI_LANES_CONTACTS];
    for (int c = 0; c < contacts; ++c) {
        const mask here = s->on == (double)(c + 1);
        before[c] = only(~here, s->sign[c] * (s->q + s->lag[c] * slope) - s->limit[c]);
        bulge[c] = 0.125 * (s->second + s->lag[c] * s->third);
        count[c] = all(0.0);
        clear[c] = before[c] == before[c];
    }
#pragma GCC unroll 8
    for (int i = 1; i <= VI_CELLS; ++i) {
        for (int c = 0; c < contacts; ++c) {
            const vector y = event_after(g, at, contacts, s, c, i);
            mask passes = larger(before[c], y) + bulge[c] < 0.0;
            if (i == 1) {
                /* leaving: the mean rate since the start, which is smooth, stays negative */
                const vector leaving = s->sign[c] * (slope + s->lag[c] * bend);
                const vector third = s->third + s->lag[c] * s->fourth;
                passes |= (before[c] <= 0.0) & (larger(leaving, y - before[c]) + third * (1.0 / 24.0) < 0.0);
            }
            clear[c] &= passes;
            count[c] += only(clear[c], all(1.0));
            before[c] = y;
        }
    }
}

/* Rows of the tables of each lane's phase, chosen by each lane. */
LANES_INLINE void go_to_phase_cell(const vi_lane_group *g, int at, int contacts, const phase_setting *s, phase_cell *cell)
{
    vector q[VI_PARTS], p[VI_PARTS], c, n;
#pragma GCC unroll 8
    for (int i = 0; i < VI_WIDTH; ++i) {
        const int row = (int)cell->passed[i];
        const vi_one_mode *tables = s->pressed[0][i] ? &g->yielding.pressed[0] : &g->one;
        if (contacts > 1 && s->pressed[1][i]) {
            tables = &g->yielding.pressed[1];
        }
        for (int part = 0; part < VI_PARTS; ++part) {
            q[part][i] = tables->end_q[row][part][at + i];
            p[part][i] = tables->end_p[row][part][at + i];
        }
        c[i] = tables->turn_cosine[row][at + i];
        n[i] = tables->turn_sine[row][at + i];
    }
    cell->q = (q[VI_OF_Q] * s->q + q[VI_OF_P] * s->p)
              + ((q[VI_OF_COSINE] * s->cosine + q[VI_OF_SINE] * s->sine) + q[VI_OF_ONE]);
    cell->p = (p[VI_OF_Q] * s->q + p[VI_OF_P] * s->p)
              + ((p[VI_OF_COSINE] * s->cosine + p[VI_OF_SINE] * s->sine) + p[VI_OF_ONE]);
    cell->cosine = s->cosine * c - s->sine * n;
    cell->sine = s->sine * c + s->cosine * n;
}

/* Lanes that pass all their cells go on from there in the same round. */
LANES_INLINE void jump_phase(const vi_lane_group *g, int at, int contacts, mask jumps, phase_setting *s)
{
    const phase_setting *state = s;
    const vector c = OF_PHASE(turn_cosine[VI_CELLS]), n = OF_PHASE(turn_sine[VI_CELLS]);
    const vector next_q = ROW_OF_PHASE(end_q[VI_CELLS]), next_p = ROW_OF_PHASE(end_p[VI_CELLS]);
    const vector cosine = s->cosine * c - s->sine * n, sine = s->sine * c + s->cosine * n;
    s->q = choose(jumps, next_q, s->q);
    s->p = choose(jumps, next_p, s->p);
    s->cosine = choose(jumps, cosine, s->cosine);
    s->sine = choose(jumps, sine, s->sine);
    s->on = only(~jumps, s->on);
    s->jumped += only(jumps, all((double)VI_CELLS));
    s->to_goal -= only(jumps, all((double)VI_CELLS));
    set_events(g, at, contacts, s);
    bound_phase(g, at, contacts, s);
}

LANES_INLINE phase_cell choose_phase_cell(const vi_lane_group *g, int at, int contacts, phase_setting *s)
{
    phase_cell cell;
    vector count[VI_LANES_CONTACTS], cleared, length;
    mask jumps;
    for (int i = 0;; ++i) {
        READ_HERE();
        scan_phase(g, at, contacts, s, count);
        cleared = all((double)VI_CELLS);
        for (int c = 0; c < contacts; ++c) {
            cleared = smaller(count[c], cleared);
        }
        cell.passed = smaller(cleared, whole_part(smaller(s->to_goal, all((double)VI_CELLS))));
        jumps = cell.passed == (double)VI_CELLS;
        if (i == MOST_JUMPS_OF_PHASES || !any(jumps)) {
            break;
        }
        jump_phase(g, at, contacts, jumps, s);
    }
    length = larger(s->to_goal - cell.passed, all(0.0));
    cell.length = only(~jumps, smaller(length, all(1.0)));
    cell.goal = ~jumps & (length <= 1.0);
    cell.searched = ~jumps & (cleared == cell.passed);
    cell.twofold = cell.searched & ~cell.searched;
    cell.sign = cell.limit = cell.lag = cell.number = all(0.0);
    for (int c = contacts - 1; c >= 0; --c) {
        const mask met = cell.searched & (count[c] == cell.passed);
        cell.twofold |= met & (cell.number > 0.0);
        cell.sign = choose(met, s->sign[c], cell.sign);
        cell.limit = choose(met, s->limit[c], cell.limit);
        cell.lag = choose(met, s->lag[c], cell.lag);
        cell.number = choose(met, all((double)(c + 1)), cell.number);
    }
    go_to_phase_cell(g, at, contacts, s, &cell);
    return cell;
}

/* One step towards the zero of y + sign * (added value of the polynomial), of third order (Chebyshev's). */
LANES_INLINE vector closer(const vector term[], vector y, vector sign, vector share)
{
    vector added, slope;
    evaluate(term, VI_LANE_ORDER, share, &added, &slope);
    const vector bend = half_bend(term, VI_LANE_ORDER, share);
    const vector inverse = 1.0 / slope, step = (sign * y + added) * inverse;
    return share - step * (1.0 + step * (bend * inverse));
}

/* Taylor coefficients of q over the cell, in its share, and of sign (q + lag q') without its limit. */
LANES_INLINE void expand_phase(const vi_lane_group *g, int at, int contacts, const phase_setting *s,
                               const phase_cell *state, vector term[], vector event[])
{
    term[0] = state->q;
    term[1] = state->p * s->cell;
#pragma GCC unroll 16
    for (int n = 2; n <= VI_LANE_ORDER; ++n) {
        term[n] = ROW_OF_PHASE(taylor[n]);
    }
#pragma GCC unroll 16
    for (int n = 0; n < VI_LANE_ORDER; ++n) {
        event[n] = state->sign * (term[n] + state->lag * ((double)(n + 1) * term[n + 1]));
    }
    event[VI_LANE_ORDER] = state->sign * term[VI_LANE_ORDER];
}

LANES_INLINE phase_arrival search_phase(const vi_lane_group *g, int at, int contacts, const phase_setting *s,
                                        const phase_cell *cell)
{
    vector term[VI_LANE_ORDER + 1], event[VI_LANE_ORDER + 1], added, slope;
    expand_phase(g, at, contacts, s, cell, term, event);
    evaluate(event, VI_LANE_ORDER, cell->length, &added, &slope);
    const vector length = cell->length;
    const mask leaves = (cell->passed == 0.0) & (s->on == cell->number);
    const vector y = only(~leaves, event[0] - cell->limit), first = event[1], end_y = y + added;
    const vector noise = ROUNDING * ((size_of(cell->limit) + size_of(cell->q) + size_of(term[1]))
                                     + (cell->lag * size_of(term[1]) + size_of(added)));
    const vector second = s->second + cell->lag * s->third, third = s->third + cell->lag * s->fourth;
    const vector fourth = s->fourth + cell->lag * s->fifth;
    const mask rises = (smaller(first, slope) > 0.125 * third * (length * length)) & (y <= noise);
    /* Bernstein coefficients of the cubic with these values and slopes, and the deviation from the cubic */
    const vector part = length * (1.0 / 3.0);
    const vector highest = larger(larger(y, end_y), larger(y + part * first, end_y - part * slope));
    const mask below = highest + fourth * (1.0 / 384.0) < 0.0;
    phase_arrival a;
    a.hits = cell->searched & ~cell->twofold & rises & (end_y > 0.0);
    a.careful = cell->searched & ~a.hits & (cell->twofold | ~(below | (rises & (end_y <= 0.0))));
    a.share = length;
    if (any(a.hits)) {
        vector share = first_guess(y, first, end_y, slope, length);
        for (int i = 0; i < 2; ++i) {
            share = smaller(larger(closer(event, y, all(1.0), share), all(0.0)), length);
        }
        a.share = choose(a.hits, share, length);
        evaluate(event, VI_LANE_ORDER, a.share, &added, &slope);
        /* rounding would decide whether a graze is an event: its extreme is within the noise */
        const mask lost = a.hits & ~((size_of(y + added) <= noise) & (slope * slope > 2.0 * second * noise));
        a.hits &= ~lost;
        a.careful |= lost;
    }
    evaluate(term, VI_LANE_ORDER, a.share, &added, &slope);
    a.q = cell->q + added;
    a.p = slope * s->rate;
    return a;
}

/* Turn the velocity at the rigid stops that are hit; returns the lanes that leave lockstep. */
LANES_INLINE mask bounce(vi_lane_group *g, int at, int contacts, const phase_cell *cell, mask hits, phase_arrival *a)
{
    const vector approach = cell->sign * a->p;
    vector restitution = all(0.0), yields = all(0.0);
    for (int c = 0; c < contacts; ++c) {
        const mask here = cell->number == (double)(c + 1);
        restitution = choose(here, load(g->restitution[c] + at), restitution);
        yields = choose(here, load(g->yield_velocity[c] + at), yields);
    }
    const mask softer = hits & (yields > 0.0) & (approach > yields);
    if (any(softer)) {
        restitution = choose(softer, restitution / root(root(approach / yields)), restitution);
    }
    const vector after = restitution * approach;
    const vector fastest = larger(load(g->fastest_impact + at), only(hits, approach));
    store(g->fastest_impact + at, fastest);
    a->p = choose(hits, -cell->sign * after, a->p);
    return hits & ~(after > VI_LANE_TAIL * fastest);
}

/* Change the phase of the lanes with an event; returns the lanes that leave lockstep. */
LANES_INLINE mask change_phase(vi_lane_group *g, int at, int contacts, const phase_setting *s, const phase_cell *cell,
                               phase_arrival *a)
{
    vi_yielding *yielding = &g->yielding;
    const mask none = a->hits & ~a->hits;
    vector side = all(0.0), limit = all(0.0);
    mask yields = none, pressed = none, recedes = none;
    for (int c = 0; c < contacts; ++c) {
        const mask here = cell->number == (double)(c + 1);
        side = choose(here, load(g->sign[c] + at), side);
        limit = choose(here, load(g->limit[c] + at), limit);
        yields |= here & (load(yielding->yields[c] + at) > 0.0);
        pressed |= s->pressed[c];
        recedes |= here & s->recedes[c];
    }
    const mask parts = a->hits & pressed, back = a->hits & recedes, meets = a->hits & ~(pressed | recedes);
    const mask touches = meets & yields, bounces = meets & ~yields;
    const vector approach = side * a->p, outside = side * (limit + larger(a->q, all(0.0)));
    mask leaves = bounce(g, at, contacts, cell, bounces, a) | (back & ~(approach > 0.0));
    store(g->hit + at, only(meets | parts, cell->number));
    store(g->approach + at, choose(parts, a->p, only(meets, approach)));
    store(yielding->depth + at, only(parts, a->q));
    a->q = choose(touches, all(0.0), choose(bounces, side * limit, choose(parts, outside, a->q)));
    a->p = choose(touches, approach, choose(parts, side * a->p, a->p));
    const vector now = choose(touches, cell->number, only(~parts, load(yielding->pressed_stop + at)));
    const vector cells = only(pressed, (load(yielding->cells_pressed + at) + s->jumped) + cell->passed);
    leaves |= cells > load(yielding->most_pressed + at);
    vector away = all(0.0);
    for (int c = 0; c < contacts; ++c) {
        away = choose(s->recedes[c] & ~back, all((double)(c + 1)), away);
    }
    store(yielding->start_pressed + at, load(yielding->pressed_stop + at));
    store(yielding->pressed_stop + at, now);
    store(yielding->receding + at, choose(parts, cell->number, away));
    store(yielding->cells_pressed + at, only(~parts, cells));
    const mask stays = a->careful & (cell->passed == 0.0);
    const vector on = choose(bounces | parts, cell->number, only(stays & ~a->hits, s->on));
    store(g->on + at, on);
    store(g->impacts + at, load(g->impacts + at) + only(meets, all(1.0)));
    a->hits = meets | parts;
    return leaves;
}

/* Set the length of a cell in the phase that begins; the clock has moved by the old length. */
LANES_INLINE void set_cells(vi_lane_group *g, int at, int contacts)
{
    const vi_yielding *yielding = &g->yielding;
    vector cell = load(yielding->cell[0] + at), rate = load(yielding->cell_rate[0] + at);
    for (int c = 1; c <= contacts; ++c) {
        const mask here = load(yielding->pressed_stop + at) == (double)c;
        cell = choose(here, load(yielding->cell[c] + at), cell);
        rate = choose(here, load(yielding->cell_rate[c] + at), rate);
    }
    store(g->cell + at, cell);
    store(g->cell_rate + at, rate);
}

/* Note the contacts that begin, and write those that end, where they are recorded. */
LANES_INLINE void record_contacts(vi_lane_group *g, vi_lanes_points *points, int at, int contacts, mask bounces,
                                  mask touches, mask parts)
{
    const mask records = load(g->record.impacts + at) > 0.0;
    if (any(bounces & records)) {
        write_impacts(g, points, at, contacts, bounces & records);
    }
    if (any(touches & records)) {
        note_touch_downs(g, at, touches & records);
    }
    parts &= load(g->yielding.open + at) > 0.0;
    for (int i = 0; i < VI_WIDTH; ++i) {
        if (parts[i]) {
            vi_yielding_write(g, points, at + i);
        }
    }
}

/* Turn the periods of lanes at their goals. Returns these lanes, whose goal is now the end of the next period. */
LANES_INLINE mask turn_phase_periods(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at,
                                     int contacts, mask arrives)
{
    const vector goal = load(g->goal_periods + at), last = load(g->record.last_turn + at);
    const mask turns = arrives & (goal < last) & (load(g->record.doubtful + at) == 0.0);
    if (!any(turns)) {
        return turns;
    }
    const vector state = load(g->q[0] + at), rate = load(g->p[0] + at), pressed = load(g->yielding.pressed_stop + at);
    vector q = state, p = rate;
    for (int c = 0; c < contacts; ++c) {
        const vector sign = load(g->sign[c] + at), limit = load(g->limit[c] + at);
        const mask here = pressed == (double)(c + 1), rigid = turns & (load(g->yielding.yields[c] + at) == 0.0);
        q = choose(here, sign * (limit + state), choose(rigid & (sign * q > limit), sign * limit, q));
        p = choose(here, sign * rate, p);
    }
    store(g->q[0] + at, choose(pressed > 0.0, state, q));
    end_periods(g, plan, points, at, turns);
    begin_periods(g, at, turns, q, p);
    store(g->goal_periods + at, goal + only(turns, all(1.0)));
    return turns;
}

/* Do one round of a vector of lanes; true when one of them has an event. */
LANES_INLINE bool one_phase_round(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at,
                                  int contacts)
{
    phase_setting s = begin_phase_round(g, at, contacts);
    store(g->start_q[0] + at, s.q);
    store(g->start_p[0] + at, s.p);
    store(g->start_cosine + at, s.cosine);
    store(g->start_sine + at, s.sine);
    if (plan->rate > 0.0) {
        sample_from(g, at, s.q, s.p, s.cosine, s.sine);
    }
    const phase_cell cell = choose_phase_cell(g, at, contacts, &s);
    phase_arrival a = search_phase(g, at, contacts, &s, &cell);
    const mask moves = ~a.careful, arrives = cell.goal & ~a.hits & moves;
    const mask pressed = load(g->yielding.pressed_stop + at) > 0.0;
    const vector share = only(moves, a.share);
    a.q = choose(moves, a.q, cell.q);
    a.p = choose(moves, a.p, cell.p);
    const mask leaves = change_phase(g, at, contacts, &s, &cell, &a);
    const mask touches = a.hits & ~pressed & (load(g->yielding.pressed_stop + at) > 0.0), kept = ~leaves;
    store(g->jumped + at, s.jumped);
    store(g->passed + at, cell.passed);
    store(g->share + at, share);
    store(g->q[0] + at, a.q);
    store(g->p[0] + at, a.p);
    move_clock(g, at, s.jumped + cell.passed, share, arrives);
    if (plan->rate > 0.0) {
        take_samples(g, plan, points, at);
    }
    set_cells(g, at, contacts);
    store(g->record.doubtful + at, load(g->record.extremes + at));
    record_contacts(g, points, at, contacts, a.hits & ~pressed & ~touches & kept, touches & kept, a.hits & pressed & kept);
    const mask turns = turn_phase_periods(g, plan, points, at, contacts, arrives & kept);
    const mask over = a.hits & ~pressed & (load(g->impacts + at) >= load(g->most_impacts + at));
    vector event = only(load(g->record.doubtful + at) > 0.0, all((double)VI_EVENT_FLIGHT));
    event = choose(over, all((double)VI_EVENT_IMPACT), event);
    event = choose(arrives & ~turns, all((double)VI_EVENT_GOAL), event);
    event = choose(a.careful, all((double)VI_EVENT_CELL), event);
    event = choose(leaves, all((double)VI_EVENT_LEAVE), event);
    store(g->event + at, event);
    return any(event > 0.0);
}

LANES_INLINE void run_phase_rounds(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int contacts)
{
    bool found = false;
    for (int i = 0; i < VI_MOST_ROUNDS && !found; ++i) {
        for (int at = 0; at < VI_LANES; at += VI_WIDTH) {
            found |= one_phase_round(g, plan, points, at, contacts);
        }
    }
}
