/* The lockstep of bodies of several modes: certified cells, ever shorter up to a contact, which the search finds.
 * Included by one C file for each instruction set; it names VI_ROUNDS, the lockstep for all bodies. */
#include "lanes/many_extremes.h"
#include "lanes/many_samples.h"
#include "lanes/many_tables.h"
#include "lanes/rounds_yielding.h"

/* Result of a search for the lanes. */
typedef struct {
    mask hits, careful, arrives;
    vector half;   /* passed shortest cells; `first` has the share of one more */
    meeting first;
} search_result;

/* Search the lanes whose next cell may have a contact, or has the goal; the lanes move on as far as is sure. */
LANES_INLINE search_result search_many(const vi_lane_group *g, int at, int modes, int contacts,
                                       const vector amplitude[], mask searched, certified_flight *s)
{
    const vector to_goal = seconds_to_goal(g, at) * load(g->cell_rate + at), none = all(0.0);
    searched_cell cell;
    derivatives d;
    vector q[VI_REAL_MODES], p[VI_REAL_MODES];
    cell.amplitude = amplitude;
    choose_half(g, at, modes, contacts, s, to_goal - s->passed * load(g->many.present.cells + at), &cell);
    expand_modes(g, at, modes, &cell.start, &d);
    search_result r = {.half = only(searched, cell.half), .first = {cell.length, none, none, none != none, none, none}};
    for (int c = 0; c < contacts; ++c) {
        const mask met = searched & s->met[c];
        if (any(met)) {
            meet(g, at, modes, c, met, &cell, &d, &r.first);
        }
    }
    const mask moves = searched & ~r.first.careful;
    r.careful = r.first.careful;
    r.hits = moves & (r.first.number > 0.0);
    r.arrives = moves & cell.goal & ~r.hits;
    r.first.number = only(r.hits, r.first.number);
    state_at(g, at, modes, &d, r.first.share, q, p);
    for (int j = 0; j < modes; ++j) {
        s->now.q[j] = choose(moves, q[j], choose(searched, cell.start.q[j], s->now.q[j]));
        s->now.p[j] = choose(moves, p[j], choose(searched, cell.start.p[j], s->now.p[j]));
    }
    r.first.share = only(moves, r.first.share);
    return r;
}

/* Rebound at the hit contacts; returns the lanes that leave lockstep. */
LANES_INLINE mask rebound_many(vi_lane_group *g, int at, int modes, int contacts, const search_result *r,
                                 modal_state *now)
{
    const vector approach = r->first.approach * load(g->cell_rate + at), number = r->first.number;
    const vector after = restitution_of(g, at, contacts, r->hits, number, approach) * approach;
    const vector fastest = larger(load(g->fastest_impact + at), only(r->hits, approach));
    const vector resolution = 2.0 * 2.220446049250313e-16 * (r->first.pull * r->first.size);
    for (int c = 0; c < contacts; ++c) {
        const vector change = only(number == (double)(c + 1), approach + after);
        for (int j = 0; j < modes; ++j) {
            now->p[j] -= load(g->many.kick[c][j] + at) * change;
        }
        for (int j = 0; j < modes && g->coupling != NULL; ++j) {
            now->q[j] -= load(g->many.shift[c][j] + at) * change;
        }
    }
    store(g->fastest_impact + at, fastest);
    store(g->hit + at, number);
    store(g->approach + at, only(r->hits, approach));
    return r->hits & ~((after > VI_LANE_TAIL * fastest) & (approach * approach > resolution));
}

/* Put the tables for the next round in place: longer cells after a whole round, shorter ones before a contact. */
LANES_INLINE void change_level(vi_lane_group *g, int at, int modes, int contacts, mask whole)
{
    const vector level = load(g->many.level + at), last = load(g->many.last + at);
    const vector next = choose(whole, larger(level - 1.0, all(0.0)), smaller(level + 1.0, last));
    store(g->many.start_level + at, level);
    store(g->many.level + at, next);
    const mask changed = next != level;
    if (any(changed)) {
        for (int i = 0; i < VI_WIDTH; ++i) {
            if (changed[i]) {
                vi_lane_put_level(g, at + i, modes, contacts);
            }
        }
    }
}

/* Read the state at the start of a round, and bound the amplitudes of the modes from there on. */
LANES_INLINE void begin_round_many(vi_lane_group *g, int at, int modes, cells_ahead *ahead, vector amplitude[])
{
    const vi_many_modes *many = &g->many;
    vector cosine, sine;
    turn(load(g->angular_frequency + at) * load(g->rest + at), &cosine, &sine);
    store(g->start_cosine + at, ahead->cosine[0] = cosine);
    store(g->start_sine + at, ahead->sine[0] = sine);
    for (int j = 0; j < modes; ++j) {
        const vector q = load(g->q[j] + at), p = load(g->p[j] + at);
        amplitude[j] = size_of(q) + size_of(p + load(many->mix[j] + at) * q) * load(many->reach[j] + at);
        store(g->start_q[j] + at, ahead->q[j][0] = q);
        store(g->start_p[j] + at, ahead->p[j][0] = p);
    }
}

/* Store the state at the end of a round. */
LANES_INLINE void end_round_many(vi_lane_group *g, int at, int modes, const certified_flight *s, const search_result *r)
{
    const vector passed = s->passed + (r->half + r->first.share);
    for (int j = 0; j < modes; ++j) {
        store(g->q[j] + at, s->now.q[j]);
        store(g->p[j] + at, s->now.p[j]);
    }
    store(g->passed + at, s->passed);
    store(g->share + at, r->half + r->first.share);
    store(g->impacts + at, load(g->impacts + at) + only(r->hits, all(1.0)));
    store(g->on + at, choose(r->hits, r->first.number, only(passed == 0.0, load(g->on + at))));
}

/* Turn the periods of lanes at their goals, as turn_periods. */
LANES_INLINE mask turn_periods_many(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at,
                                    certified_flight *s, mask arrives)
{
    const vector goal = load(g->goal_periods + at), last = load(g->record.last_turn + at);
    const mask turns = arrives & (goal < last) & (load(g->record.doubtful + at) == 0.0);
    if (any(turns)) {
        vector displacement, velocity;
        s->now.cosine = all(1.0);
        s->now.sine = all(0.0);
        contact_at(g, at, vi_real_modes(plan), VI_LANES_CONTACTS, &s->now, &displacement, &velocity);
        end_periods(g, plan, points, at, turns);
        begin_periods(g, at, turns, displacement, velocity);
        store(g->goal_periods + at, goal + only(turns, all(1.0)));
    }
    return turns;
}

/* Record the round; true when a lane has an event. */
LANES_INLINE bool record_round_many(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at,
                                    mask leaves, certified_flight *s, const search_result *r)
{
    const mask written = r->hits & ~leaves & (load(g->record.impacts + at) > 0.0);
    if (any(written)) {
        write_impacts(g, points, at, plan->contacts, written);
    }
    const mask turns = any(r->arrives) ? turn_periods_many(g, plan, points, at, s, r->arrives) : r->arrives;
    vector event = only(load(g->record.doubtful + at) > 0.0, all((double)VI_EVENT_FLIGHT));
    event = choose(r->hits & (load(g->impacts + at) >= load(g->most_impacts + at)), all((double)VI_EVENT_IMPACT),
                   event);
    event = choose(r->arrives & ~turns, all((double)VI_EVENT_GOAL), event);
    event = choose(r->careful, all((double)VI_EVENT_CELL), event);
    event = choose(leaves, all((double)VI_EVENT_LEAVE), event);
    store(g->event + at, event);
    return any(event > 0.0);
}

LANES_INLINE bool one_round_many(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int at)
{
    const int modes = vi_real_modes(plan), contacts = plan->contacts;
    cells_ahead ahead;
    certified_flight s;
    vector amplitude[VI_REAL_MODES];
    if (plan->further) {
        set_sines(g, at, vi_own_modes(plan), plan->further);
    }
    begin_round_many(g, at, modes, &ahead, amplitude);
    if (plan->rate > 0.0) {
        sample_instants_from(g, at);
    }
    const vector to_goal = seconds_to_goal(g, at) * load(g->many.present.rate + at), none = all(0.0);
    const vector most = whole_part(smaller(larger(to_goal, none), all((double)VI_CELLS)));
    fly(g, at, modes, contacts, amplitude, most, &ahead, &s);
    const mask whole = s.passed == (double)VI_CELLS, never = none != none;
    const mask searched = ~whole & (load(g->many.level + at) == load(g->many.last + at));
    search_result r = {never, never, never, none, {none, none, none, never, none, none}};
    if (any(searched)) {
        r = search_many(g, at, modes, contacts, amplitude, searched, &s);
    }
    move_clock(g, at, s.passed * load(g->many.present.cells + at) + r.half, r.first.share, r.arrives);
    if (plan->rate > 0.0 && any(may_have_samples(g, at))) {
        take_samples_of_many(g, plan, points, at);
    }
    mask doubtful = never;
    if (any(load(g->record.extremes + at) > 0.0)) {
        doubtful = extend_range(g, at, modes, amplitude, &ahead, &s.now, s.passed, r.half + r.first.share);
    }
    store(g->record.doubtful + at, only(doubtful, all(1.0)));
    const mask leaves = any(r.hits) ? rebound_many(g, at, modes, contacts, &r, &s.now) : never;
    end_round_many(g, at, modes, &s, &r);
    const bool found = record_round_many(g, plan, points, at, leaves, &s, &r);
    change_level(g, at, modes, contacts, whole);
    return found;
}

LANES_INLINE void run_rounds_many(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points)
{
    bool found = false;
    for (int i = 0; i < VI_MOST_ROUNDS && !found; ++i) {
        for (int at = 0; at < VI_LANES; at += VI_WIDTH) {
            found |= one_round_many(g, plan, points, at);
        }
    }
}

LANES_APART rounds_of_modes(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points)
{
    run_rounds_many(g, plan, points);
}

LANES_APART rounds_at_yielding_stops(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points)
{
    if (plan->contacts < 2) {
        run_phase_rounds(g, plan, points, 1);
    } else {
        run_phase_rounds(g, plan, points, 2);
    }
}

/* Two further sines: a number that compilers know. */
LANES_APART rounds_under_three_sines(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points)
{
    run_rounds(g, plan, points, 1, 2);
}

LANES_APART rounds_under_sines(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points)
{
    if (plan->contacts < 2) {
        run_rounds(g, plan, points, 1, plan->further);
    } else {
        run_rounds(g, plan, points, 2, plan->further);
    }
}

LANES_APART rounds_at_one_stop(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points)
{
    run_rounds(g, plan, points, 1, 0);
}

LANES_APART rounds_at_two_stops(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points)
{
    run_rounds(g, plan, points, 2, 0);
}

void VI_ROUNDS(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points)
{
    /* a body without a contact has tables of an idle lane there: nothing meets it */
    if (plan->modes > 1) {
        rounds_of_modes(g, plan, points);
    } else if (plan->yielding) {
        rounds_at_yielding_stops(g, plan, points);
    } else if (plan->further == 2 && plan->contacts < 2) {
        rounds_under_three_sines(g, plan, points);
    } else if (plan->further) {
        rounds_under_sines(g, plan, points);
    } else if (plan->contacts < 2) {
        rounds_at_one_stop(g, plan, points);
    } else {
        rounds_at_two_stops(g, plan, points);
    }
}
