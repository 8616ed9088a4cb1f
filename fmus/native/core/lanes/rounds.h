/* The lockstep of bodies of one mode, for one instruction set: see rounds_many.h. */
#include "lanes/pair_search.h"
#include "lanes/rounds_samples.h"
#include "lanes/waiting.h"

/* Rounding of a displacement, in units of the sum of the sizes of its terms. */
#define ROUNDING (16.0 * 2.220446049250313e-16)

/* Shortest return to a stop, in pairs, that is found from the middle of a pair. A rounding of q there would count in the
 * small speeds of shorter ones: these are found lane by lane, from their start. */
#define SHORTEST_RETURN 0.125
/* Most times in a row that a lane goes through all its pairs in one round. */
enum { MOST_JUMPS = 1 };
/* Most parts of a pair that are judged, each half as long as an undecided one. */
enum { MOST_PARTS = 8 };

/* The pair of cells in which a lane may meet a contact or its goal. */
typedef struct {
    vector passed;        /* whole pairs before it */
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
    f.to_goal = larger(seconds_to_goal(g, at) * pair_rate(g, at), all(0.0));
    f.jumped = all(0.0);
    bound(g, at, &f);
    return f;
}

/* Displacements at the ends of the pairs ahead. `of`: phases of the further sines. */
LANES_INLINE void ends_of_pairs(const vi_lane_group *g, int at, int further, const flight *f, const phases *of,
                                vector q[])
{
    q[0] = f->now.q;
#pragma GCC unroll 9
    for (int i = 1; i <= VI_PAIRS; ++i) {
        q[i] = linear(g->one.end_q[2 * i], at, &f->now);
        if (further) {
            add_sines(g->sines->end_q[2 * i], at, further, of, q + i);
        }
    }
}

/* Count the pairs in which a contact is surely not met. q[]: at the ends of the pairs; bend: q'' now, over a pair.
 *
 * The motion exceeds the line over a pair by at most an eighth of its largest -y''. Second differences give y'' at the
 * ends of pairs to a twelfth of the fourth derivative. Between them y'' is off a line by an eighth of it.
 * The difference at the end of the last near pair reaches into the next pair. */
LANES_INLINE vector count_clear(const vi_lane_group *g, int at, int c, const flight *f, const vector q[], vector bend)
{
    const vector sign = load(g->sign[c] + at), limit = load(g->limit[c] + at);
    const vector error[2] = {f->fourth[0] * (1.0 / 12.0 + 1.0 / 8.0), f->fourth[1] * (1.0 / 12.0 + 1.0 / 8.0)};
    const vector none = all(0.0);
    vector before = sign * q[0] - limit, here = sign * q[1] - limit, curve = sign * bend;
    mask clear = before == before, counted = (mask)all(WHOLE);
#pragma GCC unroll 9
    for (int i = 1; i <= VI_PAIRS; ++i) {
        vector next = here, end_curve = curve - f->third[1];
        if (i < VI_PAIRS) {
            next = sign * q[i + 1] - limit;
            end_curve = (next - here) - (here - before);
        }
        mask passes = larger(before, here) < 0.125 * smaller(smaller(curve, end_curve) - error[i >= VI_NEAR_PAIRS], none);
        if (i == 1) {
            /* just left: the mean velocity since then, which is smooth, stays negative */
            const vector leaving = sign * (f->now.p * pair_of(g, at));
            const mask left = larger(leaving, here) + f->third[0] * (1.0 / 24.0) < 0.0, on = f->on == (double)(c + 1);
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

/* Whole pairs that a lane surely passes: no contact in them, and not beyond the goal. */
LANES_INLINE vector sure_pairs(const flight *f, int contacts, const vector count[], vector *cleared)
{
    *cleared = all((double)VI_PAIRS);
    for (int c = 0; c < contacts; ++c) {
        *cleared = smaller(count[c], *cleared);
    }
    return smaller(*cleared, whole_part(smaller(f->to_goal, all((double)VI_PAIRS))));
}

/* Lanes that pass all their pairs go on from there in the same round. */
LANES_INLINE void jump(const vi_lane_group *g, int at, int further, mask jumps, const vector q[], flight *f, phases *of)
{
    vector p = linear(g->one.end_p[2 * VI_PAIRS], at, &f->now);
    phases later = *of;
    turn_sines(g, at, further, 2 * VI_PAIRS, &later, &p);
    const state next = turned(g, at, VI_PAIRS, q[VI_PAIRS], p, &f->now);
    f->now = chosen(jumps, &next, &f->now);
    f->on = only(~jumps, f->on);
    f->jumped += only(jumps, all((double)VI_PAIRS));
    f->to_goal -= only(jumps, all((double)VI_PAIRS));
    for (int k = 0; k < further; ++k) {
        of->cosine[k] = choose(jumps, later.cosine[k], of->cosine[k]);
        of->sine[k] = choose(jumps, later.sine[k], of->sine[k]);
    }
}

/* Move on to the pair in which each lane may meet a contact, its goal or the end of its round. `of`: phases of the further
 * sines, now and then at the start of that pair. */
LANES_INLINE candidate choose_pair(const vi_lane_group *g, int at, int contacts, int further, flight *f, phases *of)
{
    candidate pair;
    vector count[VI_LANES_CONTACTS], cleared, q[VI_PAIRS + 1];
    for (int i = 0;; ++i) {
        READ_HERE();
        ends_of_pairs(g, at, further, f, of, q);
        const vector bend = 2.0 * half_of(g, at, further, &f->now, of);
        for (int c = 0; c < contacts; ++c) {
            count[c] = count_clear(g, at, c, f, q, bend);
        }
        pair.passed = sure_pairs(f, contacts, count, &cleared);
        const mask jumps = pair.passed == (double)VI_PAIRS;
        if (i == MOST_JUMPS || !any(jumps)) {
            break;
        }
        jump(g, at, further, jumps, q, f, of);
        bound(g, at, f);
    }
    const mask jumps = pair.passed == (double)VI_PAIRS;
    const vector length = larger(f->to_goal - pair.passed, all(0.0));
    pair.length = only(~jumps, smaller(length, all(1.0)));
    pair.goal = ~jumps & (length <= 1.0);
    pair.searched = ~jumps & (cleared == pair.passed);
    pair.twofold = pair.searched & ~pair.searched;
    pair.sign = pair.limit = pair.number = all(0.0);
    for (int c = contacts - 1; c >= 0; --c) {
        const mask met = pair.searched & (count[c] == pair.passed);
        pair.twofold |= met & (pair.number > 0.0);
        pair.sign = choose(met, load(g->sign[c] + at), pair.sign);
        pair.limit = choose(met, load(g->limit[c] + at), pair.limit);
        pair.number = choose(met, all((double)(c + 1)), pair.number);
    }
    pair.start = after_pairs(g, at, further, &f->now, of, q, pair.passed);
    return pair;
}

/* Result of a round for the lanes. */
typedef struct {
    vector share; /* passed share of the pair */
    vector q, p;
    vector slope; /* of the polynomial, before a rebound */
    mask hits, careful;
} arrival;

/* A search in a pair. `from`, `to`: the part that is judged, later the part with the contact. */
typedef struct {
    place from, to, end; /* end: of the pair, or the goal */
    stop stop;
    vector noise; /* rounding of y */
    mask open;    /* undecided beyond `from` */
    mask hits;
} pair_search;

LANES_INLINE pair_search begin_search(const vi_lane_group *g, int at, const flight *f, const candidate *pair,
                                      const vector term[], int order)
{
    const vector none = all(0.0);
    pair_search s = {.end = place_at(term, order, pair->length), .hits = none != none};
    s.from = (place){none, pair->start.q - term[0], pair->start.p * pair_of(g, at)};
    s.to = s.end;
    s.stop = (stop){pair->sign, pair->limit, (pair->passed == 0.0) & (f->on == pair->number)};
    s.noise = ROUNDING * (size_of(pair->limit) + size_of(term[0]) + size_of(term[1]) + size_of(s.end.added));
    s.open = pair->searched & ~pair->twofold;
    return s;
}

/* Judge the parts of a pair, in their order, up to the first that has a contact. Undecided parts are halved. */
LANES_INLINE void judge_parts(const vector term[], int order, pair_search *s)
{
    const bends b = bends_of(term, order);
    for (int i = 0; i < MOST_PARTS && any(s->open); ++i) {
        const verdict part = judge(&s->stop, term, &b, &s->from, &s->to, s->noise);
        const mask hits = s->open & part.hits, passes = s->open & part.clear, cuts = s->open & ~(hits | passes);
        s->hits |= hits;
        s->open &= ~(hits | (passes & (s->to.share == s->end.share)));
        if (any(s->open)) {
            s->from = either_place(passes & s->open, &s->to, &s->from);
            s->to = either_place(passes & s->open, &s->end, &s->to);
            s->stop.leaves &= s->from.share == 0.0;
            if (any(cuts)) {
                const place half = place_at(term, order, 0.5 * (s->from.share + s->to.share));
                s->to = either_place(cuts, &half, &s->to);
            }
        }
    }
}

/* Move to the contact, the goal or the end of a pair with these Taylor coefficients. */
LANES_INLINE arrival search(const vi_lane_group *g, int at, const flight *f, candidate *pair, const vector term[],
                             int order)
{
    pair_search s = begin_search(g, at, f, pair, term, order);
    judge_parts(term, order, &s);
    arrival a = {.hits = s.hits, .careful = pair->twofold};
    place stays = s.end;
    if (any(s.open)) {
        stays = either_place(s.open, &s.from, &s.end);
        a.careful |= s.open & (s.from.share == 0.0);
    }
    if (any(a.hits)) {
        const vector y = term[0] - pair->sign * pair->limit;
        const mask repeats = repeat_last(g, at, f->jumped + pair->passed, &pair->start);
        const place met = find_contact(g, at, a.hits, repeats, term, order, y, &s.from, &s.to);
        const mask left = (pair->passed == 0.0) & (f->on == pair->number);
        const mask lost = a.hits & (~(size_of(y + met.added) <= s.noise) | (left & (met.share < SHORTEST_RETURN)));
        a.hits &= ~lost;
        a.careful |= lost;
        stays = either_place(a.hits, &met, &stays);
    }
    pair->goal &= stays.share == pair->length;
    a.share = stays.share;
    a.slope = stays.slope;
    a.q = choose(a.hits, pair->sign * pair->limit, term[0] + stays.added);
    a.p = a.slope * pair_rate(g, at);
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
LANES_INLINE mask rebound(vi_lane_group *g, int at, int contacts, const candidate *pair, arrival *a)
{
    const vector approach = pair->sign * a->p;
    vector resolution = all(0.0);
    for (int c = 0; c < contacts; ++c) {
        resolution = choose(pair->number == (double)(c + 1), load(g->resolution[c] + at), resolution);
    }
    const vector restitution = restitution_of(g, at, contacts, a->hits, pair->number, approach);
    const vector after = restitution * approach;
    const vector fastest = larger(load(g->fastest_impact + at), only(a->hits, approach));
    const mask leaves = a->hits & ~((after > VI_LANE_TAIL * fastest) & (approach * approach > resolution));
    store(g->fastest_impact + at, fastest);
    store(g->hit + at, only(a->hits, pair->number));
    store(g->approach + at, only(a->hits, approach));
    a->p = choose(a->hits, -pair->sign * after, a->p);
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
LANES_INLINE bool one_round(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at, int contacts,
                            int further)
{
    flight f = begin_round(g, at);
    phases of;
    phases_of_round(g, at, further, f.now.cosine, f.now.sine, &of);
    if (plan->rate > 0.0) {
        sample_from(g, at, f.now.q, f.now.p, f.now.cosine, f.now.sine);
    }
    vector term[VI_SINE_ORDER + 1];
    candidate pair = choose_pair(g, at, contacts, further, &f, &of);
    expand(g, at, further, &pair.start, &of, term);
    arrival a = search(g, at, &f, &pair, term, order_with(further));
    const mask leaves = rebound(g, at, contacts, &pair, &a), moves = ~a.careful;
    const mask arrives = pair.goal & ~a.hits & moves, stays = a.careful & (pair.passed == 0.0);
    const vector impacts = load(g->impacts + at) + only(a.hits, all(1.0)), flown = f.jumped + pair.passed;
    /* the rest of the core counts cells */
    const vector cells = 2.0 * only(moves, a.share), one = only(cells >= 1.0, all(1.0)), share = cells - one;
    const vector q = choose(moves, a.q, pair.start.q);
    const vector p = choose(moves, a.p, pair.start.p);
    store(g->start_q[0] + at, f.start.q);
    store(g->start_p[0] + at, f.start.p);
    store(g->start_cosine + at, f.start.cosine);
    store(g->start_sine + at, f.start.sine);
    store(g->jumped + at, 2.0 * f.jumped);
    store(g->hit_pairs + at, choose(a.hits, flown, load(g->hit_pairs + at)));
    store(g->hit_q + at, choose(a.hits, pair.start.q, load(g->hit_q + at)));
    store(g->hit_p + at, choose(a.hits, pair.start.p, load(g->hit_p + at)));
    store(g->hit_share + at, choose(a.hits, a.share, load(g->hit_share + at)));
    store(g->passed + at, 2.0 * pair.passed + one);
    store(g->share + at, share);
    store(g->impacts + at, impacts);
    store(g->on + at, choose(a.hits, pair.number, only(stays, f.on)));
    move_clock(g, at, 2.0 * flown + one, share, arrives);
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
LANES_INLINE void run_rounds(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int contacts,
                             int further)
{
    const bool waits = some_wait(g);
    bool found = false;
    for (int i = 0; i < VI_MOST_ROUNDS && !found; ++i) {
        for (int at = 0; at < VI_LANES; at += VI_WIDTH) {
            if (waits) {
                note_start(g, at);
            }
            found |= one_round(g, plan, points, at, contacts, further);
        }
        if (waits) {
            note_rounds(g, plan, points);
        }
    }
}
