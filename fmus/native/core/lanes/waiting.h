/* The record of strobes and extremes, apart from the motion: flights of a lane wait, then fill whole vectors.
 *
 * Strobes cut the record of a round into flights of one period each; the motion is not cut. Without each_period only the
 * strobes that open and close the recording matter. Values do not depend on the flights that wait together, so they
 * depend neither on other lanes nor on the width of vectors.
 */
#ifndef VIBROIMPACT_LANE_WAITING_H
#define VIBROIMPACT_LANE_WAITING_H

#include "lanes/extremes.h"

/* Do flights of a lane wait for their record? */
static inline bool some_wait(const vi_lane_group *g)
{
    double found = 0.0;
    for (int lane = 0; lane < VI_LANES; ++lane) {
        found += g->record.waits[lane];
    }
    return found > 0.0;
}

/* Keep the instants at which a round of some lanes begins. */
LANES_INLINE void note_start(vi_lane_group *g, int at)
{
    vi_lane_record *r = &g->record;
    store(r->from_periods + at, load(g->periods + at));
    store(r->from_rest + at, load(g->rest + at));
    store(r->from_rest_low + at, load(g->rest_low + at));
    store(r->from_impacts + at, load(g->impacts + at));
}

/* Does the record need the strobe after `periods` whole periods of the clock? */
static inline bool is_recorded(const vi_lane_record *r, const vi_lanes_plan *plan, int lane, double periods, bool open)
{
    return plan->each_period || !open || periods >= r->last_turn[lane] - 1.0;
}

/* Begin a flight at the start of the round; after a strobe its start is set later. */
static inline int64_t begin_flight(vi_waiting_flights *w, const vi_lane_group *g, int lane)
{
    const int64_t n = w->flights++;
    w->q[n] = g->start_q[0][lane];
    w->p[n] = g->start_p[0][lane];
    w->cosine[n] = g->start_cosine[lane];
    w->sine[n] = g->start_sine[lane];
    w->end_q[n] = g->q[0][lane];
    w->periods[n] = g->record.from_periods[lane];
    w->rest[n] = g->record.from_rest[lane];
    w->strobes_before[n] = (int32_t)w->strobes;
    return n;
}

/* Keep a strobe of the present round, which ends a flight. */
static inline void add_strobe(vi_waiting_flights *w, const vi_lane_group *g, int lane, double cells, double turn)
{
    const int64_t n = w->strobes++;
    w->from_q[n] = g->start_q[0][lane];
    w->from_p[n] = g->start_p[0][lane];
    w->from_cosine[n] = g->start_cosine[lane];
    w->from_sine[n] = g->start_sine[lane];
    w->from_periods[n] = g->record.from_periods[lane];
    w->from_rest[n] = g->record.from_rest[lane];
    w->strobe_cells[n] = cells;
    w->turn[n] = turn;
    w->impacts[n] = g->record.from_impacts[lane];
    w->flight_before[n] = (int32_t)w->flights - 1;
}

/* Keep the round of a lane that has ended, cut at its strobes. */
static inline void note_round(vi_lane_group *g, const vi_lanes_plan *plan, int lane)
{
    vi_waiting_flights *w = &g->waiting[lane];
    const vi_lane_record *r = &g->record;
    const double cells = (g->jumped[lane] + g->passed[lane]) + g->share[lane];
    const double turns = g->periods[lane] - r->from_periods[lane];
    double passed = 0.0;
    int64_t flight = begin_flight(w, g, lane);
    for (double turn = 1.0; turn <= turns; turn += 1.0) {
        const double periods = r->from_periods[lane] + turn;
        if (is_recorded(r, plan, lane, periods, r->open[lane] > 0.0 || w->strobes > 0)) {
            const double to_strobe = (turn * g->period[lane] - r->from_rest[lane])
                                     + (turn * g->period_low[lane] - r->from_rest_low[lane]);
            const double place = vi_max(passed, vi_min(to_strobe * g->cell_rate[lane], cells));
            add_strobe(w, g, lane, place, periods);
            w->cells[flight] = place - passed;
            passed = place;
            flight = begin_flight(w, g, lane);
        }
    }
    w->cells[flight] = cells - passed;
}

/* ---- the record of a lane ---- */

/* Fill the last vectors with flights of no length, and with strobes at the start. */
static inline void fill_up(vi_waiting_flights *w)
{
    for (int64_t n = w->flights; n % VI_WIDTH != 0; ++n) {
        w->q[n] = w->p[n] = w->cosine[n] = w->sine[n] = w->cells[n] = w->end_q[n] = w->periods[n] = w->rest[n] = 0.0;
        w->strobes_before[n] = 0;
    }
    for (int64_t n = w->strobes; n % VI_WIDTH != 0; ++n) {
        w->from_q[n] = w->from_p[n] = w->from_cosine[n] = w->from_sine[n] = w->strobe_cells[n] = 0.0;
        w->from_periods[n] = w->from_rest[n] = 0.0;
    }
}

/* Set the phases of the further sines some cells after the starts of the rounds of a vector of strobes. */
LANES_INLINE void phases_after_cells(const vi_lane_group *g, int lane, const vi_waiting_flights *w, int64_t first,
                                     vector cells, phases *of)
{
    phases_of_lane(g, lane, vi_further_sines(g), load(w->from_periods + first),
                   load(w->from_rest + first) + cells * g->cell[lane], of);
}

/* Compute the states at the strobes. */
LANES_INLINE void compute_strobes(const vi_lane_group *g, int lane, int contacts, const vi_waiting_flights *w, double q_at[],
                                  double p_at[])
{
    for (int64_t first = 0; first < w->strobes; first += VI_WIDTH) {
        state now = {load(w->from_q + first), load(w->from_p + first), load(w->from_cosine + first),
                     load(w->from_sine + first)};
        const vector cells = load(w->strobe_cells + first);
        vector whole = whole_part(cells), term[VI_SINE_ORDER + 1], added, slope;
        const vector share = cells - whole, last = whole;
        phases of;
        phases_after_cells(g, lane, w, first, last - whole, &of);
        for (mask jumps = whole >= (double)VI_CELLS; any(jumps); jumps = whole >= (double)VI_CELLS) {
            const state next = after_cells(g, lane, VI_CELLS, &now, &of);
            now = chosen(jumps, &next, &now);
            whole -= only(jumps, all((double)VI_CELLS));
            phases_after_cells(g, lane, w, first, last - whole, &of);
        }
        now = after_own_cells(g, lane, &now, &of, whole);
        phases_after_cells(g, lane, w, first, last, &of);
        expand_of_lane(g, lane, &now, &of, term);
        evaluate_of_lane(g, term, share, &added, &slope);
        vector q = now.q + added;
        for (int c = 0; c < contacts; ++c) { /* beyond a stop by rounding: put on it */
            const double sign = g->sign[c][lane], limit = g->limit[c][lane];
            q = choose(sign * q > limit, all(sign * limit), q);
        }
        store(q_at + first, q);
        store(p_at + first, slope * g->cell_rate[lane]);
    }
}

/* Cut the flights at the strobes. */
static inline void cut_flights(vi_waiting_flights *w, const double q[], const double p[])
{
    for (int64_t n = 0; n < w->strobes; ++n) {
        const int32_t before = w->flight_before[n], after = before + 1;
        w->end_q[before] = w->q[after] = q[n];
        w->p[after] = p[n];
        w->cosine[after] = 1.0;
        w->sine[after] = 0.0;
        w->periods[after] = w->turn[n];
        w->rest[after] = 0.0;
    }
}

/* Write the open period, which a strobe ends. */
static inline void put_open_period(const vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int lane,
                                   double turn, double impacts)
{
    const vi_lane_record *r = &g->record;
    const double scale = r->scale[lane], a = scale * r->most[lane], b = scale * r->least[lane];
    double period[VI_PERIOD_WIDTH];
    period[VI_OF_LARGEST] = (a > b ? a : b) + 0.0; /* no sign of a zero */
    period[VI_OF_SMALLEST] = (a < b ? a : b) + 0.0;
    period[VI_OF_STROBE] = scale * r->strobe[lane];
    period[VI_OF_STROBE_VELOCITY] = scale * r->strobe_velocity[lane];
    period[VI_OF_IMPACTS] = impacts - r->impacts_before[lane];
    put_period(plan, points, (int64_t)r->point[lane], (int64_t)(turn - r->turn[lane]), period);
}

/* Record the waiting flights of a lane. The period after the last strobe stays open. */
static void record_waiting(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int lane)
{
    vi_waiting_flights *w = &g->waiting[lane];
    vi_lane_record *r = &g->record;
    const bool follows = r->extremes[lane] > 0.0;
    _Alignas(64) double q[VI_FLIGHTS], p[VI_FLIGHTS];
    range range_of[VI_FLIGHTS + 1];
    fill_up(w);
    compute_strobes(g, lane, plan->contacts, w, q, p);
    cut_flights(w, q, p);
    range_of[0] = (range){{r->most[lane], -r->least[lane]}};
    for (int64_t n = 0; n < w->strobes; ++n) {
        range_of[n + 1] = (range){{follows ? q[n] : (double)NAN, follows ? -q[n] : (double)NAN}};
    }
    if (follows) {
        follow_flights(g, lane, plan->contacts, range_of);
    }
    for (int64_t n = 0; n <= w->strobes; ++n) {
        r->most[lane] = range_of[n].most[UPPER];
        r->least[lane] = -range_of[n].most[LOWER];
        if (n < w->strobes) {
            if (r->open[lane] > 0.0) {
                put_open_period(g, plan, points, lane, w->turn[n], w->impacts[n]);
            }
            r->open[lane] = 1.0;
            r->turn[lane] = w->turn[n];
            r->strobe[lane] = q[n];
            r->strobe_velocity[lane] = p[n];
            r->impacts_before[lane] = w->impacts[n];
        }
    }
    w->flights = w->strobes = 0;
}

/* Keep the round of a lane that has ended. */
static inline void note_and_record(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points, int lane)
{
    if (g->waiting[lane].flights > VI_FLIGHTS - (1 + VI_STROBES_OF_ROUND)) {
        record_waiting(g, plan, points, lane);
    }
    note_round(g, plan, lane);
}

/* Keep the rounds of all lanes; record those of lanes whose runs may end. */
static inline void note_rounds(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points)
{
    for (int lane = 0; lane < VI_LANES; ++lane) {
        if (g->record.waits[lane] > 0.0) {
            const double event = g->event[lane];
            note_and_record(g, plan, points, lane);
            if (event == VI_EVENT_GOAL || event == VI_EVENT_IMPACT) {
                record_waiting(g, plan, points, lane);
            }
        }
    }
}

#endif
